"""What the user of an export changed in it, found by comparing what it carries twice.

Formats that others read hold labels, actions and filter keys beside the columns from which attempts come back. Whoever
edits what others read means it: labels become relabellings and filter keys exclusions, with a reason that names the
file. What no decision can hold is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from handsight.datasets.errors import InterchangeError
from handsight.datasets.format.decisions import AUTHOR_BYTES, REASON_BYTES, Action, Decision, Overlay
from handsight.datasets.format.schema import attempt_ids
from handsight.datasets.records import Outcome

_NAMED = 5
"""Places that a message names of one kind of fault."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Edits:
    """Changes of an export that decisions can hold, by the ids of the attempts."""

    file: str = ""
    """Name of what was changed."""
    labels: Mapping[str, bool] = field(default_factory=dict)
    """The labels it gives to attempts that were recorded with the other one."""
    excluded: Collection[str] = ()
    restored: Collection[str] = ()

    def __bool__(self) -> bool:
        return bool(self.labels or self.excluded or self.restored)


NO_EDITS = Edits()


class Comparison:
    """Collects differences between what an export says and what was recorded, then answers or refuses at once."""

    def __init__(self, file: str) -> None:
        self._file = file
        self._faults: list[str] = []
        self._labels: dict[str, bool] = {}
        self._excluded: frozenset[str] = frozenset()
        self._restored: frozenset[str] = frozenset()

    def labels(
        self,
        name: str,
        values: NDArray[np.float64],
        *,
        outcome: NDArray[np.uint8],
        ids: Sequence[str],
        places: Sequence[str],
    ) -> None:
        """Compare labels, 1 for a success, with the outcomes that were recorded. All have length N."""
        recorded = outcome == Outcome.HELD
        labelled = np.isin(outcome, (Outcome.EMPTY, Outcome.HELD))
        sound = np.isin(values, (0, 1))
        changed = sound & (values != recorded)
        self.refuse(f"{name} is neither 0 nor 1", _of(places, ~sound))
        self.refuse(f"{name} labels an attempt that did not run to its end", _of(places, changed & ~labelled))
        for at in np.flatnonzero(changed & labelled).tolist():
            self._labels[ids[at]] = bool(values[at])

    def same(self, name: str, found: NDArray[np.generic], expected: NDArray[np.generic], places: Sequence[str]) -> None:
        """Compare rows that no decision can change; NaN is equal to NaN. Both have shape (N, ...)."""
        kinds = {np.issubdtype(one.dtype, np.inexact) for one in (found, expected)}
        equal = np.equal(found, expected) | (np.isnan(found) & np.isnan(expected) if kinds == {True} else False)
        self.refuse(f"{name} is not what was recorded", _of(places, ~equal.reshape(len(places), -1).all(axis=1)))

    def exclusions(self, now: Collection[str], recorded: Collection[str]) -> None:
        """Compare the ids of the attempts that are excluded."""
        self._excluded, self._restored = frozenset(now) - frozenset(recorded), frozenset(recorded) - frozenset(now)

    def refuse(self, fault: str, places: Sequence[str]) -> None:
        """Note what cannot be imported, and where, if anywhere."""
        if places:
            more = f" and {len(places) - _NAMED} more" if len(places) > _NAMED else ""
            self._faults.append(f"{fault} ({', '.join(places[:_NAMED])}{more})")

    def edits(self, editable: str) -> Edits:
        """What decisions can hold; ``editable`` names it for the message.

        Raises:
            InterchangeError: There is something else; the message lists it.
        """
        if self._faults:
            raise InterchangeError(
                f"{self._file} was changed after it was exported: {'; '.join(self._faults)}; only {editable} can be "
                "changed in an export: undo the rest, or export anew"
            )
        return Edits(file=self._file, labels=self._labels, excluded=self._excluded, restored=self._restored)


def decisions_of(
    edits: Edits, overlay: Overlay, *, author: str, ids_there: Mapping[str, str] | None = None
) -> Iterator[Decision]:
    """The decisions that make of a version's curation what an edited export says; none that changes nothing.

    Args:
        edits: What was changed.
        overlay: The curation so far.
        author: Who imports.
        ids_there: What attempts are called in the version, where that is something else.
    """
    there = ids_there or {}
    labels, exclusions = overlay.labels, overlay.exclusions.index
    names = {label: [one for one, given in edits.labels.items() if given is label] for label in (True, False)}
    # An edit gives the label that was not recorded, so the recorded one holds where nobody has relabelled.
    groups: tuple[tuple[Action, int | None, Collection[str], Callable[[str], bool]], ...] = (
        (Action.RELABEL, 1, names[True], lambda one: not labels.get(one, False)),
        (Action.RELABEL, 0, names[False], lambda one: bool(labels.get(one, True))),
        (Action.EXCLUDE, None, edits.excluded, lambda one: one not in exclusions),
        (Action.RESTORE, None, edits.restored, lambda one: one in exclusions),
    )
    number = len(overlay.decisions)
    for action, value, edited, affects in groups:
        attempts = [one for one in (there.get(name, name) for name in sorted(edited)) if affects(one)]
        if attempts:
            yield Decision(
                number=number,
                action=action,
                value=value,
                reason=_within(f"changed in {edits.file}", REASON_BYTES),
                author=_within(author, AUTHOR_BYTES),
                decided=datetime.now(UTC),
                attempts=tuple(attempts),
            )
            number += 1


def session_ids(ulid: str, size: int) -> list[str]:
    """The ids of the attempts of a session, in their order."""
    return attempt_ids(ulid, range(size))


def _of(places: Sequence[str], chosen: NDArray[np.bool_]) -> list[str]:
    return [places[at] for at in np.flatnonzero(chosen).tolist()]


def _within(text: str, size: int) -> str:
    """The beginning of a text that fits into so many bytes of UTF-8."""
    return text.encode(errors="replace")[:size].decode(errors="ignore")
