"""``handsight dataset export|import|merge|materialize``: datasets in other forms and other places."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from handsight.cli.completion import complete_dataset, complete_session, complete_version, words
from handsight.cli.dataset.author import author_named
from handsight.cli.opening import checked_address, open_repository, open_version
from handsight.cli.options import EXPORT_FORMAT_NAMES, FORMAT_NAMES, Author, Dataset, DryRun, Json, TargetBranch
from handsight.cli.output import bold, console, print_json, progress_bar
from handsight.datasets.errors import counted, pasteable
from handsight.datasets.inputs.viewpoint import DEFAULT_VIEWPOINT

if TYPE_CHECKING:
    # These take a second to import; a command does so once its dataset is known to be there.
    from handsight.datasets.exchange.transfer import TransferReport

_EDITS = {"RELABEL": "relabelled", "EXCLUDE": "excluded", "RESTORE": "restored"}
"""What an import does to attempts that the source's user has edited, by the action of the decision."""

AllowMismatch = Annotated[
    bool, typer.Option("--allow-mismatch", help="Take sessions recorded with another camera, mount or gripper.")
]


def export_command(
    dataset: Dataset,
    target: Annotated[Path, typer.Argument(help="File or folder to make; nothing may be there.")],
    format: Annotated[
        str,
        typer.Option("--format", "-f", help="One of hdf5, zarr, lerobot.", autocompletion=words(*EXPORT_FORMAT_NAMES)),
    ],
    as_json: Json = False,
) -> None:
    """Write a version, curation included, in another format."""
    version = open_version(dataset)
    from handsight.datasets.exchange.commands import export_dataset  # a second; see above

    attempts = sum(session.attempts for session in version.sessions)
    with progress_bar("export", attempts) as bar:
        export_dataset(version, target, format=format, on_attempt=bar.advance)
    if as_json:
        print_json({"format": format, "target": target, "attempts": attempts, "digest": version.digest})
        return
    console.print(f"exported {counted(attempts, 'attempt')} of {dataset} to ", bold(target), f" ({format})")


