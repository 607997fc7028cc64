"""``handsight dataset doctor|verify|repair|gc|expire``: is a version sound, and what on disk is still needed."""

from __future__ import annotations

import dataclasses
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from handsight.cli.dataset.author import author_named
from handsight.cli.errors import CommandError
from handsight.cli.opening import checked_address, open_repository, open_version
from handsight.cli.options import (
    MOST_ATTEMPTS,
    MOST_WORKERS,
    Author,
    Dataset,
    DatasetPath,
    DryRun,
    Json,
    NewBranch,
    Seed,
)
from handsight.cli.output import bold, console, print_json, progress_bar
from handsight.cli.tables import Column, print_table
from handsight.datasets.address import DEFAULT_REF, S3Prefix
from handsight.datasets.errors import counted

if TYPE_CHECKING:
    # These take a second to import; a command does so once its dataset is known to be there.
    from handsight.datasets.integrity.doctor.findings import Finding
    from handsight.datasets.integrity.repair import ResimulateAttempt
    from handsight.datasets.integrity.verify import VerifyReport
    from handsight.datasets.integrity.verify_all import AllReport
    from handsight.datasets.reading.reader import GraspDataset
    from handsight.datasets.store.repository import GraspRepository
    from handsight.datasets.store.restoring import RestoredRef
    from handsight.datasets.store.writers import Writer

ServoModel = Annotated[
    Path | None,
    typer.Option("--model", metavar="RUN", help="Run that chose the grasps of sessions with the servo policy."),
]
IgnoreWriter = Annotated[
    list[str] | None,
    typer.Option("--ignore-writer", metavar="ID", help="A writer to a bucket that is gone; may be given again."),
]
_EXAMPLES = 3
"""Attempts that are shown for each finding; --json has them all."""
_NOTHING_REPAIRED: dict[str, object] = {"branch": None, "snapshot": None, "simulated": [], "lost": []}
_AGE = re.compile(r"([0-9]+)([smhdw])")
_EARLIEST = datetime(1970, 1, 1, tzinfo=UTC)
_UNITS = {"s": "seconds", "m": "minutes", "h": "hours", "d": "days", "w": "weeks"}


