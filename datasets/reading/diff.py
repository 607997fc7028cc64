"""What changed between two versions of a dataset, in attempts rather than in chunks."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from handsight.datasets.format.schema import attempt_ids
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.records import Outcome


@dataclass(frozen=True, slots=True, kw_only=True)
class Balance:
    """How many attempts take part in training, and with what label. Excluded ones do not count."""

    attempts: int
    labelled: int
    successes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class VersionDiff:
    """The way from one version to another. All lists hold attempt ids, in the order of the table."""

    before: str
    """Snapshot id of the version left."""
    after: str
    """Snapshot id of the version reached."""
    added: tuple[str, ...]
    removed: tuple[str, ...]
    replaced: tuple[str, ...]
    """In both under the same id with other content: recorded apart from each other on two branches, or repaired."""
    excluded: tuple[str, ...]
    """Excluded after, and not before."""
    restored: tuple[str, ...]
    """Excluded before, and not after."""
    relabelled: tuple[str, ...]
    """With another label after than before; of those added, with another than was recorded."""
    balance_before: Balance
    balance_after: Balance
    objects: dict[str, tuple[Balance, Balance]]
    """The balance before and after by target object, for objects whose balance moved."""

    @property
    def empty(self) -> bool:
        """Whether the two versions hold the same attempts, curated alike."""
        return not any((self.added, self.removed, self.replaced, self.excluded, self.restored, self.relabelled))


def diff_versions(before: GraspDataset, after: GraspDataset) -> VersionDiff:
    """Compare two versions of one dataset, or of two. Reads no pictures.

    Raises:
        CorruptDataError: A column is damaged.
    """
    grown, shrunk = _only_in(after, before), _only_in(before, after)
    replaced = _replaced(before, after)
    # Only what curation has touched can have changed its label or exclusion, or what was recorded anew.
    touched = sorted({*_touched(before), *_touched(after), *replaced})
    old, new = before.rows(touched), after.rows(touched)
    old_excluded = old["excluded"].reindex(new.index, fill_value=False).to_numpy(dtype=bool)
    old_label = old["success"].reindex(new.index).where(new.index.isin(old.index), new["recorded_success"])
    balances = [_by_object(one, rows) for one, rows in ((before, old), (after, new))]
    return VersionDiff(
        before=before.snapshot_id,
        after=after.snapshot_id,
        added=tuple(grown),
        removed=tuple(shrunk),
        replaced=tuple(replaced),
        excluded=tuple(new.index[new["excluded"] & ~old_excluded]),
        restored=tuple(new.index[~new["excluded"] & old_excluded]),
        relabelled=tuple(new.index[(new["success"] != old_label).fillna(False).astype(bool)]),
        balance_before=_total(balances[0]),
        balance_after=_total(balances[1]),
        objects=_moved(*balances),
    )


def _only_in(dataset: GraspDataset, other: GraspDataset) -> Iterator[str]:
    """Ids of attempts that the other version has not; rows of a session are numbered from 0 in both."""
    sizes = {session.ulid: session.attempts for session in other.sessions}
    for session in dataset.sessions:
        yield from attempt_ids(session.ulid, range(sizes.get(session.ulid, 0), session.attempts))


def _replaced(before: GraspDataset, after: GraspDataset) -> list[str]:
    sizes = {session.ulid: session.attempts for session in before.sessions}
    replaced = []
    for session in after.sessions:
        if session.ulid in sizes:
            old, new = before.column(session.ulid, "digest"), after.column(session.ulid, "digest")
            common = min(len(old), len(new))
            changed = np.flatnonzero((old[:common] != new[:common]).any(axis=1))
            replaced += attempt_ids(session.ulid, changed.tolist())
    return replaced


def _touched(dataset: GraspDataset) -> Iterator[str]:
    yield from dataset.overlay.exclusions.index
    yield from dataset.overlay.labels.index


def _by_object(dataset: GraspDataset, curated: pd.DataFrame) -> dict[str | None, NDArray[np.int64]]:
    """Attempts, labelled ones and successes by target object, None where it is unknown. Excluded ones do not count.

    Counted over whole columns as recorded, then corrected by the few rows that curation has touched.
    """
    counts: dict[str | None, NDArray[np.int64]] = defaultdict(lambda: np.zeros(3, np.int64))
    for session in dataset.sessions:
        names: list[str | None] = [*session.header.station.objects, None]
        target, outcome = dataset.targets(session.ulid), dataset.column(session.ulid, "outcome")
        pairs = np.bincount(target * len(Outcome) + outcome, minlength=len(names) * len(Outcome))
        for name, (empty, held, *others) in zip(names, pairs.reshape(-1, len(Outcome)).tolist(), strict=True):
            counts[name] += (empty + held + sum(others), empty + held, held)
    targets = curated["target"].astype(object).where(curated["target"].notna(), None)
    for name, recorded, success, excluded in zip(
        targets, curated["recorded_success"], curated["success"], curated["excluded"], strict=True
    ):
        counts[name] -= _counted(recorded)
        if not excluded:
            counts[name] += _counted(success)
    return dict(counts)


def _counted(label: Any) -> tuple[int, int, int]:
    """One attempt with that label, which may be missing."""
    return (1, 0, 0) if label is pd.NA else (1, 1, int(label))


def _balance(counts: NDArray[np.int64]) -> Balance:
    attempts, labelled, successes = counts.tolist()
    return Balance(attempts=attempts, labelled=labelled, successes=successes)


def _total(counts: dict[str | None, NDArray[np.int64]]) -> Balance:
    return _balance(sum(counts.values(), np.zeros(3, np.int64)))


def _moved(
    old: dict[str | None, NDArray[np.int64]], new: dict[str | None, NDArray[np.int64]]
) -> dict[str, tuple[Balance, Balance]]:
    none = np.zeros(3, np.int64)
    names = sorted({name for name in (*old, *new) if name is not None})
    pairs = {name: (_balance(old.get(name, none)), _balance(new.get(name, none))) for name in names}
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}
