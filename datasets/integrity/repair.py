"""Taking damage out of a dataset, on a branch of its own.

The damaged version stays as it is. On the new branch every corrupt attempt is replaced: by the same attempt
simulated again, where that is possible and its digest is the one recorded, which proves it; else by a record that
says only that it was damaged, without pictures or label, and that is excluded with the reason. The branch can then be
read from end to end, verified and trained on. It gets its name last, so one that is there is repaired.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import zarr

from handsight.datasets.curation.curator import Curator
from handsight.datasets.errors import CorruptDataError, counted
from handsight.datasets.format.arrays import array_at, group_at, read_rows
from handsight.datasets.format.decisions import REASON_BYTES
from handsight.datasets.format.schema import FAILURE_BYTES, SESSIONS, VIEWPOINTS, parse_attempt_id
from handsight.datasets.integrity.verify import VerifyReport
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.reading.selection import Selection
from handsight.datasets.records import PHASES, GraspAttempt, GripperReadings, Outcome, SessionHeader
from handsight.datasets.store.branches import check_new_branch, new_branch
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.writing.batches import PreparedAttempt, chunk_start, column_paths, prepare
from handsight.datasets.writing.change import change_branch


class ResimulateAttempt(Protocol):
    """Performs an attempt of a simulated session again."""

    def __call__(self, header: SessionHeader, number: int) -> GraspAttempt | None:
        """Attempt ``number`` of a session with that header; None where it cannot be performed here."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RepairReport:
    """What a repair did."""

    branch: str
    snapshot: str | None
    """The tip of the branch, after the repair; None where it was only tried."""
    simulated: tuple[str, ...]
    """Attempts brought back by simulation, with the digest that was recorded."""
    lost: tuple[str, ...]
    """Attempts that could not be brought back, and are excluded."""


def repair(
    dataset: GraspDataset,
    report: VerifyReport,
    *,
    branch: str,
    author: str,
    resimulate: ResimulateAttempt | None = None,
    dry_run: bool = False,
) -> RepairReport:
    """Replace the corrupt attempts of a version on a new branch that begins there.

    Args:
        dataset: The damaged version.
        report: What :func:`verify` found in it.
        branch: Name of the branch to make.
        author: Who excludes what is lost.
        resimulate: Performs attempts of simulated sessions again; without it all corrupt attempts are lost.
        dry_run: Find out what could be brought back, and make no branch.

    Raises:
        RefNameError: The branch exists, or its name is malformed.
        CorruptDataError: There is damage beside the attempts, which nothing can bring back.
        RecordError: A simulated attempt does not fit its session.
    """
    if report.damage:
        raise CorruptDataError(
            f"there is damage beside the attempts, which repair cannot undo: {'; '.join(report.damage)}; "
            "restore the dataset from a copy"
        )
    repository = dataset.repository
    if dry_run:
        check_new_branch(repository, branch)
        back = [one for one in report.corrupt if _simulated(dataset, one, resimulate) is not None]
        gone = tuple(one for one in report.corrupt if one not in back)
        return RepairReport(branch=branch, snapshot=None, simulated=tuple(back), lost=gone)
    with new_branch(repository, branch, dataset.snapshot_id, what=f"repair to {branch}") as draft:
        found = {attempt: _simulated(dataset, attempt, resimulate) for attempt in report.corrupt}
        simulated = {attempt: one for attempt, one in found.items() if one is not None}
        lost = {
            attempt: _lost(dataset, attempt, report.faults[attempt]) for attempt in found if attempt not in simulated
        }
        replacements = _by_session({**simulated, **lost})

        def change(_: GraspDataset, root: zarr.Group) -> tuple[str | None, None]:
            for ulid, prepared in replacements.items():
                group = group_at(root, f"{SESSIONS}/{ulid}")
                _replace_columns(group, prepared)
                _replace_pictures(group, prepared)
            count = counted(len(report.corrupt), "damaged attempt")
            return (f"replace {count}" if report.corrupt else None), None

        change_branch(repository, draft, change)
        _exclude(repository, draft, author, {attempt: report.faults[attempt] for attempt in lost})
    tip = repository.resolve(branch)
    return RepairReport(branch=branch, snapshot=tip, simulated=tuple(simulated), lost=tuple(lost))


