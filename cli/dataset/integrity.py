"""``handsight dataset stats|doctor|verify|repair|gc|expire``: is it sound, and what does it hold."""

from __future__ import annotations

import getpass
import os
import re
from collections.abc import Iterator
from contextlib import closing, contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Annotated

import typer

from handsight.cli.options import Dataset, DatasetPath, Json, Seed
from handsight.cli.output import console, print_json, print_table, progress_bar
from handsight.datasets.errors import counted
from handsight.datasets.format.schema import VIEWPOINTS
from handsight.datasets.integrity.doctor.examine import doctor
from handsight.datasets.integrity.maintenance import collect_garbage, expire
from handsight.datasets.integrity.repair import ResimulateAttempt, repair
from handsight.datasets.integrity.verify import VerifyReport, verify
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.reading.stats import LabelStats, Share, label_stats
from handsight.datasets.store.repository import GraspRepository

ServoModel = Annotated[
    Path | None,
    typer.Option("--model", metavar="RUN", help="Run that chose the grasps of sessions with the servo policy."),
]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Say what would be done, and do nothing.")]
_AGE = re.compile(r"(\d+)([smhdw])")
_UNITS = {"s": "seconds", "m": "minutes", "h": "hours", "d": "days", "w": "weeks"}


def register(app: typer.Typer) -> None:
    """Add the commands to ``handsight dataset``."""
    app.command("stats")(stats)
    app.command("doctor")(doctor_command)
    app.command("verify")(verify_command)
    app.command("repair")(repair_command)
    app.command("gc")(gc)
    app.command("expire")(expire_command)


def stats(
    dataset: Dataset,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE", help="Draw it, with place and time too, as .png or .svg."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Show how labels are spread over objects, sessions, angles, openings and forces."""
    if plot is not None:
        _check_plot(plot)
    opened = GraspDataset.open(dataset)
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


# The next two import what draws when it is wanted: Matplotlib and PyTorch take seconds.
def _check_plot(path: Path) -> None:
    from handsight.viz.figures.dataset import SUFFIXES
    from handsight.viz.figures.style import check_figure_path

    check_figure_path(path, *SUFFIXES)


def _draw_stats(found: LabelStats, path: Path, title: str) -> None:
    from handsight.viz.figures.dataset import stats_figure

    stats_figure(found, path, title=title)


def doctor_command(
    dataset: Dataset,
    deep: Annotated[bool, typer.Option("--deep", help="Look at every picture too.")] = False,
    resimulate: Annotated[
        int, typer.Option("--resimulate", metavar="K", min=0, help="Simulate K attempts again and compare every bit.")
    ] = 0,
    model: ServoModel = None,
    seed: Seed = 0,
    as_json: Json = False,
) -> None:
    """Check whether a version can be learned from; exit 1 when there are errors or warnings."""
    opened = GraspDataset.open(dataset)
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
        rows = [(one.code, one.severity, one.message, ", ".join(one.attempts[:3])) for one in found.findings]
        if rows:
            print_table(("code", "severity", "finding", "attempts"), rows)
        console.print(
            "no errors or warnings" if found.ok else "fix the findings above, or exclude what is bad, and run again"
        )
    if not found.ok:
        raise typer.Exit(1)


def verify_command(
    dataset: Dataset,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=0, help="Processes; 0 takes one for each core.")] = 0,
    as_json: Json = False,
) -> None:
    """Read every stored byte and compare it with what was recorded; exit 1 when something is damaged."""
    report = _verified(GraspDataset.open(dataset), jobs)
    if as_json:
        print_json(
            {
                "checked": report.checked,
                "corrupt": report.corrupt,
                "faults": report.faults,
                "damage": report.damage,
                "bytes": report.bytes,
            }
        )
    else:
        _print_verified(report)
    if not report.ok:
        raise typer.Exit(1)


