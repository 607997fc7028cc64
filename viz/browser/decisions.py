"""Decisions taken in the browser: what a person edits in its table becomes an undoable decision of curation.

The viewer writes an edited cell into the catalog's table. Who watches the table compares it with what the version says,
and has the curator decide the difference; what cannot be decided is written back as it was.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from handsight.datasets.curation.curator import Curator
from handsight.datasets.errors import DatasetError
from handsight.datasets.format.decisions import Decision
from handsight.datasets.reading.selection import Selection
from handsight.viz.browser.rows import LABELS, NO_LABEL

Act = Literal["exclude", "restore", "relabel", "unlabel"]
REASONS: dict[Act, str] = {
    "exclude": "excluded in the browser",
    "restore": "restored in the browser",
    "relabel": "relabelled in the browser",
    "unlabel": "back to the recorded label in the browser",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What counts of an attempt."""

    excluded: bool
    label: str
    """``success``, ``failure`` or, where there is none, a dash."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Edit:
    """What somebody wants of an attempt."""

    attempt: str
    act: Act
    label: str = ""
    """For ``relabel``: the one wanted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decided:
    """What came of an edit."""

    edit: Edit
    decision: Decision | None
    """None where it changed nothing or was refused."""
    refused: str = ""
    """Why it was refused."""


def edits_between(before: Mapping[str, Row], after: Iterable[tuple[str, bool, str]]) -> tuple[list[Edit], list[str]]:
    """What was edited, and the attempts whose cells hold what no attempt can be.

    Args:
        before: What counts, by id.
        after: What the table says: id, whether excluded, label.
    """
    edits: list[Edit] = []
    senseless: list[str] = []
    for attempt, excluded, label in after:
        row = before.get(attempt)
        if row is None:
            continue
        if excluded != row.excluded:
            edits.append(Edit(attempt=attempt, act="exclude" if excluded else "restore"))
        wanted = label.strip().lower()
        if wanted == row.label:
            if label != row.label:
                senseless.append(attempt)
        elif row.label == NO_LABEL or (wanted and wanted not in LABELS):
            senseless.append(attempt)
        elif wanted:
            edits.append(Edit(attempt=attempt, act="relabel", label=wanted))
        else:
            edits.append(Edit(attempt=attempt, act="unlabel"))
    return edits, senseless


def decide(curator: Curator, edits: Iterable[Edit]) -> list[Decided]:
    """Have the curator decide, one decision for each edit, so that each can be undone by itself."""
    done = []
    for edit in edits:
        try:
            done.append(Decided(edit=edit, decision=_decide(curator, edit)))
        except DatasetError as error:
            done.append(Decided(edit=edit, decision=None, refused=str(error)))
    return done


def _decide(curator: Curator, edit: Edit) -> Decision | None:
    which, reason = Selection(ids=(edit.attempt,)), REASONS[edit.act]
    if edit.act == "relabel":
        return curator.relabel(which, edit.label == LABELS[0], reason)
    acts: dict[str, Callable[[Selection, str], Decision | None]] = {
        "exclude": curator.exclude,
        "restore": curator.restore,
        "unlabel": curator.unlabel,
    }
    return acts[edit.act](which, reason)
