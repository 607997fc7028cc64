"""Sessions on their way into a dataset, from another dataset or from a foreign format: all of them or none.

Whatever the source, its attempts pass the same checks as if a station had just performed them, and their digests are
computed anew and compared with those the source recorded. Everything goes into one commit at the end, so a transfer
that fails half-way shows in no version of the dataset.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import chain, islice
from typing import Any

import zarr

from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.errors import CorruptDataError, MergeError, SessionConflictError, StorageError, counted
from handsight.datasets.exchange.edits import NO_EDITS, Edits, decisions_of
from handsight.datasets.exchange.sources import SessionSource
from handsight.datasets.format.arrays import (
    array_at,
    arrays_with,
    group_at,
    read_all,
    run_concurrently,
    unreadable_chunk,
)
from handsight.datasets.format.decisions import Action, Decision, Overlay, append_decision, read_overlay
from handsight.datasets.format.frames import BATCH_FRAMES, FrameEncoder, frame_paths
from handsight.datasets.format.schema import SESSIONS, attempt_id, create_arrays, packed_rows
from handsight.datasets.format.sessions import read_sessions
from handsight.datasets.records import StationSpec
from handsight.datasets.store.icechunk_engine import icechunk_errors
from handsight.datasets.store.layout import check_current
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.store.transactions import on_the_tip
from handsight.datasets.store.writers import at_work
from handsight.datasets.writing.batches import (
    Columns,
    EncodedAttempt,
    LastChunks,
    column_writes,
    frame_writes,
    new_layouts,
    prepare,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class TransferReport:
    """What a transfer did, or would do."""

    sessions: tuple[str, ...]
    """Sessions added."""
    attempts: int
    """Attempts added."""
    duplicates: tuple[str, ...]
    """Sessions left out because the dataset has all their attempts already."""
    edits: tuple[Decision, ...]
    """What the source's user had changed in it, as the decisions it became."""
    snapshot: str | None
    """The new version; None where nothing was added, or for a dry run."""


def transfer(
    repository: GraspRepository,
    sources: Sequence[SessionSource],
    *,
    decisions: Sequence[Decision] = (),
    edits: Edits = NO_EDITS,
    author: str = "",
    branch: str = DEFAULT_REF,
    message: str,
    allow_mismatch: bool = False,
    dry_run: bool = False,
    on_total: Callable[[int], None] | None = None,
    on_attempt: Callable[[], None] | None = None,
) -> TransferReport:
    """Add sessions to a branch, and what curation decided about them, in one commit.

    Args:
        repository: Where they go.
        sources: The sessions; those whose attempts are all there already are left out and reported.
        decisions: Curation of the source, oldest first; what concerns sessions that are added comes along.
        edits: What the source's user has changed in it, of sessions that are there already, too.
        author: Of the decisions that edits become.
        branch: The branch that moves.
        message: Of the commit.
        allow_mismatch: Take sessions recorded with other instruments than those the dataset knows.
        dry_run: Check and report, and change nothing. Attempts are read only when they are written.
        on_total: Told how many attempts are to be written, before the first is.
        on_attempt: Called for every attempt written.

    Raises:
        MergeError: A session contradicts what is there or was recorded with other instruments; lists every fault.
        RecordError: An attempt cannot be recorded.
        CorruptDataError: An attempt is damaged, or is not what its digest says.
        RefNotFoundError: There is no such branch.
        SchemaError: The branch has an older schema.
        SessionConflictError: Another process has added one of the sessions meanwhile.
    """
    root = zarr.open_group(repository.writable(branch).store, mode="r")
    check_current(repository.path, branch, root)
    present = _digests_by_session(root)
    new = [source for source in sources if not _is_duplicate(source, present)]
    faults = _contradictions(new, present)
    if not allow_mismatch:
        faults += _mismatches(new, [session.header.station for session in read_sessions(root)])
    if faults:
        raise MergeError(f"nothing was added to {repository.path}: {'; '.join(faults)}")
    attempts = sum(source.size for source in new)
    if on_total is not None:
        on_total(attempts)
    come = frozenset(source.ulid for source in new)
    others = _ids_there([source for source in sources if source.ulid not in come], present)
    decide = partial(_decisions, decisions, edits, come, author=author, others=others)
    edited = decide(read_overlay(root))[1]
    snapshot = None
    if (new or edited) and not dry_run:
        snapshot = _write(repository, new, decide, branch=branch, message=message, on_attempt=on_attempt)
        if edited:
            # Numbered as committed, which may be after what others have decided meanwhile.
            edited = read_overlay(repository.root(snapshot)).decisions[-len(edited) :]
    return TransferReport(
        sessions=tuple(source.ulid for source in new),
        attempts=attempts,
        duplicates=tuple(source.ulid for source in sources if source.ulid not in come),
        edits=edited,
        snapshot=snapshot,
    )