def import_command(
    source: Annotated[Path, typer.Argument(help="File or folder to import.")],
    dataset: Annotated[
        str,
        typer.Argument(metavar="DATASET", help="Where to; made where there is none.", autocompletion=complete_dataset),
    ],
    format: Annotated[
        str | None,
        typer.Option(
            "--format",
            "-f",
            help="One of hdf5, zarr, lerobot, images, instead of looking.",
            autocompletion=words(*FORMAT_NAMES),
        ),
    ] = None,
    map: Annotated[
        Path | None,
        typer.Option("--map", help="TOML file that says what the columns of a foreign LeRobot or HDF5 set mean."),
    ] = None,
    branch: TargetBranch = "main",
    allow_mismatch: AllowMismatch = False,
    author: Author = "",
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Add what another format holds to a dataset: all of it or, after any fault, nothing.

    What handsight exported needs no map; a table of pictures and the map of a foreign set are in docs/datasets.md.
    """
    from handsight.datasets.exchange.commands import import_dataset  # a second; see above

    with progress_bar("import", 0) as bar:
        report = import_dataset(
            source,
            dataset,
            format=format,
            map=map,
            branch=branch,
            allow_mismatch=allow_mismatch,
            dry_run=dry_run,
            author=author_named(author),
            on_total=partial(bar.of, 0),
            on_attempt=bar.advance,
        )
    if as_json:
        mapped = {} if report.preview is None else {"mapped": report.preview}
        print_json({"format": report.format, "created": report.created, **_as_json(report.transfer), **mapped})
        return
    _print_report(report.transfer, f"{source} ({report.format})", dataset, branch, dry_run=dry_run)
    if report.preview is not None:
        _print_preview(report.preview)


def merge_command(
    source: Annotated[
        str, typer.Argument(metavar="SOURCE[@REF]", help="Dataset to copy from.", autocompletion=complete_version)
    ],
    dataset: Annotated[
        str, typer.Argument(metavar="DATASET", help="Dataset to copy to.", autocompletion=complete_dataset)
    ],
    session: Annotated[
        list[str] | None,
        typer.Option(
            "--session",
            "-s",
            help="ULID of a session to copy, or its beginning; repeat it. All by default.",
            autocompletion=complete_session,
        ),
    ] = None,
    branch: TargetBranch = "main",
    allow_mismatch: AllowMismatch = False,
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Copy sessions of one dataset into another; those it has already are left out."""
    checked_address(dataset)
    version = open_version(source)
    target, _ = open_repository(dataset)
    from handsight.datasets.exchange.merge import merge  # a second; see above

    with progress_bar("merge", 0) as bar:
        report = merge(
            version,
            target,
            sessions=session,
            branch=branch,
            allow_mismatch=allow_mismatch,
            dry_run=dry_run,
            on_total=partial(bar.of, 0),
            on_attempt=bar.advance,
        )
    if as_json:
        print_json(_as_json(report))
        return
    _print_report(report, source, dataset, branch, dry_run=dry_run)


def materialize_command(
    dataset: Dataset,
    viewpoint: Annotated[
        Literal["overhead", "pregrasp"], typer.Option(help="Picture that is warped to the grasp.")
    ] = DEFAULT_VIEWPOINT,
    size_px: Annotated[int, typer.Option("--size", help="Side of the inputs [px].")] = 64,
    as_json: Json = False,
) -> None:
    """Make the network inputs of a version, and print where they are."""
    version = open_version(dataset)
    from handsight.datasets.inputs.materialize import materialize  # PyTorch, two seconds more
    from handsight.servoing.homography import InputGrid

    with progress_bar("warp", sum(session.attempts for session in version.sessions)) as bar:
        data = materialize(version, viewpoint=viewpoint, grid=InputGrid(size_px=size_px), on_attempt=bar.advance)
    facts = {"file": data.file, "shape": list(data.inputs.shape), "successes": int(data.labels.sum())}
    if as_json:
        print_json(facts)
        return
    console.print(f"{counted(len(data.inputs), 'input')} of {dataset} in ", bold(data.file))


def _as_json(report: TransferReport) -> dict[str, object]:
    return {
        "sessions": list(report.sessions),
        "attempts": report.attempts,
        "duplicates": list(report.duplicates),
        "snapshot": report.snapshot,
        **{
            name: [attempt for edit in report.edits if edit.action.name == action for attempt in edit.attempts]
            for action, name in _EDITS.items()
        },
    }


def _print_report(report: TransferReport, source: str, target: str, branch: str, *, dry_run: bool) -> None:
    verb = "would add" if dry_run else "added"
    sessions = f"{counted(len(report.sessions), 'session')} with {counted(report.attempts, 'attempt')}"
    console.print(f"{verb} {sessions} of {source} to ", bold(target))
    for ulid in report.duplicates:
        console.print(f"left out session {ulid}: its attempts are there already")
    for edit in report.edits:
        done = f"{'would have ' if dry_run else ''}{_EDITS[edit.action.name]} {counted(len(edit.attempts), 'attempt')}"
        label = "" if edit.value is None else f" as {'success' if edit.value else 'failure'}"
        call = pasteable("handsight", "dataset", "undo", f"{target}@{branch}", edit.number)
        undo = "" if dry_run else f"; take it back with {call}"
        console.print(f"{done}{label}: {edit.reason}{undo}")


def _print_preview(preview: dict[str, Any]) -> None:
    """What a map made of a set, to be compared with what its owner knows of the first attempt."""
    console.print(f"{preview['held']} held, {preview['empty']} empty")
    first = preview["first"]
    console.print(f"the first is {first['name']}, {'held' if first['held'] else 'empty'}:")
    width, height = first["picture_px"]
    depth = "no depth" if first["depth_units"] is None else "depth {} to {} units".format(*first["depth_units"])
    console.print("  picture {}x{}, {}, tool at {} {} {} m".format(width, height, depth, *first["picture_tool_xyz_m"]))
    x_m, y_m, angle_rad = first["grasp_x_y_m_angle_rad"]
    console.print(f"  grasp at {x_m} {y_m} {first['grasp_z_m']} m, {angle_rad} rad")
