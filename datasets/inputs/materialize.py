"""From raw pictures to network inputs: warped once, kept in a memory-mapped cache.

A dataset stores what the camera saw. What the network reads is derived from it: the frame from one viewpoint, warped
to the pre-grasp pose at which the fixed grasp policy started (section III-B). The cache is keyed by snapshot and
transform, so it can be deleted at any time and never goes stale: curation and folds are part of the snapshot. It is
checked whenever it is opened, and made again where it is damaged.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray

from handsight.datasets.errors import NoTrainingDataError, StorageError
from handsight.datasets.format.decisions import trainable
from handsight.datasets.format.schema import Viewpoint, parse_attempt_id
from handsight.datasets.format.stored_values import impossible
from handsight.datasets.inputs.cache import mapped_again, open_cache, write_cache
from handsight.datasets.inputs.viewpoint import DEFAULT_VIEWPOINT
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.records import RgbdFrame, StationSpec
from handsight.datasets.store.readers import being_read
from handsight.datasets.views import input_span_m, station_view
from handsight.datasets.writable import folder_fault
from handsight.servoing.homography import SAME_SCALE, InputGrid, predict_inputs
from handsight.servoing.planar import PlanarPose
from handsight.servoing.prepared_view import PreparedView

CACHE_VERSION = 1
"""Counts changes of the warp that change the inputs' values."""

