"""``handsight dataset suspect``: label issues, the labels to look at again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from handsight.cli.completion import complete_folds
from handsight.cli.opening import open_version
from handsight.cli.options import LARGEST_SEED, MOST_ATTEMPTS, MOST_EPOCHS, Dataset, Json
from handsight.cli.output import console, errors, print_json
from handsight.cli.tables import Column, print_prose, print_table
from handsight.datasets.errors import pasteable


def suspect(
    dataset: Dataset,
    folds: Annotated[
        str,
        typer.Option(
            "--folds",
            metavar="NAME",
            help="Stored folds to use; without it three are made, not stored.",
            autocompletion=complete_folds,
        ),
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
    from handsight.datasets.reading.attempt_ids import short_id
    from handsight.evaluation.label_review import curation_commands

    plan = checked_plan(opened, folds=folds, epochs=epochs, where=where, seed=seed, rrd=rrd)
    data, review = review_labels(opened, plan, count)
    if rrd is not None:
        write_review(rrd, opened, data, review.issues)
    if as_json:
        errors.print(review.trust)
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
    columns = (
        Column(heading="attempt", short=short_id(opened)),
        Column(heading="quality", rank=2),
        "label",
        Column(heading="predicted", rank=1),
        Column(heading="simulator", rank=3),
        Column(heading="target", rank=4),
    )
    print_table(columns, rows)
    print_prose(review.trust)
    if rrd is None:
        console.print("with --rrd FILE they are written to a recording, to be looked at")
    else:
        console.print(f"look at them with {pasteable('rerun', rrd)}")
    if review.issues:
        console.print("then correct a label or leave an attempt out; of the first, with")
        for command in curation_commands(opened, review.issues[0]):
            console.print(f"  {command}")
