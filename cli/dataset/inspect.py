"""``handsight dataset info|log|ls|show|stats``: what a version holds, as a whole and attempt by attempt."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from handsight.cli.errors import CommandError
from handsight.cli.opening import open_repository, open_version
from handsight.cli.options import MOST_ATTEMPTS, Dataset, Filter, Json, Where
from handsight.cli.output import Output, console, errors, print_json, print_table
from handsight.datasets.errors import counted

if TYPE_CHECKING:
    # These take a second to import; a command does so once its dataset is known to be there.
    import pandas as pd

    from handsight.datasets.reading.listing import Listed, Listing
    from handsight.datasets.reading.stats import LabelStats, Share
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


def info(dataset: Dataset, as_json: Json = False) -> None:
    """Summarise a version: size, balance, digest."""
    facts = open_version(dataset).info()
    if as_json:
        print_json(facts)
        return
    labelled = facts.outcomes["held"] + facts.outcomes["empty"]
    share = f" ({facts.successes / labelled:.1%} of {labelled} labelled)" if labelled else ""
    rows = [
        ("version", f"{facts.ref} ({facts.snapshot})"),
        ("attempts", f"{facts.attempts} in {counted(facts.sessions, 'session')}"),
        ("successes", f"{facts.successes}{share}"),
        ("outcomes", ", ".join(f"{count} {name}" for name, count in facts.outcomes.items())),
        ("excluded", str(facts.excluded)),
        ("objects", f"{sum(count > 0 for count in facts.objects.values())} targeted of {len(facts.objects)}"),
        ("on disk", f"{facts.bytes / 1e6:.1f} MB"),
        ("schema", str(facts.schema_version)),
        ("digest", facts.digest),
    ]
    for name, value in rows:
        console.print(f"[bold]{name:<10}[/] {value}")


def log(dataset: Dataset, as_json: Json = False) -> None:
    """List the commits of a version, newest first."""
    repository, ref = open_repository(dataset)
    entries = repository.log(ref)
    if as_json:
        print_json(entries)
        return
    rows = [
        (
            entry.snapshot_id,
            f"{entry.written_at:%Y-%m-%d %H:%M:%S}",
            f"{entry.attempts_added}",
            ", ".join(entry.refs),
            entry.message,
        )
        for entry in entries
    ]
    print_table(("snapshot", "written (UTC)", "added", "refs", "message"), rows)


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
    limit: Annotated[int, typer.Option("--limit", "-n", max=MOST_ATTEMPTS, help="Rows to show; 0 shows all.")] = 20,
    ids: Annotated[bool, typer.Option("--ids", help="Print ids alone, to pass to another command.")] = False,
    as_json: Json = False,
) -> None:
    """List attempts, excluded ones too: the newest of those that match, newest last."""
    if ids and columns:
        raise CommandError(f"--ids prints no columns, and --columns is {columns!r}: leave one of the two out")
    version = open_version(dataset)
    from handsight.datasets.reading.listing import Listing, list_attempts  # a second; see above

    listing = Listing(
        where=where,
        filter=filter,
        sort=sort,
        reverse=reverse,
        columns=() if ids else _columns(columns, sort, as_json=as_json),
        limit=limit,
    )
    found = list_attempts(version, listing)
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
    attempt: Annotated[
        str, typer.Argument(metavar="ATTEMPT", help="Id as printed by ls, a unique beginning of one, or a number.")
    ],
    picture: Annotated[
        Path | None,
        typer.Option("--picture", metavar="FILE.png", help="Draw what was seen, and the grasp in it."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Print everything known of an attempt."""
    opened = open_version(dataset)
    from handsight.datasets.reading.attempt_ids import resolve_attempt_ids  # a second; see above

    if picture is not None:
        _check_picture(picture)
    (attempt,) = resolve_attempt_ids(opened, [attempt])
    recorded = opened.attempt(attempt)  # checks every stored byte against its checksum
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


def stats(
    dataset: Dataset,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE", help="Draw it, with place and time too, as .png or .svg."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Show how labels are spread over objects, sessions, angles, openings and forces."""
    opened = open_version(dataset)
    from handsight.datasets.reading.stats import label_stats  # a second; see above

    if plot is not None:
        _check_plot(plot)
    found = label_stats(opened)
    if plot is not None:
        name = str(opened.repository.path).rpartition("/")[2]
        _draw_stats(found, plot, f"{name}@{opened.ref}")
    if as_json:
        print_json(found)
        return
    console.print(
        f"{found.successes} of {counted(found.labelled, 'labelled attempt')} succeed; "
        f"{found.unlabelled} carry no label, {found.excluded} are excluded"
    )
    for title, shares in (
        ("object", found.objects),
        ("session", found.sessions),
        ("angle [rad]", found.angle_rad),
        ("final opening [m]", found.width_m),
        ("contact force [N]", found.force_n),
    ):
        print_table((title, "attempts", "successful"), [_share_row(share) for share in shares])
    if plot is not None:
        console.print(f"[bold]{plot}[/]: the same as a figure, with place and time")


# The next four import what draws when it is wanted: Matplotlib takes a second.
def _check_picture(path: Path) -> None:
    from handsight.viz.figures.style import check_figure_path

    check_figure_path(path, ".png")


def _draw(path: Path, name: str, attempt: GraspAttempt, station: StationSpec, *, success: bool | None) -> None:
    from handsight.viz.figures.attempt import attempt_figure

    attempt_figure(path, name, attempt, station, success=success)


def _check_plot(path: Path) -> None:
    from handsight.viz.figures.dataset import SUFFIXES
    from handsight.viz.figures.style import check_figure_path

    check_figure_path(path, *SUFFIXES)


def _draw_stats(found: LabelStats, path: Path, title: str) -> None:
    from handsight.viz.figures.dataset import stats_figure

    stats_figure(found, path, title=title)


def _share_row(share: Share) -> tuple[str, str, str]:
    return share.name, str(share.attempts), f"{share.rate:.1%}" if share.attempts else "-"


def _columns(text: str, sort: str, *, as_json: bool) -> tuple[str, ...] | None:
    """What to read: the columns asked for; else all for programs, and for people a few and what is sorted by."""
    if text:
        return tuple(dict.fromkeys(name.strip() for name in text.split(",")))
    return None if as_json else tuple(dict.fromkeys([*HEADINGS, *([sort] if sort else [])]))


def _print_rows(found: Listed, *, headings: dict[str, str]) -> None:
    names = [str(name) for name in found.rows.columns]
    rows = [(str(key), *map(_cell, row)) for key, *row in found.rows.itertuples(name=None)]
    print_table(("attempt", *(headings.get(name, name) for name in names)), rows)


def _print_counts(found: Listed, listing: Listing, to: Output) -> None:
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
    import pandas as pd  # here, as everything that is slow to import

    if isinstance(value, tuple):
        return list(value)
    return None if pd.isna(value) else value.isoformat() if isinstance(value, pd.Timestamp) else value


def _cell(value: Any) -> str:
    import pandas as pd  # here, as everything that is slow to import

    if isinstance(value, list | tuple):
        return ", ".join(map(str, value))
    if value is None or pd.isna(value):
        return "-"
    return f"{value:.4f}" if isinstance(value, float) else str(value)