_PICTURES_AHEAD = 32
"""Pictures read before the input made of the first of them is taken."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspInputs:
    """Network inputs and labels of one version of a dataset."""

    inputs: NDArray[np.float16]
    """Red, green, blue in [0, 1] and height below the plane [m]; memory-mapped. Shape (N, 4, size, size)."""
    attempts: pd.DataFrame
    """The rows of the attempts table they belong to, in the same order."""

    @property
    def file(self) -> Path | None:
        """The file that the inputs are mapped from; None where they are in memory."""
        return Path(str(self.inputs.filename)) if isinstance(self.inputs, np.memmap) else None

    @property
    def labels(self) -> NDArray[np.float32]:
        """1 where the grasp succeeded. Shape (N,)."""
        return self.attempts["success"].to_numpy(dtype=np.float32)

    def __reduce__(self) -> tuple[Callable[..., GraspInputs], tuple[Any, ...]]:
        """Pickled as the name of the file that the inputs are mapped from, not as its content, where there is one."""
        return _unpickled, (self.file or self.inputs, self.inputs.shape, self.attempts)


def _unpickled(inputs: Path | NDArray[np.float16], shape: tuple[int, ...], attempts: pd.DataFrame) -> GraspInputs:
    if isinstance(inputs, Path):
        inputs = mapped_again(inputs, shape=shape, dtype=np.float16)
    return GraspInputs(inputs=inputs, attempts=attempts)


def materialize(
    dataset: GraspDataset,
    *,
    viewpoint: Viewpoint = DEFAULT_VIEWPOINT,
    grid: InputGrid | None = None,
    on_attempt: Callable[[], None] | None = None,
) -> GraspInputs:
    """Inputs of all labelled attempts that are not excluded, from the cache or made now.

    Args:
        dataset: The version to read.
        viewpoint: Which picture to warp to the pre-grasp pose: ``overhead`` is in every collection,
            ``pregrasp`` was taken there, where it was asked for.
        grid: Crop and size of the inputs, and how much of the table they show; unless given that is what the first
            session shows.
        on_attempt: Called for every input made, not for those found in the cache.

    Raises:
        NoTrainingDataError: No attempt of this version has a label and the picture asked for.
        CorruptDataError: A picture is damaged, or a pre-grasp pose is not finite; the message names the attempt.
        VersionRemovedError: The version was expired and collected meanwhile.
        StorageError: Nothing can be written beside the dataset, where inputs are kept.
    """
    rows = usable_attempts(dataset, viewpoint)
    grid = _at_one_scale(dataset, grid or InputGrid())
    holds = _cache_key(dataset, viewpoint, grid)
    path = dataset.repository.side_folder / "inputs" / f"{hashlib.sha256(holds.encode()).hexdigest()[:32]}.npy"
    shape = (len(rows), 4, grid.size_px, grid.size_px)
    inputs = open_cache(path, holds=holds, shape=shape, dtype=np.float16)
    if inputs is None:
        if (fault := folder_fault(path.parent)) is not None:
            raise StorageError(
                f"the inputs would be kept in {path.parent}: {fault}; read a copy of the dataset elsewhere"
            )
        path.parent.mkdir(parents=True, exist_ok=True)
        fill = partial(_fill, dataset=dataset, rows=rows, viewpoint=viewpoint, grid=grid, on_attempt=on_attempt)
        with being_read(dataset.repository, dataset.snapshot_id, f"make inputs from the {viewpoint} viewpoint"):
            write_cache(path, holds=holds, shape=shape, dtype=np.float16, fill=fill)
        inputs = np.load(path, mmap_mode="r")
    return GraspInputs(inputs=inputs, attempts=rows)


def usable_attempts(dataset: GraspDataset, viewpoint: Viewpoint) -> pd.DataFrame:
    """The rows of the attempts table that inputs can be made of, without making any.

    Raises:
        NoTrainingDataError: No attempt of this version has a label and the picture asked for.
    """
    rows = dataset.attempts
    rows = rows[trainable(rows) & rows[f"{viewpoint}_taken"]]
    if rows.empty:
        raise NoTrainingDataError(
            f"{dataset.repository.path}@{dataset.ref} has no labelled attempt with a {viewpoint} picture that is not "
            "excluded, expected some: collect more, or restore some"
        )
    return rows


def _at_one_scale(dataset: GraspDataset, grid: InputGrid) -> InputGrid:
    """The grid with a span just where that changes something.

    Stations look at the table from different heights. Where they do, or the network learnt from another height than
    this dataset has, every input shows as much of the table as those of the network, or else of the first station.
    """
    told = (input_span_m(session.header.station, grid) for session in dataset.sessions)
    spans_m = [one_m for one_m in told if one_m is not None]
    span_m = grid.span_m or (spans_m[0] if spans_m else None)
    differ = span_m is not None and any(abs(one_m / span_m - 1) > SAME_SCALE for one_m in spans_m)
    return replace(grid, span_m=span_m if differ else None)


def _cache_key(dataset: GraspDataset, viewpoint: Viewpoint, grid: InputGrid) -> str:
    key = {"snapshot": dataset.snapshot_id, "view": viewpoint, "grid": grid.to_json(), "version": CACHE_VERSION}
    return json.dumps(key, sort_keys=True)


def _fill(
    inputs: NDArray[np.float16],
    *,
    dataset: GraspDataset,
    rows: pd.DataFrame,
    viewpoint: Viewpoint,
    grid: InputGrid,
    on_attempt: Callable[[], None] | None,
) -> None:
    for row, made in enumerate(_warped(dataset, rows, viewpoint, grid)):
        inputs[row] = made
        if on_attempt is not None:
            on_attempt()


def _warped(
    dataset: GraspDataset, rows: pd.DataFrame, viewpoint: Viewpoint, grid: InputGrid
) -> Iterator[NDArray[np.float32]]:
    """The inputs in the order of the rows. One thread reads, the others warp; a few pictures are in memory."""
    poses = zip(rows["pregrasp_x_m"], rows["pregrasp_y_m"], rows["pregrasp_angle_rad"], strict=True)
    pictures = dataset.frames(viewpoint, rows.index)
    waiting: deque[Future[NDArray[np.float32]]] = deque()
    # Threads, not processes: decoding and warping release the interpreter, and Icechunk must not be forked.
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for (attempt, frame), pose in zip(pictures, poses, strict=True):
            if not np.isfinite(pose).all():
                # Warped to nowhere, the input would be NaN, and so would every weight after one step.
                raise impossible(*parse_attempt_id(attempt), "pregrasp_x_y_angle", pose, "finite numbers")
            x_m, y_m, angle_rad = pose
            goal = PlanarPose(x_m=x_m, y_m=y_m, angle_rad=angle_rad)
            waiting.append(pool.submit(grasp_input, frame, dataset.station(attempt), goal, grid))
            if len(waiting) == _PICTURES_AHEAD:
                yield waiting.popleft().result()
        yield from (one.result() for one in waiting)


def grasp_input(frame: RgbdFrame, station: StationSpec, goal: PlanarPose, grid: InputGrid) -> NDArray[np.float32]:
    """The network input for a grasp at ``goal``, predicted from a picture taken elsewhere. Shape (4, size, size)."""
    taken_at = PlanarPose.from_pose_base_tool(frame.pose_base_tool)
    step = taken_at.step_to(goal)
    prepared = PreparedView.from_view(station_view(frame, station), pixels_per_cell=grid.pixels_per_cell)
    steps = torch.tensor([[step.dx_m, step.dy_m, step.dangle_rad]], dtype=torch.float32)
    drop_m = float(frame.pose_base_tool[2, 3]) - station.pregrasp_height_m
    inputs = predict_inputs(prepared, steps, grid=grid, view_plane_m=prepared.plane_m - drop_m)
    return inputs[0].numpy()
