"""A dataset of a million attempts without pictures, to see that what a person types answers at once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import zarr
from numpy.typing import NDArray
from ulid import ULID

from handsight.datasets import GraspRepository, Outcome, SessionHeader, StationSpec
from handsight.datasets.format.arrays import append_rows, array_at, group_at
from handsight.datasets.format.schema import (
    COLUMNS,
    PACKED_CHUNK_ROWS,
    SESSIONS,
    VIEWPOINTS,
    ColumnWidths,
    create_arrays,
)
from handsight.datasets.format.sessions import new_session_attributes, sealed_attributes
from handsight.servoing.camera import HandCamera, Intrinsics

OBJECTS = tuple(f"object-{number:03d}" for number in range(100))
_WIDTH = 5


def header_of(seed: int, *, width: int = 640, height: int = 480) -> SessionHeader:
    """A simulated session's header, with a camera of the size asked for."""
    camera = HandCamera(
        intrinsics=Intrinsics.from_vertical_fov(width=width, height=height, fov_y_rad=0.73),
        x_tool_camera_m=0.0,
        y_tool_camera_m=-0.07,
        z_tool_camera_m=-0.11,
    )
    station = StationSpec(
        source="sim",
        camera=camera,
        depth_scale_m=1e-3,
        gripper_stroke_m=0.085,
        closed_width_m=0.002,
        objects=OBJECTS,
    )
    return SessionHeader(station=station, seed=seed, objects_per_scene=_WIDTH, config={})


def write_million(path: Path, *, sessions: int = 20, attempts: int = 50_000) -> GraspRepository:
    """Write sealed sessions of random attempts, one commit for each.

    The writer would take hours: it checks and digests one attempt at a time. What is here goes round it, so the
    digests are random and no picture was ever taken.
    """
    repository = GraspRepository.create(path)
    for seed in range(sessions):
        rng = np.random.default_rng(seed)
        header = header_of(seed)
        change = repository.writable("main")
        root = zarr.open_group(change.store, mode="r+")
        attributes = new_session_attributes(header) | sealed_attributes()
        group = group_at(root, SESSIONS).create_group(str(ULID()), attributes=attributes)
        create_arrays(group, header, column_rows=PACKED_CHUNK_ROWS)
        for name, values in _columns(attempts, rng).items():
            append_rows(array_at(group, f"attempts/{name}"), values)
        for viewpoint in VIEWPOINTS:
            for name in ("rgb", "depth", "pose_base_tool"):
                array = array_at(group, f"{viewpoint}/{name}")
                array.resize((attempts, *array.shape[1:]))
        repository.commit(
            change, branch="main", message=f"record session {seed}", metadata={"attempts_added": attempts}
        )
    return repository


def _columns(size: int, rng: np.random.Generator) -> dict[str, NDArray[np.generic]]:
    outcome = (rng.random(size) < 0.2).astype(np.uint8) * np.uint8(Outcome.HELD)
    widths = ColumnWidths(objects=_WIDTH, conditions=1)
    values: dict[str, NDArray[np.generic]] = {
        column.name: np.full((size, *column.shape(widths)), column.fill, dtype=column.dtype) for column in COLUMNS
    }
    return values | {
        "number": np.arange(size),
        "outcome": outcome,
        "pregrasp_x_y_angle": rng.normal(size=(size, 3)),
        "contact_force_n": rng.normal(size=size),
        "gripper_width_m": rng.uniform(0, 0.085, (size, 4)),
        "object_count": np.full(size, _WIDTH, np.int16),
        "target": rng.integers(0, _WIDTH, size, dtype=np.int16),
        "catalogue_index": rng.integers(0, len(OBJECTS), (size, _WIDTH), dtype=np.int16),
        "started_elapsed_ns": rng.integers(0, 2**40, (size, 2)),
        "digest": rng.integers(0, 256, (size, 32), dtype=np.uint8),
    }
