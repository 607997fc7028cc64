"""Curation as it is stored: a list of decisions that only grows, laid over the attempts as they were recorded.

::

    /curation/decisions/facts       i8 (D, 4): action, value, time [ns since the epoch], end of its targets
    /curation/decisions/reason      u1 (D, 512), UTF-8 padded with zeros
    /curation/decisions/author      u1 (D, 128), the same
    /curation/targets/attempt       u1 (T, 24): ULID of the session, number in the session (big-endian)

The targets of a decision begin where those of the decision before it end. Nothing recorded is ever touched: an
attempt is excluded if the last decision about its exclusion says so, and has the label that the last decision about
its label gave it. A decision that was undone counts as if it had never been taken.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import IntEnum
from functools import cached_property

import numpy as np
import pandas as pd
import zarr
from numpy.typing import NDArray

from handsight.datasets.errors import CorruptDataError
from handsight.datasets.format.arrays import append_rows, array_at, group_at, read_all
from handsight.datasets.format.keys import KEY_BYTES, ids_from_keys, keys_from_ids
from handsight.datasets.format.rows import text_from_bytes, text_to_bytes
from handsight.datasets.format.schema import create_array

CURATION = "curation"
"""Group that holds the decisions; absent until the first."""

REASON_BYTES = 512
AUTHOR_BYTES = 128
"""Longest reason and author, in bytes of UTF-8."""

CURATED_COLUMNS = ("recorded_success", "excluded", "exclusion_reason")
"""What :meth:`Overlay.applied_to` adds to the attempts table."""

_DIGEST_PREFIX = b"handsight curation 1\n"
_NO_VALUE = -1
_REMEDY = "open a version from before it, which the dataset's log lists, or restore the dataset from a copy"
_TARGET_CHUNK_ROWS = 4096
_FACTS, _REASON, _AUTHOR = "decisions/facts", "decisions/reason", "decisions/author"
_TARGETS = "targets/attempt"
DECISION_ARRAYS = (_FACTS, _REASON, _AUTHOR, _TARGETS)
"""Paths in the group of the arrays that hold them."""


class Action(IntEnum):
    """What a decision does to the attempts it names."""

    EXCLUDE = 0
    """They take no part in training and balance."""
    RESTORE = 1
    """They take part again."""
    RELABEL = 2
    """Their success is the decision's value, whatever was recorded."""
    UNLABEL = 3
    """Their success is again the one recorded."""
    UNDO = 4
    """Reverts the decision whose number is the value. Names no attempts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """One act of curation, as it was committed."""

    number: int
    """Position in the list of decisions, from 0."""
    action: Action
    value: int | None
    """The label given by RELABEL (0 or 1), the decision that UNDO undoes; None otherwise."""
    reason: str
    author: str
    decided: datetime
    """UTC."""
    attempts: tuple[str, ...]
    """Ids of the attempts it names."""


class Overlay:
    """The decisions of one version of a dataset, oldest first, and what follows from them."""

    def __init__(self, decisions: Sequence[Decision] = ()) -> None:
        self.decisions = tuple(decisions)

    @cached_property
    def undone(self) -> frozenset[int]:
        """Numbers of the decisions that were reverted. Undoing an UNDO brings its decision back."""
        undone: set[int] = set()
        for decision in reversed(self.decisions):
            if decision.action is Action.UNDO and decision.number not in undone and decision.value is not None:
                undone.add(decision.value)
        return frozenset(undone)

    @cached_property
    def exclusions(self) -> pd.Series[str]:
        """The reason of each excluded attempt, by id."""
        last = self._last(Action.EXCLUDE, Action.RESTORE)
        return last[[self.decisions[at].action is Action.EXCLUDE for at in last]].map(
            lambda at: self.decisions[at].reason
        )

    @cached_property
    def labels(self) -> pd.Series[bool]:
        """The label of each relabelled attempt, by id."""
        last = self._last(Action.RELABEL, Action.UNLABEL)
        return last[[self.decisions[at].action is Action.RELABEL for at in last]].map(
            lambda at: self.decisions[at].value == 1
        )

    def applied_to(self, table: pd.DataFrame) -> pd.DataFrame:
        """The attempts table with curation laid over it.

        Adds ``excluded`` and ``exclusion_reason`` (missing where an attempt is not excluded); ``success`` becomes the
        curated label and ``recorded_success`` keeps the recorded one.
        """
        success = table["success"].copy()
        labels = self.labels.reindex(table.index[table.index.isin(self.labels.index)])
        success.loc[labels.index] = labels.to_numpy(dtype=bool)
        reasons = self.exclusions.reindex(table.index)
        position = table.columns.tolist().index("success") + 1
        applied = table.assign(success=success)
        applied.insert(position, "recorded_success", table["success"])
        applied.insert(position + 1, "excluded", reasons.notna().to_numpy(dtype=bool))
        applied.insert(position + 2, "exclusion_reason", reasons.astype("str"))
        return applied

    def digest(self, table: pd.DataFrame) -> str:
        """What curation makes of the content of a version, as 64 hexadecimal digits.

        Covers which attempts are excluded or relabelled, and how; leaves out ids, reasons, authors and times, as the
        digest of the content does.
        """
        touched = table.loc[table["excluded"] | table.index.isin(self.labels.index)]
        relabelled = touched.index.isin(self.labels.index)
        lines = [
            f"{content} {'excluded' if excluded else 'kept'} {int(success) if labelled else 'recorded'}\n"
            for content, excluded, success, labelled in zip(
                touched["digest"], touched["excluded"], touched["success"], relabelled, strict=True
            )
        ]
        return hashlib.sha256(_DIGEST_PREFIX + "".join(sorted(lines)).encode()).hexdigest()

    def _last(self, *actions: Action) -> pd.Series[int]:
        """Number of the last decision with one of the actions that counts, by the id of the attempt."""
        counting = [one for one in self.decisions if one.action in actions and one.number not in self.undone]
        ids = [attempt for decision in counting for attempt in decision.attempts]
        numbers = np.repeat([one.number for one in counting], [len(one.attempts) for one in counting])
        last: pd.Series[int] = pd.Series(numbers, index=pd.Index(ids, dtype="str", name="attempt"), dtype="int64")
        return last[~last.index.duplicated(keep="last")]


def trainable(table: pd.DataFrame) -> pd.Series[bool]:
    """For each row of a curated table whether it takes part in training and balance: labelled and not excluded."""
    return table["success"].notna() & ~table["excluded"]


def read_overlay(root: zarr.Group) -> Overlay:
    """The decisions stored in a version.

    Raises:
        CorruptDataError: Their bytes are damaged, or a decision is none that handsight records.
    """
    if CURATION not in root:
        return Overlay()
    group = group_at(root, CURATION)
    facts, reasons, authors, keys = (read_all(array_at(group, path)) for path in (_FACTS, _REASON, _AUTHOR, _TARGETS))
    if not len(facts) == len(reasons) == len(authors):
        counts = f"columns of {len(facts)}, {len(reasons)} and {len(authors)}"
        raise CorruptDataError(f"the decisions of curation have {counts}, expected as many of each; {_REMEDY}")
    ids = ids_from_keys(keys)
    decisions: list[Decision] = []
    start = 0
    for number, row in enumerate(facts.tolist()):
        try:
            decisions.append(_decision(number, row, reasons[number], authors[number], ids[start : row[3]]))
            _check_targets(start, row[3], len(ids))
        except (ValueError, OverflowError, OSError) as error:
            raise CorruptDataError(
                f"decision {number} of curation is damaged ({error}), expected one that handsight records; {_REMEDY}"
            ) from error
        start = row[3]
    return Overlay(decisions)


def _decision(
    number: int, facts: list[int], reason: NDArray[np.uint8], author: NDArray[np.uint8], attempts: list[str]
) -> Decision:
    action, value, decided_ns, _ = facts
    what = Action(action)
    check_value(what, value, number)
    return Decision(
        number=number,
        action=what,
        value=None if value == _NO_VALUE else value,
        reason=text_from_bytes(reason),
        author=text_from_bytes(author),
        decided=datetime.fromtimestamp(decided_ns / 1e9, UTC),
        attempts=tuple(attempts),
    )


def check_value(action: Action, value: int | None, number: int) -> None:
    """Refuse a value that would mean another label than it says, or undo what was not decided yet.

    Raises:
        ValueError: The decision ``number`` cannot have it.
    """
    most = {Action.RELABEL: 1, Action.UNDO: number - 1}.get(action)
    if most is not None and (value is None or not 0 <= value <= most):
        raise ValueError(f"{action.name.lower()} has the value {value}, expected 0 to {most}")


def _check_targets(start: int, stop: int, known: int) -> None:
    if not start <= stop <= known:
        raise ValueError(f"its attempts end at {stop} of {known}, where they begin at {start}")


def append_decision(root: zarr.Group, decision: Decision) -> None:
    """Add a decision to the end of the list; the caller has checked it."""
    if CURATION not in root:
        _create(root)
    group = group_at(root, CURATION)
    targets = array_at(group, _TARGETS)
    append_rows(targets, keys_from_ids(decision.attempts))
    value = _NO_VALUE if decision.value is None else decision.value
    decided_ns = round(decision.decided.timestamp() * 1e9)
    facts = np.array([[decision.action, value, decided_ns, targets.shape[0]]], np.int64)
    append_rows(array_at(group, _FACTS), facts)
    append_rows(array_at(group, _REASON), text_to_bytes(decision.reason, REASON_BYTES)[None])
    append_rows(array_at(group, _AUTHOR), text_to_bytes(decision.author, AUTHOR_BYTES)[None])


def _create(root: zarr.Group) -> None:
    group = root.create_group(CURATION)
    decisions, targets = group.create_group("decisions"), group.create_group("targets")
    create_array(
        decisions, "facts", dtype="int64", row=(4,), axes=("decision", "fact"), attributes={"unit": "1, 1, ns, 1"}
    )
    create_array(decisions, "reason", dtype="uint8", row=(REASON_BYTES,), axes=("decision", "reason_byte"))
    create_array(decisions, "author", dtype="uint8", row=(AUTHOR_BYTES,), axes=("decision", "author_byte"))
    create_array(
        targets, "attempt", dtype="uint8", row=(KEY_BYTES,), axes=("target", "key_byte"), rows=_TARGET_CHUNK_ROWS
    )
