"""The text beside a servo trace."""

from __future__ import annotations

import math
from itertools import zip_longest

import rerun as rr

from handsight.datasets.errors import counted
from handsight.evaluation.causes import CAUSES, cause_of
from handsight.evaluation.trial import TrialRecording
from handsight.servoing.loop import ServoStep


def outcome(recording: TrialRecording) -> str:
    """One or two words for how the trial ended."""
    trial = recording.trial
    return "failed" if trial.failure else "held" if trial.success else "empty"


def cause(recording: TrialRecording) -> str:
    """Why the grasp failed, in a few words; empty for one that held."""
    return cause_of(recording.trial, recording.station.closed_width_m) or ""


def under_way(method: str, number: int, steps: int, score: float) -> rr.TextDocument:
    """Markdown, while the run is not over."""
    lines = [f"# {method} · trial {number}", "", f"{counted(steps, 'step')} so far, S {score:.3f}"]
    return rr.TextDocument("\n".join(lines) + "\n", media_type="text/markdown")


def compute_ms(compute_s: float) -> str:
    """Time per servo step, where there is one."""
    return "—" if math.isnan(compute_s) else f"{1e3 * compute_s:.0f} ms"


def trial_summary(recording: TrialRecording) -> rr.TextDocument:
    """Markdown: how the trial ended, then what every servo step saw and chose."""
    trial, trace = recording.trial, recording.trace
    verdict = "threshold reached" if trace.confident else "best pose seen, below the threshold"
    rows = [
        ("grasp", f"**{outcome(recording)}**" + (f" ({trial.failure})" if trial.failure else "")),
        ("final S", f"{trace.grasp_score:.3f}, {verdict}"),
        ("threshold", f"{trace.threshold:.2f}"),
        ("moves", str(trial.moves)),
        ("compute", f"{compute_ms(trial.compute_s)} per step"),
    ]
    if why := cause(recording):
        rows.insert(1, ("cause", f"**{why}**"))
    if trial.truth_held is not None:
        rows.append(("truth", "object held" if trial.truth_held else "nothing held"))
    table = [f"| {name} | {value} |" for name, value in rows]
    # Markdown tables need a head: the first row is one.
    lines = [f"# {trace.method} · trial {trial.number}", "", table[0], "|:--|:--|", *table[1:]]
    if why:
        lines += ["", f"{why}: {CAUSES[why]}."]
    return rr.TextDocument("\n".join(lines) + "\n", media_type="text/markdown")


def step_table(recording: TrialRecording) -> rr.TextDocument:
    """Markdown: what every servo step saw and chose, for reading off numbers."""
    heads = ("step", "S(p)", "S(p+Δp)", "Δx mm", "Δy mm", "Δθ °", "view off by", "look", "compute")
    lines = [f"| {' | '.join(heads)} |", "|--:" * len(heads) + "|"]
    steps = recording.trace.steps
    lines += [_step_row(number, step, after) for number, (step, after) in enumerate(zip_longest(steps, steps[1:]))]
    return rr.TextDocument("\n".join(lines) + "\n", media_type="text/markdown")


def _step_row(number: int, step: ServoStep, after: ServoStep | None) -> str:
    cells = [str(number), f"{step.score:.3f}"]
    if step.proposal is None:
        cells += ["—"] * 4
    else:
        dx_m, dy_m, dangle_rad = step.proposal.step.tolist()
        cells += [
            f"{step.predicted:.3f}",
            f"{1e3 * dx_m:+.1f}",
            f"{1e3 * dy_m:+.1f}",
            f"{math.degrees(dangle_rad):+.1f}",
        ]
    cells += [_off_by(step, after), compute_ms(step.look_s), compute_ms(step.compute_s)]
    return "| " + " | ".join(cells) + " |"


def _off_by(step: ServoStep, after: ServoStep | None) -> str:
    """Root mean square of the difference of colours between the view predicted and the next one."""
    if step.predicted_inputs is None or after is None:
        return "—"
    wrong = step.predicted_inputs[:3] - after.inputs[:3]
    return f"{float(wrong.square().mean().sqrt()):.3f}"
