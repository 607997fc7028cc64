"""Which attempts are gone through, and in what order: what browsing and reviewing have in common."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from handsight.cli.completion import complete_attempt
from handsight.cli.errors import CommandError

Suspect = Annotated[
    bool, typer.Option("--suspect", help="Likely label issues first, as of 'dataset suspect', which takes minutes.")
]
Like = Annotated[
    str,
    typer.Option(
        "--like",
        metavar="ATTEMPT",
        help="Those that look most like this one first.",
        autocompletion=complete_attempt,
    ),
]
Sort = Annotated[str, typer.Option("--sort", metavar="COLUMN", help="Column to order by, smallest first.")]
Reverse = Annotated[bool, typer.Option("--reverse", help="The largest first or, without --sort, the newest.")]
DrawnModel = Annotated[
    Path | None, typer.Option("--model", metavar="RUN", help="Draw what this network expects into attempts.")
]


def choice_faults(
    attempts: list[str] | None, where: str, filter: str, *, sort: str, suspect: bool, like: str
) -> list[str]:
    """How options contradict each other: attempts that are named and described, or more than one order."""
    faults = []
    if attempts and (where or filter or suspect or like or sort):
        faults.append("attempts are named and --where, --filter, --sort, --suspect or --like given, expected either")
    if suspect + bool(like) + bool(sort) > 1:
        faults.append("more than one of --suspect, --like and --sort is given, expected one order at most")
    return faults


def check_likeness(like: str, model: Path | None) -> None:
    """Refuse an order by likeness that no network sees.

    Raises:
        CommandError: There is no network.
    """
    if like and model is None:
        raise CommandError("--like is given without a network that sees the likeness: add --model RUN")
