"""Setting attempts aside and correcting labels, without touching what was recorded.

Every method is one commit that adds one decision, with its reason, author and time; see ``format/decisions.py``.
Decisions made at the same time by several processes are all kept, in the order in which they were committed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from typing import TypeVar

import pandas as pd
import zarr

from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.errors import CurationError, UnknownNameError, counted
from handsight.datasets.format.decisions import AUTHOR_BYTES, REASON_BYTES, Action, Decision, append_decision
from handsight.datasets.format.saved_filters import read_filters
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.reading.selection import Selection, select
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.writing.change import Change, change_branch, preview_change

D = TypeVar("D", Decision, Decision | None)


class Curator:
    """Takes decisions about the attempts of one branch, in the name of one author.

    Raises:
        CurationError: The author cannot be recorded.
    """

    def __init__(self, repository: GraspRepository, *, author: str, branch: str = DEFAULT_REF) -> None:
        _refuse(_text_faults("author", author, AUTHOR_BYTES))
        self.repository = repository
        self.branch = branch
        self.author = author

    def exclude(self, which: Selection, reason: str, *, dry_run: bool = False) -> Decision | None:
        """Keep attempts out of training and balance.

        Args:
            which: The attempts; those that are excluded already keep the reason they have.
            reason: Why.
            dry_run: Decide, but commit nothing.

        Returns:
            The decision with the attempts that it changes; None when it would change nothing.

        Raises:
            CurationError: The reason cannot be recorded.
            AttemptNotFoundError: There is no attempt with one of the ids.
            WhereError: The expression is not sound.
            RefNotFoundError: There is no such branch.
        """
        return self._decide(Action.EXCLUDE, None, which, reason, lambda rows: ~rows["excluded"], dry_run)

    def restore(self, which: Selection, reason: str, *, dry_run: bool = False) -> Decision | None:
        """Take excluded attempts back in. As :meth:`exclude` otherwise."""
        return self._decide(Action.RESTORE, None, which, reason, lambda rows: rows["excluded"], dry_run)

    def relabel(self, which: Selection, success: bool, reason: str, *, dry_run: bool = False) -> Decision | None:
        """Give attempts another label. As :meth:`exclude` otherwise.

        Raises:
            CurationError: An attempt among them did not run to its end and so has no label to correct.
        """

        def other(rows: pd.DataFrame) -> pd.Series[bool]:
            unlabelled = rows.index[rows["recorded_success"].isna()]
            if len(unlabelled):
                raise CurationError(
                    f"{len(unlabelled)} of the attempts, {unlabelled[0]} the first, did not run to their end and have "
                    "no label to correct: name only attempts with recorded_success.notna()"
                )
            return (rows["success"] != success).astype(bool)

        return self._decide(Action.RELABEL, int(success), which, reason, other, dry_run)

    def unlabel(self, which: Selection, reason: str, *, dry_run: bool = False) -> Decision | None:
        """Go back to the label that was recorded. As :meth:`exclude` otherwise."""

        def corrected(rows: pd.DataFrame) -> pd.Series[bool]:
            return (rows["success"] != rows["recorded_success"]).fillna(False).astype(bool)

        return self._decide(Action.UNLABEL, None, which, reason, corrected, dry_run)

    def undo(self, number: int | None = None, reason: str = "undone", *, dry_run: bool = False) -> Decision:
        """Revert a curation decision, the latest that counts unless a number is given.

        What other decisions, before and after it, say of the same attempts then holds. Undoing an UNDO is redoing.
        With ``dry_run`` nothing is committed.

        Raises:
            UnknownNameError: There is no such decision, or none is left that counts.
            CurationError: It was undone already, or the reason cannot be recorded.
        """
        _refuse(_text_faults("reason", reason, REASON_BYTES))

        def change(dataset: GraspDataset, root: zarr.Group) -> tuple[str | None, Decision]:
            undone = _decision_to_undo(dataset, number)
            decision = self._decision(dataset, Action.UNDO, undone.number, (), reason)
            if dry_run:
                return None, decision
            append_decision(root, decision)
            return f"undo decision {undone.number} ({undone.action.name.lower()}): {reason}", decision

        return self._made(change, dry_run=dry_run)

    def _decide(
        self,
        action: Action,
        value: int | None,
        which: Selection,
        reason: str,
        affects: Callable[[pd.DataFrame], pd.Series[bool]],
        dry_run: bool,
    ) -> Decision | None:
        _refuse(_text_faults("reason", reason, REASON_BYTES))

        def change(dataset: GraspDataset, root: zarr.Group) -> tuple[str | None, Decision | None]:
            rows = dataset.attempts.loc[select(dataset.attempts, which, read_filters(root))]
            attempts = rows.index[affects(rows)]
            if attempts.empty:
                return None, None
            decision = self._decision(dataset, action, value, attempts.tolist(), reason)
            if dry_run:
                return None, decision
            append_decision(root, decision)
            return f"{action.name.lower()} {counted(len(attempts), 'attempt')}: {reason}", decision

        return self._made(change, dry_run=dry_run)

    def _made(self, change: Change[D], *, dry_run: bool) -> D:
        """The decision that the change takes, committed unless it is only tried."""
        if dry_run:
            return preview_change(self.repository, self.branch, change)
        return change_branch(self.repository, self.branch, change).value

    def _decision(
        self, dataset: GraspDataset, action: Action, value: int | None, attempts: Sequence[str], reason: str
    ) -> Decision:
        return Decision(
            number=len(dataset.overlay.decisions),
            action=action,
            value=value,
            reason=reason,
            author=self.author,
            decided=datetime.now(UTC),
            attempts=tuple(attempts),
        )


def _decision_to_undo(dataset: GraspDataset, number: int | None) -> Decision:
    decisions, undone = dataset.overlay.decisions, dataset.overlay.undone
    if number is None:
        counting = [one for one in decisions if one.number not in undone and one.action is not Action.UNDO]
        if not counting:
            raise UnknownNameError(
                f"there is no decision left to undo ({counted(len(decisions), 'decision')}, all undone)"
            )
        return counting[-1]
    if not 0 <= number < len(decisions):
        raise UnknownNameError(f"there is no decision {number}, expected 0 to {len(decisions) - 1}")
    if number in undone:
        raise CurationError(f"decision {number} was undone already: name the UNDO itself to bring it back")
    return decisions[number]


def _text_faults(name: str, text: str, size: int) -> list[str]:
    faults = []
    if not text.strip():
        faults.append(f"{name} is empty, expected some text")
    if "\0" in text or len(text.encode(errors="replace")) > size:
        faults.append(
            f"{name} takes {counted(len(text), 'character')}, expected at most {size} bytes of UTF-8 without NUL"
        )
    if text.encode(errors="ignore").decode() != text:
        faults.append(f"{name} holds a lone surrogate, expected text that UTF-8 can write")
    return faults


def _refuse(faults: list[str]) -> None:
    if faults:
        raise CurationError(f"the decision is refused: {'; '.join(faults)}")
