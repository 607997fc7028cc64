"""``handsight dataset similar``: attempts that a network finds alike."""

from __future__ import annotations

from typing import Annotated

import typer

from handsight.cli.completion import complete_attempt
from handsight.cli.errors import CommandError
from handsight.cli.opening import checked_address, open_version
from handsight.cli.options import MOST_ATTEMPTS, Dataset, Json, Model
from handsight.cli.output import console, print_json
from handsight.cli.tables import Column, print_table
from handsight.datasets.errors import counted
from handsight.training.run_folder import check_finished_run


def similar(
    dataset: Dataset,
    attempt: Annotated[
        str,
        typer.Argument(
            metavar="[ATTEMPT]", help="The attempt to compare with, unless --groups.", autocompletion=complete_attempt
        ),
    ] = "",
    *,
    model: Model,
    groups: Annotated[bool, typer.Option("--groups", help="List groups of near-duplicates instead.")] = False,
    least: Annotated[
        float, typer.Option("--least", min=0.0, max=1.0, help="Likeness from which --groups joins two attempts.")
    ] = 0.999,
    count: Annotated[int, typer.Option("--count", "-n", min=1, max=MOST_ATTEMPTS, help="How many to list.")] = 10,
    as_json: Json = False,
) -> None:
    """List the attempts that a network finds most like one of them, or groups of near-duplicates.

    Likeness is the cosine of what the network makes of two inputs before it decides: the attempts alike are those of
    which it thinks the same for the same reasons. See them with 'view dataset --like'.
    """
    checked_address(dataset)
    check_finished_run(model)
    if bool(attempt) == groups:
        raise CommandError("expected either an attempt to compare with, or --groups")
    opened = open_version(dataset)
    from handsight.cli.wiring.similarity import attempt_features, similar_attempts  # PyTorch
    from handsight.datasets.reading.attempt_ids import resolve_attempt_ids, short_id
    from handsight.evaluation.similarity import near_duplicate_groups

    short = short_id(opened)
    if groups:
        found = near_duplicate_groups(*attempt_features(opened, model), least=least)
        if as_json:
            print_json({"groups": found, "least": least})
            return
        listed = [(str(len(group)), " ".join(map(short, group))) for group in found[:count]]
        print_table(("attempts", Column(heading="which", prose="wrap")), listed)
        console.print(f"{counted(len(found), 'group')} of near-duplicates")
        return
    (asked,) = resolve_attempt_ids(opened, [attempt])
    nearest = similar_attempts(opened, asked, model)[1 : count + 1]
    if as_json:
        print_json({"attempt": asked, "similar": nearest})
        return
    known = opened.rows([one.attempt for one in nearest], ("outcome", "target", "success"))
    rows = [
        (one.attempt, f"{one.similarity:.4f}", str(known["outcome"][one.attempt]), str(known["target"][one.attempt]))
        for one in nearest
    ]
    print_table((Column(heading="attempt", short=short), "likeness", "outcome", "target"), rows)
