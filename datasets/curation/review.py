"""Going through attempts one by one, and deciding about each: every decision is one of curation, to be undone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from handsight.datasets.curation.curator import Curator
from handsight.datasets.format.decisions import Decision
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.reading.selection import Selection

Verdict = Literal["keep", "exclude", "restore", "success", "failure", "recorded", "undo", "next", "back"]
"""What a person says of an attempt. ``keep`` and ``next`` decide nothing; the first counts as looked at."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reviewed:
    """What came of a verdict."""

    verdict: Verdict
    attempt: str
    """The attempt that it was about."""
    decision: Decision | None
    """None where it decided nothing, or what it says is so already."""


class Review:
    """A walk over attempts.

    Args:
        curator: Takes the decisions.
        ids: The attempts, in the order of the walk; at least one.
        reason: Kept with every decision.
    """

    def __init__(self, curator: Curator, ids: Sequence[str], *, reason: str) -> None:
        self._curator = curator
        self._ids = tuple(ids)
        self._reason = reason
        self._decided: list[tuple[int, Decision]] = []
        self._seen: set[str] = set()
        self.position = 0
        """Of the attempt that is looked at; the number of attempts behind the last one."""

    @property
    def attempt(self) -> str | None:
        """The attempt that is looked at; None behind the last one."""
        return self._ids[self.position] if self.position < len(self._ids) else None

    @property
    def decisions(self) -> tuple[Decision, ...]:
        """Decisions of this walk that were not undone in it."""
        return tuple(decision for _, decision in self._decided)

    @property
    def looked_at(self) -> int:
        """How many attempts got a verdict."""
        return len(self._seen)

    def say(self, verdict: Verdict) -> Reviewed:
        """Decide about the attempt that is looked at, and go on to the next; undo and back go to an earlier one.

        Raises:
            CurationError: The attempt has no label to correct; nothing is decided and nobody goes on.
            IndexError: There is no attempt left.
        """
        if verdict == "undo":
            return self._undo()
        if verdict == "back":
            self.position = max(0, self.position - 1)
            return Reviewed(verdict=verdict, attempt=self._ids[self.position], decision=None)
        attempt = self._ids[self.position]
        decision = self._decide(attempt, verdict)
        if decision is not None:
            self._decided.append((self.position, decision))
        if verdict != "next":
            self._seen.add(attempt)
        self.position += 1
        return Reviewed(verdict=verdict, attempt=attempt, decision=decision)

    def dataset(self) -> GraspDataset:
        """The version as it is after the last decision."""
        return GraspDataset(self._curator.repository, ref=self._curator.branch)

    def _decide(self, attempt: str, verdict: Verdict) -> Decision | None:
        which = Selection(ids=(attempt,))
        match verdict:
            case "exclude":
                return self._curator.exclude(which, self._reason)
            case "restore":
                return self._curator.restore(which, self._reason)
            case "success" | "failure":
                return self._curator.relabel(which, verdict == "success", self._reason)
            case "recorded":
                return self._curator.unlabel(which, self._reason)
            case _:
                return None

    def _undo(self) -> Reviewed:
        """Revert the last decision of this walk, and go back to its attempt."""
        if not self._decided:
            return Reviewed(verdict="undo", attempt=self._ids[min(self.position, len(self._ids) - 1)], decision=None)
        position, decision = self._decided[-1]
        undone = self._curator.undo(decision.number, self._reason)
        self._decided.pop()
        self.position = position
        return Reviewed(verdict="undo", attempt=self._ids[position], decision=undone)