def _digests_by_session(root: zarr.Group) -> dict[str, list[bytes]]:
    sessions = group_at(root, SESSIONS)
    return {
        ulid: [row.tobytes() for row in read_all(array_at(sessions, f"{ulid}/attempts/digest"))]
        for ulid in sorted(sessions.group_keys())
    }


def _ids_there(duplicates: Sequence[SessionSource], present: dict[str, list[bytes]]) -> dict[str, str]:
    """What attempts that are there under another id are called there."""
    elsewhere = [source for source in duplicates if source.ulid not in present]
    if not elsewhere:
        return {}
    names = {digest: attempt_id(ulid, at) for ulid, digests in present.items() for at, digest in enumerate(digests)}
    return {
        attempt_id(source.ulid, number): names[digest]
        for source in elsewhere
        for number, digest in enumerate(source.digests)
    }


def _decisions(
    decisions: Sequence[Decision],
    edits: Edits,
    sessions: frozenset[str],
    overlay: Overlay,
    *,
    author: str,
    others: dict[str, str],
) -> tuple[tuple[Decision, ...], tuple[Decision, ...]]:
    """What is to be added to the curation of a version: decisions of the source, then what its user's edits become."""
    come = tuple(transplanted(decisions, sessions, first=len(overlay.decisions)))
    curated = Overlay((*overlay.decisions, *come))
    return come, tuple(decisions_of(edits, curated, author=author, ids_there=others))


def _is_duplicate(source: SessionSource, present: dict[str, list[bytes]]) -> bool:
    """Whether every attempt of the source is there already, in the session of its name or in others."""
    if source.ulid in present:
        return bool(source.digests) and present[source.ulid][: source.size] == list(source.digests)
    return bool(source.digests) and set(source.digests) <= {digest for one in present.values() for digest in one}


def _contradictions(sources: Sequence[SessionSource], present: dict[str, list[bytes]]) -> list[str]:
    """What cannot stand beside what is there: other content under a known name, known content under another name."""
    faults = []
    known = {digest: ulid for ulid, digests in present.items() for digest in digests}
    seen: set[str] = set()
    for source in sources:
        if source.ulid in seen:
            faults.append(f"session {source.ulid} comes twice")
        seen.add(source.ulid)
        if source.ulid in present:
            count = counted(len(present[source.ulid]), "attempt")
            faults.append(f"session {source.ulid} is there with {count} and other content than the source's")
            continue
        shared = [digest for digest in source.digests if digest in known]
        if shared:
            faults.append(
                f"session {source.ulid} shares {len(shared)} of its {counted(source.size, 'attempt')} with session "
                f"{known[shared[0]]}, which is there: sessions are taken whole or not at all"
            )
    return faults


def _mismatches(sources: Sequence[SessionSource], known: Sequence[StationSpec]) -> list[str]:
    """Instruments of sources that agree with no session that is there."""
    known_instruments = [instruments(station) for station in known]
    faults = []
    for source in sources:
        own = instruments(source.header.station)
        if known_instruments and own not in known_instruments:
            reference = known_instruments[-1]
            faults += [
                f"session {source.ulid} has {name} {own[name]}, the dataset {reference[name]}"
                for name in own
                if own[name] != reference[name]
            ]
    if faults:
        faults.append("allow mismatches if attempts of both are to be learnt from together")
    return faults


def instruments(station: StationSpec) -> dict[str, Any]:
    """What must agree for attempts to be comparable: camera, mount, depth scale, gripper, pre-grasp height."""
    own = {**asdict(station.camera.intrinsics), **asdict(station.camera)}
    del own["intrinsics"]
    fields = ("depth_scale_m", "gripper_stroke_m", "closed_width_m", "pregrasp_height_m")
    return {**own, **{name: getattr(station, name) for name in fields}}


