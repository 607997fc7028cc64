"""Copying sessions from one dataset into another, by id."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext

from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.errors import SessionNotFoundError, counted, pasteable
from handsight.datasets.exchange.places import staying_in_place
from handsight.datasets.exchange.sources import stored_sources
from handsight.datasets.exchange.transfer import TransferReport, transfer
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.store.readers import being_read
from handsight.datasets.store.repository import GraspRepository


def merge(
    source: GraspDataset,
    target: GraspRepository,
    *,
    sessions: Sequence[str] | None = None,
    branch: str = DEFAULT_REF,
    allow_mismatch: bool = False,
    dry_run: bool = False,
    on_total: Callable[[int], None] | None = None,
    on_attempt: Callable[[], None] | None = None,
) -> TransferReport:
    """Copy sessions, with what curation decided about their attempts, into another dataset, in one commit.

    Ids stay what they are, so attempts keep their names and merging twice changes nothing.

    Args:
        source: The version to copy from.
        target: The dataset to copy to.
        sessions: ULIDs of the sessions, or unique beginnings of them; None for all.
        branch: The branch of the target that moves.
        allow_mismatch: Take sessions recorded with other instruments than those the target knows.
        dry_run: Check and report, and change nothing.
        on_total: Told how many attempts are to be copied, before the first is.
        on_attempt: Called for every attempt copied.

    Raises:
        SessionNotFoundError: The source has no such session; the message lists all that are missing.
        MergeError: Sessions do not fit the target; the message lists every fault.
        CorruptDataError: An attempt of the source is damaged.
        VersionRemovedError: The source was expired and collected meanwhile.
        StorageError: The target was moved meanwhile.
    """
    root = source.root
    available = {session.ulid: session for session in stored_sources(root)}
    named = available if sessions is None else (_whole(text, available) for text in sessions)
    wanted = list(dict.fromkeys(named))
    missing = [ulid for ulid in wanted if ulid not in available]
    if missing:
        raise SessionNotFoundError(
            f"{source.repository.path}@{source.ref} has no session {', '.join(missing)} "
            f"({counted(len(available), 'session')}): "
            f"see {pasteable('handsight', 'dataset', 'stats', f'{source.repository.path}@{source.ref}')}"
        )
    reading = being_read(source.repository, source.snapshot_id, f"merge into {target.path}")
    with staying_in_place(target.path), nullcontext() if dry_run else reading:
        return transfer(
            target,
            [available[ulid] for ulid in wanted],
            decisions=source.overlay.decisions,
            branch=branch,
            message=f"merge {counted(len(wanted), 'session')} of {source.repository.path}@{source.ref}",
            allow_mismatch=allow_mismatch,
            dry_run=dry_run,
            on_total=on_total,
            on_attempt=on_attempt,
        )


def _whole(text: str, available: Iterable[str]) -> str:
    """The ULID that a text is the beginning of, if it is of one alone; else the text."""
    meant = [ulid for ulid in available if ulid.startswith(text.upper())]
    return meant[0] if len(meant) == 1 and text else text
