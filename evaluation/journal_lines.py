"""Trials and cleared tables as lines of a journal, and back."""

from __future__ import annotations

import math
from dataclasses import asdict, fields
from typing import Any, Final, TypeVar

from handsight.evaluation.clearance import ClearedTable
from handsight.evaluation.journal import JournalKind
from handsight.evaluation.trial import Trial

_TYPES: Final[dict[str, tuple[type, ...]]] = {
    "int": (int,),
    "bool": (bool,),
    "str": (str,),
    "float": (int, float, type(None)),
    "float | None": (int, float, type(None)),
    "bool | None": (bool, type(None)),
    "tuple[tuple[float, ...], ...]": (list,),
}
Flat = TypeVar("Flat", Trial, ClearedTable)


def trial_to_json(trial: Trial) -> dict[str, Any]:
    """A trial as JSON values; what is not a number becomes null."""
    return {
        name: None if isinstance(value, float) and math.isnan(value) else value for name, value in asdict(trial).items()
    }


def _trial_from_json(values: dict[str, Any]) -> Trial | None:
    values = {"touched_by": "", "pushed_m": None, "steps": [], **values}  # Older journals have none.
    steps = _steps_from_json(values["steps"])
    return None if steps is None else _flat_from_json(Trial, values, steps=steps)


def _steps_from_json(values: Any) -> tuple[tuple[float, ...], ...] | None:
    if not isinstance(values, list):
        return None
    if not all(isinstance(step, list) and all(type(value) in (int, float) for value in step) for step in values):
        return None
    return tuple(tuple(map(float, step)) for step in values)


def _table_to_json(table: ClearedTable) -> dict[str, Any]:
    # By itself: both a line and a table have objects.
    return {"table": asdict(table)}


def _table_from_json(values: dict[str, Any]) -> ClearedTable | None:
    table = values.get("table")
    return _flat_from_json(ClearedTable, table) if values.keys() == {"table"} and isinstance(table, dict) else None


def _flat_from_json(record: type[Flat], values: dict[str, Any], **converted: Any) -> Flat | None:
    """The record of these fields; None where they are others, or of other types."""
    kinds = {field.name: str(field.type) for field in fields(record)}
    if values.keys() != kinds.keys() or any(type(values[name]) not in _TYPES[kinds[name]] for name in kinds):
        return None
    missing = {name: math.nan for name, kind in kinds.items() if kind == "float" and values[name] is None}
    return record(**{**values, **missing, **converted})


TRIALS: Final = JournalKind(
    name="evaluation", with_article="an evaluation", noun="trial", to_json=trial_to_json, from_json=_trial_from_json
)
TABLES: Final = JournalKind(
    name="clearance", with_article="a clearance", noun="table", to_json=_table_to_json, from_json=_table_from_json
)
