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
    "failure",
    "started",
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


def browser_rows(dataset: GraspDataset, ids: Sequence[str]) -> pd.DataFrame:
    """The columns that the browser's table is made of, in the order of the ids."""
    return dataset.rows(ids, _COLUMNS).loc[list(ids)]


def table_batch(
    rows: pd.DataFrame, seen: Seen, *, card: Mapping[str, str], opened: Mapping[str, str]
) -> pa.RecordBatch:
    """The rows as the viewer's table takes them.

    Args:
        rows: As of :func:`browser_rows`.
        seen: What else is known.
        card: Address of the recording that a card shows, by id.
        opened: Address of the recording that a card opens.
    """
    ids = [str(key) for key in rows.index]
    predicted = rows["predicted_success"].to_numpy(dtype=float)
    if seen.predicted:
        predicted = np.array([seen.predicted.get(key, np.nan) for key in ids], dtype=float)
    values: dict[str, Any] = {
        INDEX: ids,
        "title": [title(row) for row in rows.itertuples()],
        EXCLUDED: rows["excluded"].to_numpy(dtype=bool),
        LABEL: [label_text(success) for success in rows["success"]],
        "outcome": rows["outcome"].tolist(),
        "target": [None if pd.isna(target) else target for target in rows["target"]],
        "predicted_success": _numbers(predicted, 3),
        "label_quality": _numbers([seen.label_quality.get(key, np.nan) for key in ids], 3),
        "force_n": _numbers(rows["contact_force_n"], 1),
        "opening_mm": _numbers(1e3 * rows["width_final_m"], 1),
        "findings": [" ".join(seen.findings.get(key, ())) or None for key in ids],
        "curation": [curation_text(row) or None for row in rows.itertuples()],
        "started": [f"{when:%Y-%m-%d %H:%M:%S}" for when in rows["started"]],
        "session": [key.partition("-")[0] for key in ids],
        "card": [card[key] for key in ids],
        "open": [opened[key] for key in ids],
    }
    return pa.record_batch([pa.array(values[one.name], type=one.type) for one in SCHEMA], schema=SCHEMA)


def title(row: Any) -> str:
    """What a person calls an attempt: what it was after, how it ended, and its number."""
    target = "no target" if pd.isna(row.target) else str(row.target).split("/")[-1]
    return f"{target} · {row.outcome} · {row.number}"


def label_text(success: Any) -> str:
    """The label as the table's cell has it."""
    return NO_LABEL if pd.isna(success) else LABELS[0] if success else LABELS[1]


def curation_text(row: Any) -> str:
    """What curation decided of an attempt; empty where it decided nothing."""
    said = []
    if row.excluded:
        said.append(f"excluded: {row.exclusion_reason}")
    if not pd.isna(row.success) and bool(row.success) != bool(row.recorded_success):
        said.append(f"relabelled from {label_text(row.recorded_success)}")
    return "; ".join(said)


def _numbers(values: Any, digits: int) -> Any:
    """Numbers as they are read off; the viewer writes all digits there are. What is missing is null."""
    rounded = np.round(np.asarray(values, dtype=float), digits)
    return pa.array(rounded, mask=np.isnan(rounded))
