"""``README.md`` of a sweep's folder: what was run, on what, and what came of it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence

from handsight.datasets.errors import counted
from handsight.training.intervals import MeanOverTrials
from handsight.training.sweep.plan import SweepPlan
from handsight.training.sweep.table import SweepDifference, SweepRow


def readme(
    plan: SweepPlan,
    rows: Sequence[SweepRow],
    differences: Sequence[SweepDifference],
    counts: Mapping[str, int],
) -> str:
    """The page, in Markdown."""
    total = sum(counts.values())
    paragraphs = [
        "# Accuracy on objects never seen, by what a network reads and how much it learnt from",
        f"```sh\n{command_of(plan)}\n```",
        f"{counts['done']} of {counted(total, 'cell')} trained"
        + (f", {counts['failed']} failed" if counts["failed"] else "")
        + f", by handsight {plan.handsight}. The plan is in `plan.json`, every cell in `cells/` and `cells.csv`.",
        "![Accuracy against size](figure7.png)",
        _data(plan),
        f"Each of the {counted(plan.trials, 'trial')} (seed {plan.seed}) draws {plan.held_out:.0%} of the groups, by "
        f"{plan.by}, and holds out all of their attempts; as many successes as failures of these are the test set. "
        "Training sets are the first attempts of a random order of all others, the same for every series, so that a "
        "larger one holds the smaller ones. Accuracy is that at a predicted success above 0.5.",
        "Intervals are 95 % of the mean over trials by Student's t, with the variance corrected for training sets that "
        "overlap (Nadeau and Bengio 2003): of thirty trials, three times as wide as if they were independent.",
        _table(
            ("series", "attempts", "trials", "balanced accuracy", "AUC"),
            [
                (row.series, f"{row.trained_on:,.0f}", str(row.accuracy.trials), _said(row.accuracy), _said(row.auc))
                for row in rows
            ],
        ),
    ]
    if differences:
        paragraphs += [
            "## Differences, trial by trial",
            _table(
                ("series", "against", "attempts", "trials", "accuracy", "p", "AUC", "p"),
                [
                    (
                        row.series,
                        row.against,
                        "all" if row.size is None else f"{row.size:,}",
                        str(row.accuracy.trials),
                        _said(row.accuracy, sign="+"),
                        _p(row.accuracy),
                        _said(row.auc, sign="+"),
                        _p(row.auc),
                    )
                    for row in differences
                ],
            ),
        ]
    return "\n\n".join(paragraphs) + "\n"


def command_of(plan: SweepPlan) -> str:
    """The call that has this plan, but for where to."""
    words = ["handsight", "ablate", "run", *(one.address for one in plan.datasets)]
    options = {
        "channels": ",".join(plan.channels),
        "sizes": ",".join("all" if size is None else str(size) for size in plan.sizes),
        "trials": str(plan.trials),
        "by": plan.by,
        "held-out": str(plan.held_out),
        "seed": str(plan.seed),
        "epochs": str(plan.recipe.epochs),
        "viewpoint": plan.datasets[0].viewpoint,
    }
    for name, value in options.items():
        words += [f"--{name}", value]
    words.append("--balance" if plan.recipe.balance else "--no-balance")
    for name, values in plan.varied.items():
        words += ["--vary", f"{name}={','.join(values)}"]
    return shlex.join([*words, "--out", "DIR"])


def _data(plan: SweepPlan) -> str:
    return _table(
        ("dataset", "snapshot", "digest", "picture", "labelled attempts"),
        [(one.address, one.snapshot, one.digest[:16], one.viewpoint, f"{one.attempts:,}") for one in plan.datasets],
    )


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *rows))


def _said(mean: MeanOverTrials, *, sign: str = "") -> str:
    if mean.low is None or mean.high is None:
        return f"{mean.mean:{sign}.3f}"
    return f"{mean.mean:{sign}.3f} ({mean.low:{sign}.3f} to {mean.high:{sign}.3f})"


def _p(mean: MeanOverTrials) -> str:
    return "-" if mean.p is None else f"{mean.p:.2g}"
