"""``handsight dataset ls|show``: attempts as a table, and one of them in full."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import typer
from rich.console import Console

from handsight.cli.dataset.curation import Filter, Where
from handsight.cli.errors import CommandError
from handsight.cli.options import Dataset, Json
from handsight.cli.output import console, errors, print_json, print_table
from handsight.datasets.errors import counted
from handsight.datasets.reading.listing import Listed, Listing, list_attempts
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.records import GraspAttempt, StationSpec

HEADINGS = {
    "outcome": "outcome",
    "target": "target",
    "pregrasp_x_m": "x [m]",
    "pregrasp_y_m": "y [m]",
    "pregrasp_angle_rad": "angle [rad]",
    "width_final_m": "width [m]",
    "failure": "failure",
}
"""The columns that are shown unless others are asked for, and what stands over them."""


def register(app: typer.Typer) -> None:
    """Add the commands to ``handsight dataset``."""
    app.command("ls")(ls)
    app.command("show")(show)


def ls(
    dataset: Dataset,
    where: Where = "",
    filter: Filter = "",
    sort: Annotated[
        str, typer.Option("--sort", metavar="COLUMN", help="Smallest first, missing values last; shows the first rows.")
    ] = "",
    reverse: Annotated[bool, typer.Option("--reverse", "-r", help="Largest first; without --sort, newest.")] = False,
    columns: Annotated[
        str, typer.Option("--columns", metavar="A,B,C", help="Columns to show; any of those that --json prints.")
    ] = "",
    limit: Annotated[int, typer.Option("--limit", "-n", help="Rows to show; 0 shows all.")] = 20,
    ids: Annotated[bool, typer.Option("--ids", help="Print ids alone, to pass to another command.")] = False,
    as_json: Json = False,
) -> None:
    """List attempts, excluded ones too: the newest of those that match, newest last."""
    if ids and columns:
        raise CommandError(f"--ids prints no columns, and --columns is {columns!r}: leave one of the two out")
    listing = Listing(
        where=where,
        filter=filter,
        sort=sort,
        reverse=reverse,
        columns=() if ids else _columns(columns, sort, as_json=as_json),
        limit=limit,
    )
    found = list_attempts(GraspDataset.open(dataset), listing)
    if ids:
        keys = found.rows.index.tolist()
        print_json(keys) if as_json else console.print("\n".join(keys))
        if len(keys) < found.matched:  # Who passes them on should know that there are more.
            _print_counts(found, listing, errors)
    elif as_json:
        # As objects, because a row of numbers alone would turn whole numbers into fractions.
        print_json([{"attempt": key, **_json_row(row)} for key, row in found.rows.astype(object).iterrows()])
    else:
        _print_rows(found, headings={} if columns else HEADINGS)
        _print_counts(found, listing, console)


def show(
    dataset: Dataset,
    attempt: Annotated[str, typer.Argument(help="Attempt id, as printed by ls.")],
    picture: Annotated[
        Path | None,
        typer.Option("--picture", metavar="FILE.png", help="Draw what was seen, and the grasp in it."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Print everything known of an attempt."""
    if picture is not None:
        _check_picture(picture)
    opened = GraspDataset.open(dataset)
    recorded = opened.attempt(attempt)  # checks the id, and every stored byte against its checksum
    facts = _json_row(opened.rows([attempt]).iloc[0])
    station = opened.station(attempt)
    if picture is not None:
        _draw(picture, attempt, recorded, station, success=facts["success"])
    if as_json:
        print_json({"attempt": attempt, **facts, "station": station})
        return
    console.print(f"[bold]{attempt}[/]")
    for name, value in facts.items():
        console.print(f"  {name:<22} {_cell(value)}")
    intrinsics = station.camera.intrinsics
    console.print(f"  {'station':<22} {station.source}, camera {intrinsics.width}x{intrinsics.height}")
    if picture is not None:
        console.print(f"[bold]{picture}[/]: what was seen, and the grasp in it")


# The next two import what draws when it is wanted: Matplotlib and PyTorch take seconds.
def _check_picture(path: Path) -> None:
    from handsight.viz.figures.style import check_figure_path

    check_figure_path(path, ".png")


def _draw(path: Path, name: str, attempt: GraspAttempt, station: StationSpec, *, success: bool | None) -> None:
    from handsight.viz.figures.attempt import attempt_figure

    attempt_figure(path, name, attempt, station, success=success)


def _columns(text: str, sort: str, *, as_json: bool) -> tuple[str, ...] | None:
    """What to read: the columns asked for; else all for programs, and for people a few and what is sorted by."""
    if text:
        return tuple(dict.fromkeys(name.strip() for name in text.split(",")))
    return None if as_json else tuple(dict.fromkeys([*HEADINGS, *([sort] if sort else [])]))


def _print_rows(found: Listed, *, headings: dict[str, str]) -> None:
    names = [str(name) for name in found.rows.columns]
    rows = [(str(key), *map(_cell, row)) for key, *row in found.rows.itertuples(name=None)]
    print_table(("attempt", *(headings.get(name, name) for name in names)), rows)


def _print_counts(found: Listed, listing: Listing, to: Console) -> None:
    """How many match and how many are shown; nothing where the table is all there is."""
    shown = len(found.rows)
    which = f"the {'first' if listing.sort else 'last'} {shown}"
    order = f" by {listing.sort}, {'largest' if listing.reverse else 'smallest'} first" if listing.sort else ""
    if listing.where or listing.filter:
        match = f"{found.matched} of {counted(found.total, 'attempt')} match"
        if shown < found.matched:
            to.print(f"{match}; shown are {which}{order}; --limit 0 shows all")
        else:
            to.print(match + (", all shown" if shown else ""))
    elif shown < found.total:
        to.print(f"{which} of {found.total}{order}; --limit 0 shows all")


def _json_row(row: pd.Series[Any]) -> dict[str, Any]:
    return {str(name): _json_cell(value) for name, value in row.items()}


def _json_cell(value: Any) -> Any:
    if isinstance(value, tuple):
        return list(value)
    return None if pd.isna(value) else value.isoformat() if isinstance(value, pd.Timestamp) else value


def _cell(value: Any) -> str:
    if isinstance(value, list | tuple):
        return ", ".join(map(str, value))
    if value is None or pd.isna(value):
        return "-"
    return f"{value:.4f}" if isinstance(value, float) else str(value)