def doctor_command(
    dataset: Dataset,
    deep: Annotated[bool, typer.Option("--deep", help="Look at every picture too.")] = False,
    resimulate: Annotated[
        int,
        typer.Option(
            "--resimulate",
            metavar="K",
            min=0,
            max=MOST_ATTEMPTS,
            help="Simulate K attempts again and compare every bit.",
        ),
    ] = 0,
    model: ServoModel = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Check a version for what spoils training; exit 1 when there are errors or warnings."""
    opened = open_version(dataset)
    from handsight.datasets.format.schema import VIEWPOINTS  # a second; see above
    from handsight.datasets.integrity.doctor.examine import doctor

    total = sum(int(opened.attempts[f"{viewpoint}_taken"].sum()) for viewpoint in VIEWPOINTS) if deep else 0
    with progress_bar("examine", total) as bar, _simulator(model, wanted=resimulate > 0) as simulate:
        found = doctor(
            opened,
            deep=deep,
            resimulate=simulate,
            resimulated=resimulate,
            seed=seed,
            on_picture=bar.advance,
        )
    if as_json:
        print_json({"ok": found.ok, "findings": found.findings})
    else:
        _print_findings(opened, found.findings)
        console.print(
            "no errors or warnings" if found.ok else "fix the findings above or exclude attempts, and run again"
        )
    if not found.ok:
        raise typer.Exit(1)


def _print_findings(dataset: GraspDataset, findings: Sequence[Finding]) -> None:
    from handsight.datasets.reading.attempt_ids import short_id  # a second; see above

    shortened = short_id(dataset)
    rows = [
        (one.code, one.severity, ", ".join(map(shortened, one.attempts[:_EXAMPLES])), one.message) for one in findings
    ]
    columns = (
        "code",
        Column(heading="severity", rank=1),
        Column(heading="attempts", rank=2, prose="wrap"),
        Column(heading="finding", prose="wrap", short=shortened),
    )
    if rows:
        print_table(columns, rows)


def verify_command(
    dataset: Dataset,
    jobs: Annotated[
        int, typer.Option("--jobs", "-j", min=0, max=MOST_WORKERS, help="Processes; 0 takes one for each core.")
    ] = 0,
    everything: Annotated[
        bool,
        typer.Option("--all", help="Every branch, release, ancestor, transaction log and the ledger."),
    ] = False,
    as_json: Json = False,
) -> None:
    """Read every stored byte and compare it with what was recorded; exit 1 when something is damaged."""
    if everything:
        _verify_all(dataset, jobs, as_json=as_json)
        return
    report = _verified(open_version(dataset), jobs)
    if as_json:
        print_json(
            {
                "checked": report.checked,
                "corrupt": report.corrupt,
                "faults": report.faults,
                "damage": report.damage,
                "lost_refs": report.lost_refs,
                "bytes": report.bytes,
            }
        )
    else:
        _print_verified(report)
    if not report.ok:
        raise typer.Exit(1)


def repair_command(
    dataset: Dataset,
    branch: NewBranch,
    resimulate: Annotated[
        bool, typer.Option("--resimulate", help="Bring damaged attempts back by simulating them again.")
    ] = False,
    model: ServoModel = None,
    author: Author = "",
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Give lost releases and branches back, and replace damaged attempts on a new branch: simulated, or set aside."""
    restored = _restored_refs(dataset, dry_run=dry_run, quiet=as_json)
    if dry_run and any(one.name == DEFAULT_REF for one in restored):
        # Nothing can be opened before it is back.
        if as_json:
            print_json(_NOTHING_REPAIRED | _refs_as_json(restored, ()))
        return
    opened = open_version(dataset)
    from handsight.datasets.integrity.repair import repair  # a second; see above

    report = _verified(opened, 0)
    refs = _refs_as_json(restored, report.lost_refs)
    if not report.faults and not report.damage:
        if as_json:
            print_json(_NOTHING_REPAIRED | refs)
            return
        _print_lost_refs(report)
        console.print(f"nothing is damaged in {counted(report.checked, 'attempt')}: no branch was made")
        return
    with _simulator(model, wanted=resimulate) as simulate:
        done = repair(opened, report, branch=branch, author=author_named(author), resimulate=simulate, dry_run=dry_run)
    if as_json:
        print_json({**dataclasses.asdict(done), **refs})
        return
    simulated = counted(len(done.simulated), "attempt")
    console.print(
        "would make branch " if dry_run else "branch ",
        bold(done.branch),
        "" if dry_run else f" ({done.snapshot})",
        f": {simulated} brought back by simulation, {len(done.lost)} lost and excluded",
    )


def _restored_refs(dataset: str, *, dry_run: bool, quiet: bool) -> tuple[RestoredRef, ...]:
    """What lost releases and branches of a dataset are given, or would be; said, unless it is to be quiet."""
    address = checked_address(dataset)
    from handsight.datasets.store.repository import GraspRepository  # a second; see above
    from handsight.datasets.store.restoring import restore_main, restore_refs

    restored = restore_main(address.path, dry_run=dry_run) if isinstance(address.path, Path) else ()
    if not (restored and dry_run):
        restored += restore_refs(GraspRepository.open(address.path), dry_run=dry_run)
    for one in restored if not quiet else ():
        name = "the list of releases" if one.kind == "ledger" else f"{one.kind} {one.name}"
        done = "would lead to" if dry_run else "leads again to"
        console.print(f"{name} {done} {one.snapshot_id}: {one.source}")
    return restored


def _refs_as_json(restored: Sequence[RestoredRef], lost: Sequence[str]) -> dict[str, object]:
    return {"restored": [one.name for one in restored], "restored_refs": restored, "lost_refs": lost}


def gc(
    dataset: DatasetPath,
    older_than: Annotated[
        str, typer.Option("--older-than", metavar="AGE|DATE", help="Keep younger files: 2h, 7d, 2026-01-31.")
    ] = "1h",
    ignore_writer: IgnoreWriter = None,
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Delete files that no version needs: of killed writers, deleted branches and expired commits."""
    before = _moment(older_than)
    repository, _ = open_repository(dataset)
    from handsight.datasets.integrity.maintenance import collect_garbage  # a second; see above

    report = collect_garbage(repository, before, dry_run=dry_run, ignored_writers=ignore_writer or ())
    if as_json:
        print_json(report)
        return
    would = "would have deleted" if dry_run else "deleted"
    console.print(
        f"{would} {report.bytes / 1e6:.1f} MB: {counted(report.chunks, 'chunk')}, "
        f"{counted(report.snapshots, 'snapshot')}, {counted(report.other_files, 'other file')} "
        f"from before {report.older_than:%Y-%m-%d %H:%M:%S} UTC"
    )
    _print_retained(repository, report.writers, report.retained_by, "what it may still need")


def expire_command(
    dataset: DatasetPath,
    older_than: Annotated[
        str, typer.Option("--older-than", metavar="AGE|DATE", help="Drop older commits: 2h, 7d, 2026-01-31.")
    ],
    ignore_writer: IgnoreWriter = None,
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Drop old commits from the history; branches and releases keep their content. 'gc' then frees the space."""
    before = _moment(older_than)
    repository, _ = open_repository(dataset)
    from handsight.datasets.integrity.maintenance import expire  # a second; see above

    report = expire(repository, before, dry_run=dry_run, ignored_writers=ignore_writer or ())
    if as_json:
        print_json(report)
        return
    would = "would have dropped" if dry_run else "dropped"
    console.print(
        f"{would} {counted(len(report.snapshots), 'commit')} from before {report.older_than:%Y-%m-%d %H:%M:%S} UTC"
    )
    _print_retained(repository, report.writers, report.retained_by, "the version that it began from")


def _print_retained(
    repository: GraspRepository, writers: Sequence[Writer], retained_by: Sequence[str], what: str
) -> None:
    for writer in writers:
        if (writer.session or writer.id) in retained_by:
            # In a bucket nobody can tell whether a writer on another machine lives.
            gone = f"; if it is gone, add --ignore-writer {writer.id}" if isinstance(repository.path, S3Prefix) else ""
            console.print(
                f"at work since {writer.begun:%Y-%m-%d %H:%M:%S} UTC, process {writer.pid} on {writer.host}: "
                f"{writer.what} ({writer.id}); {what} is kept{gone}"
            )


def _verified(dataset: GraspDataset, jobs: int) -> VerifyReport:
    from handsight.datasets.integrity.verify import verify  # a second; see above

    with progress_bar("verify", sum(session.attempts for session in dataset.sessions)) as bar:
        return verify(dataset, jobs=jobs or os.cpu_count() or 1, on_checked=bar.reached)


def _verify_all(dataset: str, jobs: int, *, as_json: bool) -> None:
    address = checked_address(dataset)
    if "@" in dataset.rstrip("/").rpartition("/")[2]:
        raise CommandError(f"--all reads every version, and {dataset} names one: leave out @{address.ref}, or --all")
    from handsight.datasets.integrity.verify_all import verify_all  # a second; see above

    with progress_bar("history", 0) as history, progress_bar("verify", 0) as bar:
        report = verify_all(
            address.path,
            jobs=jobs or os.cpu_count() or 1,
            on_snapshot=lambda count: history.of(count, count),
            on_checked=bar.of,
        )
    if as_json:
        print_json({**dataclasses.asdict(report), "corrupt": report.corrupt, "damage": report.damage})
    else:
        _print_all_verified(report)
    if not report.ok:
        raise typer.Exit(1)


def _print_all_verified(report: AllReport) -> None:
    for attempt, fault in report.faults.items():
        console.print(bold(attempt), f" (in {', '.join(report.damaged_in.get(attempt, ()))}) {fault}")
    for line in (*report.damage, *map(str, report.files), *report.lost_refs, *report.unread):
        console.print(line)
    found = len(report.damage) + len(report.files) + len(report.lost_refs)
    verdict = "as recorded" if report.ok else f"{len(report.corrupt)} corrupt, {counted(found, 'fault')} beside them"
    console.print(
        f"{counted(len(report.versions), 'version')}, {counted(report.snapshots, 'snapshot')}, "
        f"{counted(report.checked, 'attempt')}, {report.bytes / 1e6:.1f} MB read: {verdict}"
    )


def _print_verified(report: VerifyReport) -> None:
    for attempt, fault in report.faults.items():
        console.print(bold(attempt), f" {fault}")
    for damage in report.damage:
        console.print(damage)
    _print_lost_refs(report)
    verdict = "as recorded" if not report.faults and not report.damage else f"{len(report.corrupt)} of them corrupt"
    console.print(f"{counted(report.checked, 'attempt')}, {report.bytes / 1e6:.1f} MB read: {verdict}")


def _print_lost_refs(report: VerifyReport) -> None:
    for fault in report.lost_refs:
        console.print(fault)


@contextmanager
def _simulator(model: Path | None, *, wanted: bool) -> Iterator[ResimulateAttempt | None]:
    """What simulates attempts again, if that is wanted."""
    if not wanted:
        yield None
        return
    # Imported here: PyBullet takes a while, and only two commands may need it.
    from handsight.cli.wiring.resimulate import Resimulator

    with closing(Resimulator(model)) as resimulate:
        yield resimulate


def _moment(text: str) -> datetime:
    """An age such as ``7d``, or a date, as a time in UTC; a date without a zone is taken as one of UTC.

    Raises:
        CommandError: It is neither, or lies before all datasets or in the future.
    """
    age, now = _AGE.fullmatch(text), datetime.now(UTC)
    try:
        if age:
            moment = now - timedelta(**{_UNITS[age[2]]: int(age[1])})
        else:
            written = datetime.fromisoformat(text)
            moment = written.replace(tzinfo=UTC) if written.tzinfo is None else written.astimezone(UTC)
    except OverflowError as error:
        raise _no_moment(text, "lies before the year 1") from error
    except ValueError as error:
        raise _no_moment(text, "is no age or date") from error
    if moment < _EARLIEST:
        raise _no_moment(text, f"lies before {_EARLIEST:%Y}, when no dataset was there")
    if moment > now:
        raise _no_moment(text, "lies in the future, so that everything would be older")
    return moment


def _no_moment(text: str, fault: str) -> CommandError:
    shown = text if len(text) <= 60 else f"{text[:57]}..."
    return CommandError(f"--older-than is {shown!r}, which {fault}: expected such as 2h, 7d or 2026-01-31")
