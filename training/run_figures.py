"""How large a run is and how good, read from its record without PyTorch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from handsight.training.run_record import WEIGHTS_SHA256, origins_of


@dataclass(frozen=True, slots=True, kw_only=True)
class RunFigures:
    """A run in a dozen numbers; None is what an older record does not say."""

    created: str | None
    """UTC, ISO 8601."""
    handsight: str | None
    """The version that wrote it."""
    channels: str
    data: tuple[str, ...]
    """Versions that it was trained on, each once, as ``DATASET@REF``."""
    attempts: int
    """Of all versions, each counted once however many of its pictures were used."""
    parameters: int | None
    passes: int
    kept: int | None
    """The pass after which the network was kept, from 1; the figures below are those of this pass."""
    held_out: int | None
    """Attempts that were held out."""
    accuracy: float | None
    """Balanced accuracy on them at S > 0.5."""
    auc: float | None
    loss: float | None
    weights_sha256: str | None


def input_words(grid: Mapping[str, Any]) -> str:
    """What a network reads, in words, from the grid of a record."""
    span = f" ({grid['span_m']:.2f} m of the table)" if grid.get("span_m") else ""
    return f"{grid['crop_px']} px of the picture{span} as {grid['size_px']} x {grid['size_px']} px"


def figures_of(record: Mapping[str, Any]) -> RunFigures:
    """The figures of a record that was read."""
    origins = origins_of(dict(record))
    attempts: dict[tuple[str, str], int] = {}
    for origin in origins:
        version = (origin["dataset"], origin["snapshot"])
        attempts[version] = max(origin["attempts"], attempts.get(version, 0))
    held_out = (kept_pass(record) or {}).get("held_out", {})
    return RunFigures(
        created=record.get("created"),
        handsight=record.get("handsight"),
        channels=record["settings"]["network"]["channels"],
        data=tuple(dict.fromkeys(map(version_of, origins))),
        attempts=sum(attempts.values()),
        parameters=record.get("parameters"),
        passes=len(record["history"]),
        kept=record.get("kept_epoch"),
        held_out=held_out.get("attempts"),
        accuracy=held_out.get("accuracy"),
        auc=held_out.get("auc"),
        loss=held_out.get("loss"),
        weights_sha256=record.get(WEIGHTS_SHA256),
    )


def kept_pass(record: Mapping[str, Any]) -> dict[str, Any] | None:
    """The pass after which the network was kept, of the record's history; None where the record does not say."""
    return next((one for one in record["history"] if one["number"] == record.get("kept_epoch")), None)


def version_of(origin: Mapping[str, Any]) -> str:
    """``DATASET@REF``; the dataset is written as it was given, mostly with its ref already."""
    name = str(origin["dataset"])
    return name if "@" in name.rpartition("/")[2] else f"{name}@{origin['ref']}"
