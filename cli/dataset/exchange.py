"""``handsight dataset export|import|merge|materialize``: datasets in other forms and other places."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from handsight.cli.options import Dataset, Json
from handsight.cli.output import console, print_json, progress_bar
from handsight.datasets.address import DatasetAddress
from handsight.datasets.exchange.commands import export_dataset, import_dataset
from handsight.datasets.exchange.formats import EXPORT_FORMATS, FORMATS
from handsight.datasets.exchange.merge import merge
from handsight.datasets.exchange.transfer import TransferReport
from handsight.datasets.format.schema import VIEWPOINTS, Viewpoint
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.store.repository import GraspRepository

_IMPORTED = "; ".join(f"{one.name}: {one.description}" for one in FORMATS)

Branch = Annotated[str, typer.Option("--branch", help="Branch of the target that moves.")]
AllowMismatch = Annotated[
    bool, typer.Option("--allow-mismatch", help="Take sessions recorded with another camera, mount or gripper.")
]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Check and report, and change nothing.")]


def register(app: typer.Typer) -> None:
    """Add the commands to ``handsight dataset``."""
    app.command("export")(export_command)
    app.command("import")(import_command)
    app.command("merge")(merge_command)
    app.command("materialize")(materialize_command)


def export_command(
    dataset: Dataset,
    target: Annotated[Path, typer.Argument(help="File or folder to make; nothing may be there.")],
    format: Annotated[str, typer.Option("--format", "-f", help=f"One of {', '.join(EXPORT_FORMATS)}.")],
    as_json: Json = False,
) -> None:
    """Write a version, curation included, in another format."""
    version = GraspDataset.open(dataset)
    attempts = sum(session.attempts for session in version.sessions)
    with progress_bar("export", attempts) as bar:
        export_dataset(version, target, format=format, on_attempt=bar.advance)
    if as_json:
        print_json({"format": format, "target": target, "attempts": attempts, "digest": version.digest})
        return
    console.print(f"exported {attempts} attempts of {dataset} to [bold]{target}[/] ({format})")


def import_command(
    source: Annotated[Path, typer.Argument(help="File or folder to import.")],
    dataset: Annotated[str, typer.Argument(metavar="DATASET", help="Where to; made where there is none.")],
    format: Annotated[str | None, typer.Option("--format", "-f", help=f"Instead of looking: {_IMPORTED}.")] = None,
    branch: Branch = "main",
    allow_mismatch: AllowMismatch = False,
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Add what another format holds to a dataset: all of it or, after any fault, nothing."""
    report = import_dataset(source, dataset, format=format, branch=branch, allow_mismatch=allow_mismatch, dry_run=True)
    if not dry_run:
        with progress_bar("import", report.transfer.attempts) as bar:
            report = import_dataset(
                source,
                dataset,
                format=report.format,
                branch=branch,
                allow_mismatch=allow_mismatch,
                on_attempt=bar.advance,
            )
    if as_json:
        print_json({"format": report.format, "created": report.created, **_as_json(report.transfer)})
        return
    _print_report(report.transfer, f"{source} ({report.format})", dataset, dry_run=dry_run)


def merge_command(
    source: Annotated[str, typer.Argument(metavar="SOURCE[@REF]", help="Dataset to copy from.")],
    dataset: Annotated[str, typer.Argument(metavar="DATASET", help="Dataset to copy to.")],
    session: Annotated[
        list[str] | None, typer.Option("--session", "-s", help="ULID of a session to copy; repeat it. All by default.")
    ] = None,
    branch: Branch = "main",
    allow_mismatch: AllowMismatch = False,
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Copy sessions of one dataset into another; those it has already are left out."""
    version = GraspDataset.open(source)
    target = GraspRepository.open(DatasetAddress.parse(dataset).path)
    plan = merge(version, target, sessions=session, branch=branch, allow_mismatch=allow_mismatch, dry_run=True)
    report = plan
    if not dry_run:
        with progress_bar("merge", plan.attempts) as bar:
            report = merge(
                version,
                target,
                sessions=session,
                branch=branch,
                allow_mismatch=allow_mismatch,
                on_attempt=bar.advance,
            )
    if as_json:
        print_json(_as_json(report))
        return
    _print_report(report, source, dataset, dry_run=dry_run)


def materialize_command(
    dataset: Dataset,
    viewpoint: Annotated[
        str, typer.Option("--viewpoint", help=f"Picture to warp: {' or '.join(VIEWPOINTS)}.")
    ] = "pregrasp",
    size_px: Annotated[int, typer.Option("--size", help="Side of the inputs [px].")] = 64,
    as_json: Json = False,
) -> None:
    """Make the network inputs of a version, and print where they are."""
    # Imported here: PyTorch takes seconds, and the other commands for datasets run where it is not installed.
    from handsight.datasets.inputs.materialize import materialize
    from handsight.servoing.homography import InputGrid

    version = GraspDataset.open(dataset)
    with progress_bar("warp", sum(session.attempts for session in version.sessions)) as bar:
        data = materialize(version, viewpoint=_view(viewpoint), grid=InputGrid(size_px=size_px), on_attempt=bar.advance)
    facts = {"file": data.file, "shape": list(data.inputs.shape), "successes": int(data.labels.sum())}
    if as_json:
        print_json(facts)
        return
    console.print(f"{len(data.inputs)} inputs of {dataset} in [bold]{data.file}[/]")


def _view(name: str) -> Viewpoint:
    for viewpoint in VIEWPOINTS:
        if viewpoint == name:
            return viewpoint
    raise typer.BadParameter(f"viewpoint is {name!r}, expected {' or '.join(VIEWPOINTS)}", param_hint="--viewpoint")


def _as_json(report: TransferReport) -> dict[str, object]:
    return {
        "sessions": list(report.sessions),
        "attempts": report.attempts,
        "duplicates": list(report.duplicates),
        "snapshot": report.snapshot,
    }


def _print_report(report: TransferReport, source: str, target: str, *, dry_run: bool) -> None:
    verb = "would add" if dry_run else "added"
    count = len(report.sessions)
    sessions = f"{count} session{'' if count == 1 else 's'} with {report.attempts} attempts"
    console.print(f"{verb} {sessions} of {source} to [bold]{target}[/]")
    for ulid in report.duplicates:
        console.print(f"left out session {ulid}: its attempts are there already")
