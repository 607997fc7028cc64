"""What a report tells of an evaluation: success with intervals, moves, calibration, and why grasps failed."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from typing import Any

from handsight.datasets.errors import counted
from handsight.evaluation.causes import CAUSES
from handsight.viz.figures.calibration import calibration_figure
from handsight.viz.figures.durations import durations_figure
from handsight.viz.figures.method_table import method_table_figure
from handsight.viz.report.content import Block, Facts, Figure, Note, Section, Table, shown_rows
from handsight.viz.report.embedding import embedded_svg
from handsight.viz.report.words import count, figure, interval, percent, said

MOST_ROWS = 500


def evaluation_section(results: dict[str, Any], *, title: str, failures: Sequence[Block] = ()) -> Section:
    """All tables of an evaluation, drawn too.

    Args:
        results: What ``evaluate --json`` printed, once it was checked.
        title: Of the section.
        failures: Pictures of trials that failed, if there are any.
    """
    command = evaluation_command(results)
    parts = [_success(results, command), _moves(results, command), _calibration(results, command)]
    blocks = [*_causes(results, command), *failures, *_trials(results, command)]
    return Section(
        title=title,
        blocks=(_facts(results),),
        parts=(*filter(None, parts), Section(title="Failures", blocks=tuple(blocks)), _lineage(results)),
    )


def evaluation_command(results: dict[str, Any]) -> str:
    """The call that evaluates the same, as far as what it printed says."""
    rows = results["rows"]
    words = ["handsight", "evaluate", "--model", results["model"]]
    words += ["--methods", ",".join(dict.fromkeys(row["method"] for row in rows))]
    words += ["--objects", ",".join(dict.fromkeys(row["objects"] for row in rows))]
    words += ["--trials", str(max(row["trials"] + row["aborted"] for row in rows))]
    words += ["--gripper", results["gripper"], "--threshold", f"{results['threshold']:g}"]
    words += ["--seed", str(results["seed"])]
    if results.get("disturbance"):
        words += ["--disturb", str(results["disturbance"])]
    if results.get("level"):
        words += ["--level"]
    return shlex.join(words)


def _facts(results: dict[str, Any]) -> Facts:
    sets = dict.fromkeys(row["objects"] for row in results["rows"])
    return Facts(
        rows=(
            ("run", results["model"]),
            ("objects", ", ".join(sets)),
            ("gripper", results["gripper"]),
            ("threshold", f"S > {results['threshold']:g}"),
            ("disturbance", said(results.get("disturbance"))),
            ("views levelled", said(results.get("level"))),
        )
    )


def _success(results: dict[str, Any], command: str) -> Section:
    rows = results["rows"]
    table = Table(
        caption="Success of each method, with Wilson's 95 % interval",
        head=("method", "objects", "held", "trials", "rate", "95 % interval", "aborted", "moves", "ms a step"),
        rows=tuple(
            (
                row["method"],
                row["objects"],
                count(row["successes"]),
                count(row["trials"]),
                percent(row["rate"]) if row["trials"] else "–",
                interval(row["ci95"]) if row["trials"] else "–",
                count(row["aborted"]),
                figure(row["mean_steps"], 1),
                figure(row["step_ms"], 1),
            )
            for row in rows
        ),
        prose=frozenset({1}),
        command=command,
    )
    blocks: list[Block] = [table]
    if results.get("fault"):
        blocks.insert(0, Note(text=f"Nothing counts: {results['fault']}"))
    if drawn := [row for row in rows if row["trials"]]:
        told = "; ".join(f"{row['method']} on {row['objects']} {percent(row['rate'])}" for row in drawn)
        blocks.insert(
            0,
            Figure(
                picture=embedded_svg(lambda path: method_table_figure(drawn, path)),
                alt=f"Success rates with 95 % intervals beside those of the paper's Table I: {told}.",
                caption="Success of each method and the time a step takes, beside Table I of the paper.",
                command=f"{command} --figures figures",
            ),
        )
    if results["comparisons"]:
        blocks.append(_comparisons(results["comparisons"], command))
    return Section(title="Success", blocks=tuple(blocks))


def _comparisons(rows: Sequence[dict[str, Any]], command: str) -> Table:
    return Table(
        caption="Paired with the reference on the same trials; p of McNemar's exact test, two-sided",
        head=("method", "against", "objects", "pairs", "won", "lost", "p"),
        rows=tuple(
            (
                row["method"],
                row["against"],
                row["objects"],
                count(row["pairs"]),
                count(row["won"]),
                count(row["lost"]),
                f"{row['p']:.2g}",
            )
            for row in rows
        ),
        prose=frozenset({1, 2}),
        command=command,
    )


def _moves(results: dict[str, Any], command: str) -> Section | None:
    rows = results["durations"]
    if not rows:
        return None
    picture = Figure(
        picture=embedded_svg(lambda path: durations_figure(rows, path)),
        alt="Bars of trials by the number of servo moves before the grasp, and how many of them held; as in the table.",
        caption="How many moves each method took, and how many of those grasps held (figure 9 of the paper).",
        command=f"{command} --figures figures",
    )
    table = Table(
        caption="The same in numbers, where there were trials",
        head=("method", "objects", "moves", "trials", "held"),
        rows=tuple(
            (
                row["method"],
                row["objects"],
                f"{row['moves']} (limit)" if row["limit"] else str(row["moves"]),
                count(row["trials"]),
                count(row["successes"]),
            )
            for row in rows
            if row["trials"]
        ),
        prose=frozenset({1}),
        command=command,
        folded=True,
    )
    return Section(title="Servo moves", blocks=(picture, table) if table.rows else (picture,))


def _calibration(results: dict[str, Any], command: str) -> Section | None:
    rows = results["calibration"]
    if not rows:
        return None
    picture = Figure(
        picture=embedded_svg(lambda path: calibration_figure(rows, path)),
        alt="Success rates with 95 % intervals over the score at the grasp, beside the diagonal; as in the table.",
        caption="Whether grasps hold as often as the network says; on the diagonal they do.",
        command=f"{command} --figures figures",
    )
    table = Table(
        caption="Success by the score at the grasp",
        head=("method", "objects", "score", "mean score", "held", "trials", "rate", "95 % interval"),
        rows=tuple(
            (
                row["method"],
                row["objects"],
                f"{row['low']:g} to {row['high']:g}",
                f"{row['mean_score']:.3f}",
                count(row["successes"]),
                count(row["trials"]),
                percent(row["rate"]),
                interval(row["ci95"]),
            )
            for row in rows
        ),
        prose=frozenset({1}),
        command=f"{command} --calibration",
        folded=len(rows) > 12,
    )
    return Section(title="Calibration", blocks=(picture, table))


def _causes(results: dict[str, Any], command: str) -> list[Block]:
    rows = results["causes"]
    names = dict.fromkeys(cause for row in rows for cause in row["causes"])
    occurring = [name for name in names if any(row["causes"].get(name) for row in rows)]
    if not occurring:
        return [Note(text="No trial that counts failed.", command=f"{command} --causes")]
    table = Table(
        caption="Failures by cause",
        head=("method", "objects", "failures", "trials", *occurring, "below the threshold"),
        rows=tuple(
            (
                row["method"],
                row["objects"],
                count(row["failures"]),
                count(row["trials"]),
                *(count(row["causes"].get(name, 0)) for name in occurring),
                count(row["unsure"]),
            )
            for row in rows
        ),
        prose=frozenset({1}),
        command=f"{command} --causes",
    )
    meaning = Facts(rows=tuple((name, CAUSES.get(name, "–")) for name in occurring))
    return [table, meaning]


def _trials(results: dict[str, Any], command: str) -> list[Block]:
    failed = [one for one in results["trials"] if not one["success"]]
    if not failed:
        return []
    rows, left = shown_rows(
        tuple(
            (
                f"{one['method']}, trial {one['number']}",
                one["objects"],
                figure(one["score"], 2),
                str(one["moves"]),
                "aborted" if one["aborted"] else "failed",
                one["failure"] or "–",
            )
            for one in failed
        ),
        MOST_ROWS,
    )
    table = Table(
        caption=f"{counted(len(failed), 'trial')} that failed{left}",
        head=("trial", "objects", "score at the grasp", "moves", "how it ended", "what went wrong"),
        rows=rows,
        prose=frozenset({1, 4, 5}),
        command=f"{command} --json",
        folded=True,
    )
    return [table]


def _lineage(results: dict[str, Any]) -> Section:
    facts = Facts(rows=(("weights", results["weights_sha256"]), ("seed of the trials", str(results["seed"]))))
    origins = results.get("trained_on")
    if not isinstance(origins, list):
        return Section(title="Lineage", blocks=(facts,))
    known = [one for one in origins if isinstance(one, dict)]
    names = ("dataset", "ref", "attempts", "view", "snapshot", "digest")
    table = Table(
        caption="The network was trained on",
        head=("dataset", "version", "attempts", "picture", "snapshot", "content digest"),
        rows=tuple(tuple(said(one.get(name)) for name in names) for one in known),
        prose=frozenset({1, 3, 4, 5}),
    )
    return Section(title="Lineage", blocks=(facts, table) if known else (facts,))