def _write(
    repository: GraspRepository,
    sources: Sequence[SessionSource],
    decide: Callable[[Overlay], tuple[tuple[Decision, ...], tuple[Decision, ...]]],
    *,
    branch: str,
    message: str,
    on_attempt: Callable[[], None] | None,
) -> str:
    names = frozenset(source.ulid for source in sources)
    progress = [on_attempt]

    def work(transaction: Any) -> str:
        tell = progress.pop() if progress else None  # Once, also where it has to be done again.
        with icechunk_errors(f"cannot write to {repository.path}"):
            root = zarr.open_group(transaction.store, mode="r+")
            sessions = group_at(root, SESSIONS)
            for source in sources:
                group = sessions.create_group(source.ulid, attributes=source.attributes)
                _write_session(group, source, tell)
            for decision in chain.from_iterable(decide(read_overlay(root))):
                append_decision(root, decision)

        def check(tip: zarr.Group) -> None:
            _refuse_present(names, tip)
            _refuse_deleted(root, names)

        return repository.commit(
            transaction,
            branch=branch,
            message=message,
            metadata={"attempts_added": sum(source.size for source in sources), "sessions": sorted(names)},
            check=check,
        )

    with at_work(repository, message):
        return on_the_tip(repository, branch, work)


def _write_session(group: zarr.Group, source: SessionSource, on_attempt: Callable[[], None] | None) -> None:
    column_rows = packed_rows(source.attributes["status"], source.size)
    create_arrays(group, source.header, column_rows=column_rows)
    layouts = new_layouts(source.header, column_rows=column_rows)
    arrays = arrays_with(layouts, group.store, group.path)
    attempts = _encoded(source, FrameEncoder(layouts)) if source.encoded is None else source.encoded()
    rows: list[Columns] = []
    stored = 0
    last_chunks: LastChunks = {}
    while batch := list(islice(attempts, BATCH_FRAMES)):
        run_concurrently(frame_writes(arrays, [one.frames for one in batch], stored=stored + len(rows)))
        rows += [one.columns for one in batch]
        # Columns in whole chunks: a chunk that is written twice leaves its first version behind as garbage.
        if len(rows) == column_rows or len(batch) < BATCH_FRAMES:
            writes, last_chunks = column_writes(arrays, rows, stored=stored, last_chunks=last_chunks)
            run_concurrently(writes)
            stored += len(rows)
            rows = []
        if on_attempt is not None:
            for _ in batch:
                on_attempt()
    if rows:
        writes, _ = column_writes(arrays, rows, stored=stored, last_chunks=last_chunks)
        run_concurrently(writes)
        stored += len(rows)
    if stored != source.size:
        raise CorruptDataError(f"session {source.ulid} ends after {counted(stored, 'attempt')}, expected {source.size}")


def _encoded(source: SessionSource, encoder: FrameEncoder) -> Iterator[EncodedAttempt]:
    for number, attempt in enumerate(islice(source.attempts(), source.size)):
        prepared = prepare(attempt, source.header, session=source.ulid, number=number)
        if source.digests and prepared.columns["attempts/digest"].tobytes() != source.digests[number]:
            raise CorruptDataError(
                f"attempt {attempt_id(source.ulid, number)} is not what its recorded digest says: the source was "
                "changed or damaged; take an undamaged copy"
            )
        yield EncodedAttempt(columns=prepared.columns, frames=encoder.encode(prepared.frames))


def transplanted(decisions: Sequence[Decision], sessions: frozenset[str], *, first: int) -> list[Decision]:
    """Decisions about attempts of some sessions, numbered from ``first`` on; undoings follow what they undo."""
    numbers: dict[int | None, int] = {}
    kept: list[Decision] = []
    for decision in decisions:
        attempts = tuple(one for one in decision.attempts if one.partition("-")[0] in sessions)
        undoes_kept = decision.action is Action.UNDO and decision.value in numbers
        if attempts or undoes_kept:
            numbers[decision.number] = first + len(kept)
            value = numbers[decision.value] if undoes_kept else decision.value
            kept.append(replace(decision, number=first + len(kept), value=value, attempts=attempts))
    return kept


def _refuse_present(sessions: frozenset[str], root: zarr.Group) -> None:
    present = sorted(sessions & set(group_at(root, SESSIONS).group_keys()))
    if present:
        raise SessionConflictError(f"another process has added session {', '.join(present)} meanwhile: nothing changed")


def _refuse_deleted(root: zarr.Group, sessions: frozenset[str]) -> None:
    """Refuse to commit what somebody has deleted who knew nothing of this transfer.

    Whoever deletes goes by age, so the first that was written of each session goes before the rest of it.

    Raises:
        StorageError: Stored bytes are gone.
    """
    for ulid in sorted(sessions):
        group = group_at(root, f"{SESSIONS}/{ulid}")
        for path in ("attempts/digest", *frame_paths()):
            fault = unreadable_chunk(array_at(group, path), BATCH_FRAMES)
            if fault:
                raise StorageError(
                    f"{fault}: it was deleted before it could be committed, by a collection of garbage that knew "
                    "nothing of this transfer (by an older handsight, perhaps); nothing changed: try again"
                )
