"""What the browser's table says of each attempt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from handsight.datasets.reading.reader import GraspDataset

INDEX = "attempt"
"""The column by which a row is written again."""
EXCLUDED = "excluded"
LABEL = "label"
"""The columns that a person may edit."""
LABELS = ("success", "failure")
"""What may be written into the label's cell of an attempt that has one; its being emptied means the recorded one."""
NO_LABEL = "-"
_COLUMNS = (
    "number",
    "outcome",
    "success",
    "recorded_success",
    "excluded",
    "exclusion_reason",
    "target",
    "predicted_success",
    "contact_force_n",
    "width_final_m",
    "started",
    "pregrasp_x_m",
    "pregrasp_y_m",
    "pregrasp_angle_rad",
    "overhead_taken",
)
# The viewer writes the value of a row again by the column so marked.
_IS_INDEX = {b"rerun:is_table_index": b"true"}

SCHEMA = pa.schema(
    [
        pa.field(INDEX, pa.string(), metadata=_IS_INDEX),
        pa.field("title", pa.string()),
        pa.field(EXCLUDED, pa.bool_()),
        pa.field(LABEL, pa.string()),
        pa.field("outcome", pa.string()),
        pa.field("target", pa.string()),
        pa.field("predicted_success", pa.float64()),
        pa.field("label_quality", pa.float64()),
        pa.field("force_n", pa.float64()),
        pa.field("opening_mm", pa.float64()),
        pa.field("findings", pa.string()),
        pa.field("curation", pa.string()),
        pa.field("started", pa.string()),
        pa.field("session", pa.string()),
        pa.field("card", pa.string()),
        pa.field("open", pa.string()),
    ]
)
"""The browser's table, one row for each attempt. ``card`` and ``open`` are addresses of recordings."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """What is known of attempts beside what was recorded; all by id."""

    predicted: Mapping[str, float] = field(default_factory=dict)
    """What a network expects of the grasp that was attempted; without one, what was recorded of the policy's."""
    label_quality: Mapping[str, float] = field(default_factory=dict)
    """Probability of the label by networks that never saw the attempt."""
    findings: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Codes of what doctor finds."""


@dataclass(frozen=True, slots=True)
class BrowserRow:
    """What is shown of an attempt, in plain values: tens of thousands of them are made at once."""

    number: int
    outcome: str
    success: bool | None
    """The label that counts; None where there is none."""
    recorded_success: bool | None
    excluded: bool
    exclusion_reason: str | None
    target: str | None
    predicted_success: float
    contact_force_n: float
    width_final_m: float
    started: str
    """UTC."""
    pregrasp_x_m: float
    pregrasp_y_m: float
    pregrasp_angle_rad: float
    """The pre-grasp pose in the base frame; NaN where none was chosen."""
    overhead_taken: bool
    """Whether there is a picture to show."""

    @property
    def title(self) -> str:
        """What a person calls it: what it was after, how it ended, and its number."""
        target = "no target" if self.target is None else self.target.split("/")[-1]
        return f"{target} · {self.outcome} · {self.number}"

    @property
    def label(self) -> str:
        """The label as the table's cell has it."""
        return label_text(self.success)

    @property
    def curation(self) -> str:
        """What curation decided of it; empty where it decided nothing."""
        said = [f"excluded: {self.exclusion_reason}"] if self.excluded else []
        if self.success is not None and self.success != self.recorded_success:
            said.append(f"relabelled from {label_text(self.recorded_success)}")
        return "; ".join(said)


def browser_rows(dataset: GraspDataset, ids: Sequence[str]) -> dict[str, BrowserRow]:
    """What is shown of attempts, by id, in the order of the ids."""
    found = dataset.rows(ids, _COLUMNS).loc[list(ids)]
    columns = [_plain(found[name]) for name in _COLUMNS]
    return {str(key): BrowserRow(*values) for key, *values in zip(found.index, *columns, strict=True)}


def table_batch(
    rows: Mapping[str, BrowserRow], seen: Seen, *, card: Mapping[str, str], opened: Mapping[str, str]
) -> pa.RecordBatch:
    """The rows as the viewer's table takes them.

    Args:
        rows: As of :func:`browser_rows`.
        seen: What else is known.
        card: Address of the recording that a card shows, by id.
        opened: Address of the recording that a card opens.
    """
    predicted = seen.predicted or {key: row.predicted_success for key, row in rows.items()}
    nothing = float("nan")
    values: dict[str, Any] = {
        INDEX: list(rows),
        "title": [row.title for row in rows.values()],
        EXCLUDED: [row.excluded for row in rows.values()],
        LABEL: [row.label for row in rows.values()],
        "outcome": [row.outcome for row in rows.values()],
        "target": [row.target for row in rows.values()],
        "predicted_success": _numbers([predicted.get(key, nothing) for key in rows], 3),
        "label_quality": _numbers([seen.label_quality.get(key, nothing) for key in rows], 3),
        "force_n": _numbers([row.contact_force_n for row in rows.values()], 1),
        "opening_mm": _numbers([1e3 * row.width_final_m for row in rows.values()], 1),
        "findings": [" ".join(seen.findings.get(key, ())) or None for key in rows],
        "curation": [row.curation or None for row in rows.values()],
        "started": [row.started for row in rows.values()],
        "session": [key.partition("-")[0] for key in rows],
        "card": [card[key] for key in rows],
        "open": [opened[key] for key in rows],
    }
    return pa.record_batch([pa.array(values[one.name], type=one.type) for one in SCHEMA], schema=SCHEMA)


def label_text(success: bool | None) -> str:
    """A label as the table's cell has it."""
    return NO_LABEL if success is None else LABELS[0] if success else LABELS[1]


def _plain(column: pd.Series[Any]) -> list[Any]:
    """The values of a column as Python's own; None for what is missing but in columns of numbers."""
    if column.name == "started":
        return list(column.dt.strftime("%Y-%m-%d %H:%M:%S"))
    if pd.api.types.is_float_dtype(column.dtype):
        return column.tolist()
    return column.astype(object).where(column.notna(), None).tolist()


def _numbers(values: Any, digits: int) -> Any:
    """Numbers as they are read off; the viewer writes all digits there are. What is missing is null."""
    rounded = np.round(np.asarray(values, dtype=float), digits)
    return pa.array(rounded, mask=np.isnan(rounded))