def repair_command(
    dataset: Dataset,
    branch: Annotated[
        str, typer.Option("--branch", help="Name of the branch to make; the version itself stays as it is.")
    ],
    resimulate: Annotated[
        bool, typer.Option("--resimulate", help="Bring damaged attempts back by simulating them again.")
    ] = False,
    model: ServoModel = None,
    author: Annotated[str, typer.Option("--author", envvar="HANDSIGHT_AUTHOR", help="Who repairs.")] = "",
    as_json: Json = False,
) -> None:
    """Replace damaged attempts on a new branch: simulated again, or else set aside."""
    opened = GraspDataset.open(dataset)
    report = _verified(opened, 0)
    if report.ok:
        console.print(f"nothing is damaged in {counted(report.checked, 'attempt')}: no branch was made")
        return
    with _simulator(model, wanted=resimulate) as simulate:
        done = repair(opened, report, branch=branch, author=author or getpass.getuser(), resimulate=simulate)
    if as_json:
        print_json(done)
        return
    console.print(
        f"branch [bold]{done.branch}[/] ({done.snapshot}): {counted(len(done.simulated), 'attempt')} brought back by "
        "simulation, "
        f"{len(done.lost)} lost and excluded"
    )


def gc(
    dataset: DatasetPath,
    older_than: Annotated[
        str, typer.Option("--older-than", metavar="AGE|DATE", help="Keep younger files: 2h, 7d, 2026-01-31.")
    ] = "1h",
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Delete files that no version needs: of killed writers, deleted branches and expired commits."""
    report = collect_garbage(GraspRepository.open(dataset), _moment(older_than), dry_run=dry_run)
    if as_json:
        print_json(report)
        return
    would = "would have deleted" if dry_run else "deleted"
    console.print(
        f"{would} {report.bytes / 1e6:.1f} MB: {counted(report.chunks, 'chunk')}, "
        f"{counted(report.snapshots, 'snapshot')}, {counted(report.other_files, 'other file')} "
        f"from before {report.older_than:%Y-%m-%d %H:%M:%S} UTC"
    )
    for session in report.retained_by:
        console.print(f"session {session} is open and may be writing: nothing younger than its last commit is touched")


def expire_command(
    dataset: DatasetPath,
    older_than: Annotated[
        str, typer.Option("--older-than", metavar="AGE|DATE", help="Drop older commits: 2h, 7d, 2026-01-31.")
    ],
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Drop old commits from the history; branches and releases keep their content. 'gc' then frees the space."""
    report = expire(GraspRepository.open(dataset), _moment(older_than), dry_run=dry_run)
    if as_json:
        print_json(report)
        return
    would = "would have dropped" if dry_run else "dropped"
    console.print(
        f"{would} {counted(len(report.snapshots), 'commit')} from before {report.older_than:%Y-%m-%d %H:%M:%S} UTC"
    )


def _verified(dataset: GraspDataset, jobs: int) -> VerifyReport:
    with progress_bar("verify", sum(session.attempts for session in dataset.sessions)) as bar:
        return verify(dataset, jobs=jobs or os.cpu_count() or 1, on_checked=bar.reached)


def _print_verified(report: VerifyReport) -> None:
    for attempt, fault in report.faults.items():
        console.print(f"[bold]{attempt}[/] {fault}")
    for damage in report.damage:
        console.print(damage)
    verdict = "as recorded" if report.ok else f"{len(report.corrupt)} of them corrupt"
    console.print(f"{counted(report.checked, 'attempt')}, {report.bytes / 1e6:.1f} MB read: {verdict}")


def _share_row(share: Share) -> tuple[str, str, str]:
    return share.name, str(share.attempts), f"{share.rate:.1%}" if share.attempts else "-"


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
    """An age such as ``7d``, or a date, as a time (UTC)."""
    age = _AGE.fullmatch(text)
    if age:
        return datetime.now(UTC) - timedelta(**{_UNITS[age[2]]: int(age[1])})
    try:
        return datetime.fromisoformat(text).replace(tzinfo=UTC)
    except ValueError as error:
        raise typer.BadParameter(
            f"{text!r} is no age or date, expected such as 2h, 7d or 2026-01-31", param_hint="--older-than"
        ) from error
