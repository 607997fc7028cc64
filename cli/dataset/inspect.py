"""``handsight dataset info|log|ls|show|stats``: what a version holds, as a whole and attempt by attempt."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from handsight.cli.completion import complete_attempt, complete_columns
from handsight.cli.errors import CommandError
from handsight.cli.opening import open_repository, open_version
from handsight.cli.options import MOST_ATTEMPTS, Dataset, Filter, Json, Where
from handsight.cli.output import bold, console, errors, print_json
from handsight.cli.tables import Column, print_facts, print_prose, print_table, short_snapshot, short_time, written
from handsight.datasets.errors import counted

if TYPE_CHECKING:
    # These take a second to import; a command does so once its dataset is known to be there.
    import pandas as pd

    from handsight.datasets.reading.listing import Listed, Listing
    from handsight.datasets.reading.reader import GraspDataset
    from handsight.datasets.reading.stats import LabelStats, Share
    from handsight.datasets.records import GraspAttempt, StationSpec
    from handsight.training.lineage import KnownRun

SHOWN = {
    "outcome": Column(heading="outcome", rank=1),
    "excluded": Column(heading="excluded", rank=3),
    "target": Column(heading="target", rank=2),
    "pregrasp_x_m": Column(heading="x [m]", rank=6),
    "pregrasp_y_m": Column(heading="y [m]", rank=7),
    "pregrasp_angle_rad": Column(heading="angle [rad]", rank=8),
    "width_final_m": Column(heading="width [m]", rank=5),
    "failure": Column(heading="failure", rank=4, prose="clip"),
}
"""The columns that are shown unless others are asked for, and how they give way."""
ONLY_WHERE_ANY = ("excluded", "failure")
"""Those of them that are left out where no attempt that is shown has any."""


def info(dataset: Dataset, as_json: Json = False) -> None:
    """Summarise a version: size, balance, digest, and the runs that were trained on it."""
    version = open_version(dataset)
    from handsight.training.lineage import runs_trained_on  # a second; see above

    facts, runs = version.info(), runs_trained_on(version)
    if as_json:
        print_json({**asdict(facts), "runs": runs})
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
    print_facts(rows)
    if runs:
        _print_runs(runs)


def _print_runs(runs: Sequence[KnownRun]) -> None:
    rows = [
        (_shown_path(one.run), written(one.created), one.weights_sha256[:12], "" if one.exists else "gone")
        for one in runs
    ]
    columns = (
        Column(heading="trained on it", prose="clip"),
        Column(heading="created (UTC)", rank=2, short=short_time),
        Column(heading="weights", rank=3),
        Column(heading="", rank=1),
    )
    print_table(columns, rows)


def _shown_path(path: str) -> str:
    """A path as it can be typed here, where that is shorter."""
    here = os.path.relpath(path)
    return path if here.startswith("..") else here


def log(dataset: Dataset, as_json: Json = False) -> None:
    """List the commits of a version, newest first."""
    repository, ref = open_repository(dataset)
    entries = repository.log(ref)
    if as_json:
        print_json(entries)
        return
    from handsight.datasets.reading.attempt_ids import short_ids  # a second; see above

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
    columns = (
        Column(heading="snapshot", short=short_snapshot(entry.snapshot_id for entry in entries)),
        Column(heading="written (UTC)", rank=2, short=short_time),
        Column(heading="added", rank=3),
        Column(heading="refs", rank=1),
        Column(heading="message", prose="wrap", short=short_ids(entry.session for entry in entries if entry.session)),
    )
    print_table(columns, rows)


def ls(
    dataset: Dataset,
    where: Where = "",
    filter: Filter = "",
    sort: Annotated[
        str,
        typer.Option(
            "--sort",
            metavar="COLUMN",
            help="Smallest first, missing values last; shows the first rows.",
            autocompletion=complete_columns,
        ),
    ] = "",
    reverse: Annotated[bool, typer.Option("--reverse", "-r", help="Largest first; without --sort, newest.")] = False,
    columns: Annotated[
        str,
        typer.Option(
            "--columns",
            metavar="A,B,C",
            help="Columns to show; any of those that --json prints.",
            autocompletion=complete_columns,
        ),
    ] = "",
    limit: Annotated[int, typer.Option("--limit", "-n", max=MOST_ATTEMPTS, help="Rows to show; 0 shows all.")] = 20,
    ids: Annotated[bool, typer.Option("--ids", help="Print ids alone, to pass to another command.")] = False,
    as_json: Json = False,
) -> None:
    """List attempts, excluded ones too: the newest of those that match, newest last.

    Where room is short, ids are written as SESSION-NUMBER, which every command takes, and columns are left out.
    """
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
            errors.print(_counts(found, listing))
    elif as_json:
        # As objects, because a row of numbers alone would turn whole numbers into fractions.
        print_json([{"attempt": key, **_json_row(row)} for key, row in found.rows.astype(object).iterrows()])
    else:
        _print_rows(found, version, chosen=bool(columns))
        _print_counts(found, listing)


def show(
    dataset: Dataset,
    attempt: Annotated[
        str,
        typer.Argument(
            metavar="ATTEMPT",
            help="Id as printed by ls, a unique beginning of one, or a number.",
            autocompletion=complete_attempt,
        ),
    ],
    picture: Annotated[
        Path | None,
        typer.Option("--picture", metavar="FILE.png", help="Draw what was seen, and the grasp in it."),
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Also conditions that other sessions of the dataset varied, and this did not.")
    ] = False,
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
    still = () if everything else conditions_not_varied(opened, station)
    intrinsics = station.camera.intrinsics
    console.print(bold(attempt))
    print_facts(
        [
            *((name, _cell(value) or "-") for name, value in facts.items() if name not in still),
            ("station", f"{station.source}, camera {intrinsics.width}x{intrinsics.height}"),
        ],
        indent=2,
    )
    if still:
        console.print(f"  {counted(len(still), 'condition')} not varied in its session; --all shows them")
    if picture is not None:
        console.print(bold(picture), ": what was seen, and the grasp in it")


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
    print_prose(
        f"{found.successes} of {counted(found.labelled, 'labelled attempt')} succeed; "
        f"left out: {found.unlabelled} without a label, {found.excluded} excluded"
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
        console.print(bold(plot), ": the same as a figure, with place and time")


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


def conditions_not_varied(dataset: GraspDataset, station: StationSpec) -> set[str]:
    """Conditions that some session of a version varied, and one with this station did not."""
    varied = {name for session in dataset.sessions for name in session.header.station.conditions}
    return varied - set(station.conditions)


def _share_row(share: Share) -> tuple[str, str, str]:
    return share.name, str(share.attempts), f"{share.rate:.1%}" if share.attempts else "-"


def _columns(text: str, sort: str, *, as_json: bool) -> tuple[str, ...] | None:
    """What to read: the columns asked for; else all for programs, and for people a few and what is sorted by."""
    if text:
        return tuple(dict.fromkeys(name.strip() for name in text.split(",")))
    return None if as_json else tuple(dict.fromkeys([*SHOWN, *([sort] if sort else [])]))


def _print_rows(found: Listed, version: GraspDataset, *, chosen: bool) -> None:
    """The table; ``chosen`` says that its columns were asked for by name."""
    from handsight.datasets.reading.attempt_ids import short_id  # a second; see above

    cells = {str(name): [_cell(value) for value in values] for name, values in found.rows.items()}
    if not chosen:
        cells["excluded"] = ["yes" if value == "True" else "" for value in cells["excluded"]]
        cells = {name: column for name, column in cells.items() if any(column) or name not in ONLY_WHERE_ANY}
    columns = [
        # Of columns that were asked for, the last go first; what is sorted by is asked for too.
        Column(heading=name, rank=at if chosen else 0) if chosen or name not in SHOWN else SHOWN[name]
        for at, name in enumerate(cells, 1)
    ]
    keys = [str(key) for key in found.rows.index]
    rows = [list(row) for row in zip(keys, *cells.values(), strict=True)]
    print_table([Column(heading="attempt", short=short_id(version)), *columns], rows)


def _print_counts(found: Listed, listing: Listing) -> None:
    said = _counts(found, listing)
    if said:
        print_prose(said)


def _counts(found: Listed, listing: Listing) -> str:
    """How many match and how many are shown; nothing where the table is all there is."""
    shown = len(found.rows)
    which = f"the {'first' if listing.sort else 'last'} {shown}"
    order = f" by {listing.sort}, {'largest' if listing.reverse else 'smallest'} first" if listing.sort else ""
    if listing.where or listing.filter:
        match = f"{found.matched} of {counted(found.total, 'attempt')} match"
        if shown < found.matched:
            return f"{match}; shown are {which}{order}; --limit 0 shows all"
        return match + (", all shown" if shown else "")
    return f"{which} of {found.total}{order}; --limit 0 shows all" if shown < found.total else ""


def _json_row(row: pd.Series[Any]) -> dict[str, Any]:
    return {str(name): _json_cell(value) for name, value in row.items()}


def _json_cell(value: Any) -> Any:
    import pandas as pd  # here, as everything that is slow to import

    if isinstance(value, tuple):
        return list(value)
    return None if pd.isna(value) else value.isoformat() if isinstance(value, pd.Timestamp) else value


def _cell(value: Any) -> str:
    import numpy as np  # here, as everything that is slow to import
    import pandas as pd

    if isinstance(value, list | tuple):
        return ", ".join(map(str, value))
    if value is None or pd.isna(value):
        return "-"
    return f"{value:.4f}" if isinstance(value, float | np.floating) else str(value)
