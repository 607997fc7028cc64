"""Attempts as rows of columns, and back. Both directions keep every bit but the payload of a NaN."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handsight.datasets.errors import RecordError
from handsight.datasets.format.schema import COLUMNS, FAILURE_BYTES, VIEWPOINTS, ColumnWidths, Viewpoint
from handsight.datasets.records import (
    GraspAttempt,
    GripperReadings,
    Outcome,
    RgbdFrame,
    SceneObjects,
)

Row = dict[str, NDArray[Any]]
"""One value for each column; shapes as in the schema."""


def to_row(attempt: GraspAttempt, *, widths: ColumnWidths) -> Row:
    """The columns of an attempt except ``digest``, in fresh memory, as wide as ``widths`` says."""
    values: dict[str, Any] = {
        "number": attempt.number,
        "outcome": int(attempt.outcome),
        "failure": text_to_bytes(attempt.failure, FAILURE_BYTES),
        "picture_taken": [frame_of(attempt, viewpoint) is not None for viewpoint in VIEWPOINTS],
        "pregrasp_x_y_angle": (attempt.pregrasp_x_m, attempt.pregrasp_y_m, attempt.pregrasp_angle_rad),
        "predicted_success": attempt.predicted_success,
        "pose_base_tool_grasp": attempt.pose_base_tool_grasp,
        "contact_force_n": attempt.contact_force_n,
        "gripper_width_m": (
            attempt.gripper.before_m,
            attempt.gripper.closed_m,
            attempt.gripper.lifted_m,
            attempt.gripper.final_m,
        ),
        "truth_held": -1 if attempt.truth_held is None else int(attempt.truth_held),
        "phase_s": attempt.phase_s,
        "started_elapsed_ns": (attempt.started_ns, attempt.elapsed_ns),
        **_scene_values(attempt.scene),
    }
    row: Row = {}
    for column in COLUMNS:
        cell = np.full(column.shape(widths), column.fill, dtype=column.dtype)
        if column.name in values:
            value = np.asarray(values[column.name], dtype=column.dtype)
            cell[tuple(slice(size) for size in value.shape)] = value
            row[column.name] = cell
    return row


def from_row(row: Mapping[str, NDArray[Any]], frames: Mapping[Viewpoint, RgbdFrame | None]) -> GraspAttempt:
    """The attempt that ``to_row`` was given, from its columns and pictures.

    Raises:
        RecordError: Nobody wrote such a row with handsight.
    """
    try:
        outcome, failure = Outcome(int(row["outcome"])), text_from_bytes(row["failure"])
    except ValueError as error:
        raise RecordError(f"row {int(row['number'])} makes no attempt: {error}") from error
    x_m, y_m, angle_rad = (float(value) for value in row["pregrasp_x_y_angle"])
    before_m, closed_m, lifted_m, final_m = (float(value) for value in row["gripper_width_m"])
    started_ns, elapsed_ns = (int(value) for value in row["started_elapsed_ns"])
    truth = int(row["truth_held"])
    return GraspAttempt(
        number=int(row["number"]),
        outcome=outcome,
        failure=failure,
        overhead=frames["overhead"],
        pregrasp=frames["pregrasp"],
        pregrasp_x_m=x_m,
        pregrasp_y_m=y_m,
        pregrasp_angle_rad=angle_rad,
        predicted_success=float(row["predicted_success"]),
        pose_base_tool_grasp=np.array(row["pose_base_tool_grasp"]),
        contact_force_n=float(row["contact_force_n"]),
        gripper=GripperReadings(before_m=before_m, closed_m=closed_m, lifted_m=lifted_m, final_m=final_m),
        scene=_scene(row),
        truth_held=None if truth < 0 else bool(truth),
        phase_s=np.array(row["phase_s"]),
        started_ns=started_ns,
        elapsed_ns=elapsed_ns,
    )


def text_from_bytes(padded: NDArray[np.uint8]) -> str:
    """The text that ``text_to_bytes`` was given, such as the failure of a row. ``padded`` has shape (size,)."""
    return padded.tobytes().rstrip(b"\0").decode()


def text_to_bytes(text: str, size: int) -> NDArray[np.uint8]:
    """UTF-8, padded with zeros to ``size``, within which the text must fit. Shape (size,)."""
    return np.frombuffer(text.encode().ljust(size, b"\0"), dtype=np.uint8)


def _scene_values(scene: SceneObjects | None) -> dict[str, Any]:
    if scene is None:
        nothing = {"catalogue_index": [], "pose_base_object": np.empty((0, 7)), "conditions": []}
        return {"object_count": -1, "target": -1, **nothing}
    return {
        "object_count": len(scene.catalogue_index),
        "target": scene.target,
        "catalogue_index": scene.catalogue_index,
        "pose_base_object": scene.pose_base_object,
        "conditions": scene.conditions,
    }


def _scene(row: Mapping[str, NDArray[Any]]) -> SceneObjects | None:
    count = int(row["object_count"])
    if count < 0:
        return None
    return SceneObjects(
        catalogue_index=np.array(row["catalogue_index"][:count]),
        pose_base_object=np.array(row["pose_base_object"][:count]),
        target=int(row["target"]),
        # Values are finite; a session without conditions has one place that holds NaN.
        conditions=row["conditions"][~np.isnan(row["conditions"])],
    )


def frame_of(attempt: GraspAttempt, viewpoint: Viewpoint) -> RgbdFrame | None:
    """The picture an attempt took from a viewpoint; None where it never did."""
    return attempt.overhead if viewpoint == "overhead" else attempt.pregrasp
