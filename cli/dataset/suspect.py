"""``handsight dataset suspect``: label issues, the labels to look at again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from handsight.cli.opening import open_version
from handsight.cli.options import LARGEST_SEED, MOST_ATTEMPTS, MOST_EPOCHS, Dataset, Json
from handsight.cli.output import console, errors, print_json, print_table


def suspect(
    dataset: Dataset,
    folds: Annotated[
        str, typer.Option("--folds", metavar="NAME", help="Stored folds to use; without it three are made, not stored.")
    ] = "",
    epochs: Annotated[int, typer.Option(max=MOST_EPOCHS, help="Passes over the data for each network.")] = 10,
    count: Annotated[int, typer.Option("--count", "-n", min=1, max=MOST_ATTEMPTS, help="How many to list.")] = 20,
    where: Annotated[
        str,
        typer.Option("--where", metavar="EXPRESSION", help="List only such attempts; the networks learn from all."),
    ] = "",
    # A negative one is refused together with whatever else is wrong.
    seed: Annotated[int, typer.Option("--seed", max=LARGEST_SEED, help="Everything random follows from it.")] = 0,
    rrd: Annotated[
        Path | None, typer.Option("--rrd", metavar="FILE", help="Also write them as a recording, for 'rerun FILE'.")
    ] = None,
    as_json: Json = False,
) -> None:
    """List the likeliest label issues, lowest label quality first; nothing in the dataset changes.

    The quality of a label is its probability by a network that never saw the attempt: each is trained on all folds but
    one and judges that one. How rare a label is counts half in choosing the list, or successes, which are hard to
    foresee, would fill it.
    """
    opened = open_version(dataset)
    from handsight.cli.wiring.label_review import checked_plan, review_labels, write_review  # PyTorch and Rerun

    plan = checked_plan(opened, folds=folds, epochs=epochs, where=where, seed=seed, rrd=rrd)
    data, review = review_labels(opened, plan, count)
    if rrd is not None:
        write_review(rrd, opened, data, review.issues)
    if as_json:
        errors.print(review.trust, soft_wrap=True)
        print_json(review.issues)
        return
    rows = [
        (
            issue.attempt,
            f"{issue.label_quality:.3f}",
            issue.label,
            f"{issue.predicted_success:.3f}",
            issue.simulator,
            issue.target or "-",
        )
        for issue in review.issues
    ]
    print_table(("attempt", "quality", "label", "predicted", "simulator", "target"), rows)
    console.print(review.trust)
    look = "write them to a recording with --rrd FILE" if rrd is None else f"look at them with 'rerun {rrd}'"
    console.print(f"{look}, then correct labels with 'handsight dataset relabel' or leave attempts out with 'exclude'")