def _simulated(dataset: GraspDataset, attempt: str, resimulate: ResimulateAttempt | None) -> PreparedAttempt | None:
    """The attempt as it was recorded, from the simulator; None where that cannot be proved."""
    header = dataset.session(attempt).header
    ulid, number = parse_attempt_id(attempt)
    again = resimulate(header, number) if resimulate is not None and header.seed is not None else None
    if again is None:
        return None
    prepared = prepare(again, header, session=ulid, number=number)
    root = dataset.root
    try:
        recorded = read_rows(array_at(root, f"{SESSIONS}/{ulid}/attempts/digest"), number, number + 1)[0]
    except CorruptDataError:
        return None
    return prepared if np.array_equal(prepared.columns["attempts/digest"], recorded) else None


def _lost(dataset: GraspDataset, attempt: str, fault: str) -> PreparedAttempt:
    """A record in place of a damaged one: that it was there, and nothing more."""
    header = dataset.session(attempt).header
    ulid, number = parse_attempt_id(attempt)
    nan = float("nan")
    record = GraspAttempt(
        number=number,
        outcome=Outcome.ABORTED,
        failure=_shortened(f"look: damaged in storage: {fault}", FAILURE_BYTES),
        overhead=None,
        pregrasp=None,
        pregrasp_x_m=nan,
        pregrasp_y_m=nan,
        pregrasp_angle_rad=nan,
        pose_base_tool_grasp=np.full((4, 4), nan),
        contact_force_n=0.0,
        gripper=GripperReadings(before_m=nan, closed_m=nan, lifted_m=nan, final_m=nan),
        scene=None,
        truth_held=None,
        phase_s=np.full(len(PHASES), nan, np.float32),
        started_ns=0,
        elapsed_ns=0,
    )
    return prepare(record, header, session=ulid, number=number)


def _by_session(prepared: Mapping[str, PreparedAttempt]) -> dict[str, dict[int, PreparedAttempt]]:
    sessions: dict[str, dict[int, PreparedAttempt]] = {}
    for attempt, one in prepared.items():
        ulid, number = parse_attempt_id(attempt)
        sessions.setdefault(ulid, {})[number] = one
    return sessions


def _replace_columns(group: zarr.Group, prepared: Mapping[int, PreparedAttempt]) -> None:
    """Write whole chunks; one that cannot be read has nothing but corrupt attempts in it."""
    for path in column_paths():
        array = array_at(group, path)
        chunk_rows = array.chunks[0]
        for start in sorted({chunk_start(number, chunk_rows) for number in prepared}):
            stop = min(start + chunk_rows, array.shape[0])
            try:
                rows = read_rows(array, start, stop).copy()
            except CorruptDataError:
                rows = np.stack([prepared[number].columns[path] for number in range(start, stop)])
            for number in set(range(start, stop)) & prepared.keys():
                rows[number - start] = prepared[number].columns[path]
            array[start:stop] = rows


def _replace_pictures(group: zarr.Group, prepared: Mapping[int, PreparedAttempt]) -> None:
    for viewpoint in VIEWPOINTS:
        for name in ("rgb", "depth"):
            array = array_at(group, f"{viewpoint}/{name}")
            for number, one in prepared.items():
                frame = one.frames[viewpoint]
                array[number] = 0 if frame is None else getattr(frame, name)


def _exclude(repository: GraspRepository, branch: str, author: str, faults: Mapping[str, str]) -> None:
    """One decision for each reason: attempts damaged together share it."""
    curator = Curator(repository, author=author, branch=branch)
    reasons: dict[str, list[str]] = {}
    for attempt, fault in faults.items():
        reasons.setdefault(_shortened(f"damaged in storage: {fault}", REASON_BYTES), []).append(attempt)
    for reason, attempts in reasons.items():
        curator.exclude(Selection(ids=tuple(attempts)), reason)


def _shortened(text: str, size: int) -> str:
    return text.replace("\0", "").encode()[:size].decode(errors="ignore")
