"""Which attempts a finished run held out while it was trained: the only ones of its data that can judge it.

A run records from what and with which seed it was trained, not which attempts were held out. The same draw is made
again, and believed where it has as many attempts as the record says.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray

from handsight.datasets.address import DatasetAddress
from handsight.datasets.errors import DatasetError, counted
from handsight.datasets.format.schema import Viewpoint
from handsight.datasets.inputs.materialize import usable_attempts
from handsight.datasets.inputs.mixture import mixed_attempts
from handsight.datasets.inputs.twins import grasp_keys
from handsight.datasets.reading.reader import GraspDataset
from handsight.training.data_selection import DataSelection
from handsight.training.errors import HeldOutError
from handsight.training.run_figures import kept_pass
from handsight.training.run_record import TWINS_TOGETHER, origins_of
from handsight.training.trainer import split_held_out


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOut:
    """Attempts of one version that a run held out."""

    dataset: GraspDataset
    viewpoint: Viewpoint
    attempts: tuple[str, ...]
    learnt: tuple[str, ...]
    """The others of the version that it was trained on."""


def held_out_attempts(record: Mapping[str, Any], *, beside: GraspDataset) -> list[HeldOut]:
    """What a run held out, one entry for each version and picture that it was trained on.

    Args:
        record: The run's.
        beside: A version at hand; others of its dataset are opened there, wherever the run says that they were.

    Raises:
        HeldOutError: Nothing was held out, a version is gone, or the draw cannot be made again.
    """
    settings = record["settings"]
    expected = ((kept_pass(record) or {}).get("held_out") or {}).get("attempts")
    if not settings.get("holdout") or not expected:
        raise HeldOutError("the run held no attempts out, expected some")
    try:
        parts = [
            (dataset, viewpoint, usable_attempts(dataset, viewpoint))
            for dataset, viewpoint in _opened(origins_of(dict(record)), beside)
        ]
        chosen = _chosen(record, parts)
    except (DatasetError, OSError) as error:
        raise HeldOutError(f"what the run was trained on cannot be read again: {error}") from error
    table = mixed_attempts([rows for _, _, rows in parts])
    attempts = table.index
    generator = torch.Generator().manual_seed(settings["seed"])
    keys = grasp_keys(table) if record.get(TWINS_TOGETHER) else attempts
    held, _ = split_held_out(keys, chosen, settings["holdout"], generator)
    if len(held) != expected:
        raise HeldOutError(
            f"drawn again, {counted(len(held), 'input')} would be held out, expected {expected} as in the record"
        )
    return list(_by_part(parts, attempts, chosen, held))


def _opened(origins: list[dict[str, Any]], beside: GraspDataset) -> Iterator[tuple[GraspDataset, Viewpoint]]:
    for origin in origins:
        viewpoint, snapshot = cast("Viewpoint", origin["view"]), str(origin["snapshot"])
        if snapshot == beside.snapshot_id:
            yield beside, viewpoint
            continue
        try:
            yield GraspDataset.open(f"{beside.repository.path}@{snapshot}"), viewpoint
        except DatasetError:
            path = DatasetAddress.parse(str(origin["dataset"])).path
            yield GraspDataset.open(f"{path}@{snapshot}"), viewpoint


def _chosen(record: Mapping[str, Any], parts: list[tuple[GraspDataset, Viewpoint, pd.DataFrame]]) -> NDArray[np.int64]:
    """Positions of the inputs that were trained on or held out, in all parts one after another."""
    selection = DataSelection(**(record.get("selection") or {}))
    masks = [selection.chosen(dataset, rows) for dataset, _, rows in parts]
    attempts = pd.concat([rows[["success"]] for _, _, rows in parts]).index
    return selection.rows(masks, attempts, record["settings"]["seed"])


def _by_part(
    parts: list[tuple[GraspDataset, Viewpoint, pd.DataFrame]],
    attempts: pd.Index[str],
    chosen: NDArray[np.int64],
    held: NDArray[np.int64],
) -> Iterator[HeldOut]:
    start = 0
    for dataset, viewpoint, rows in parts:
        own = held[(held >= start) & (held < start + len(rows))]
        used = chosen[(chosen >= start) & (chosen < start + len(rows))]
        yield HeldOut(
            dataset=dataset,
            viewpoint=viewpoint,
            attempts=tuple(map(str, attempts[own])),
            learnt=tuple(map(str, attempts[np.setdiff1d(used, own)])),
        )
        start += len(rows)
