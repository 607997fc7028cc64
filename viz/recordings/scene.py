"""What does not move in a servo trace: the table and what the overhead picture saw on it.

A station knows no shapes, only pictures, so the objects are drawn as the overhead camera measured them: a height
field in their own colours. Where a simulator recorded the settled poses, a pin marks each object; hovering over the
pin names it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from handsight.datasets.records import RgbdFrame, SceneObjects, StationSpec
from handsight.viz import palette
from handsight.viz.pixels import CENTRE_PX
from handsight.viz.recordings.layouts import CAMERA

TABLE_SIDE_M = 0.64
TABLE_THICKNESS_M = 0.02
OBJECT_HEIGHT_M = 0.006
"""Surface higher than this belongs to an object; below it is table and noise."""
STRIDE_PX = 2
"""Every how many pixels of the overhead picture the height field has a vertex."""
POINT_STRIDE_PX = 4
"""The same of a cloud of points: a recording that holds a picture twice would be twice as large."""
POINT_RADIUS_M = 0.0016
ON_TABLE = np.array([1, 1, 0], dtype=np.float32)
"""Drops a point to the table top."""
WALL_SHADE = 0.6
"""Brightness of the foot of a wall against its upper edge: the viewer lights no vertex colours."""
IMAGE_PLANE_M = 0.16
"""Distance from the camera at which the scene shows its picture."""
PIN_TOP_M = 0.07
PIN_RADIUS_M = 0.0008


@dataclass(frozen=True, slots=True, kw_only=True)
class HeightField:
    """The surface that a camera saw, in the base frame."""

    points_m: NDArray[np.float32]
    """Shape (R, C, 3)."""
    rgb: NDArray[np.uint8]
    """Shape (R, C, 3)."""
    valid: NDArray[np.bool_]
    """Where depth was measured. Shape (R, C)."""


def back_project(frame: RgbdFrame, spec: StationSpec, *, stride_px: int = STRIDE_PX) -> HeightField:
    """Lift every ``stride_px``-th pixel of a picture into the base frame."""
    k = spec.camera.intrinsics
    depth = frame.depth[::stride_px, ::stride_px]
    depth_m = depth.astype(np.float64) * spec.depth_scale_m
    row, column = np.mgrid[0 : k.height : stride_px, 0 : k.width : stride_px]
    rays = np.stack([(column - k.cx) / k.fx, (row - k.cy) / k.fy, np.ones(row.shape)], axis=-1)  # (R, C, 3)
    pose = spec.camera.pose_base_camera(frame.pose_base_tool)
    points_m = (rays * depth_m[..., None]) @ pose[:3, :3].T + pose[:3, 3]
    return HeightField(points_m=points_m.astype(np.float32), rgb=frame.rgb[::stride_px, ::stride_px], valid=depth > 0)


def objects_mesh(field: HeightField) -> rr.Mesh3D | None:
    """The raised parts of a height field, with walls down to the table; None when the table is bare."""
    raised = field.valid & (field.points_m[..., 2] > OBJECT_HEIGHT_M)
    points_m, rgb, solid = _with_walls(field, raised)
    corner = np.arange(raised.size).reshape(raised.shape)
    cells = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]], axis=-1)  # (R-1, C-1, 4)
    kept = solid.ravel()[cells].all(-1) & raised.ravel()[cells].any(-1)
    if not kept.any():
        return None
    quads = cells[kept]  # (Q, 4)
    used, index = np.unique(quads, return_inverse=True)
    index = index.reshape(quads.shape).astype(np.uint32)
    return rr.Mesh3D(
        vertex_positions=points_m.reshape(-1, 3)[used],
        vertex_colors=rgb.reshape(-1, 3)[used],
        triangle_indices=np.concatenate([index[:, [0, 1, 2]], index[:, [0, 2, 3]]]),
    )


def _with_walls(
    field: HeightField, raised: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.uint8], NDArray[np.bool_]]:
    """Points, colours and which of them count, with a foot on the table under every edge of an object.

    The camera sees no walls. Joined to the table point that it saw next to an edge, a wall would lean outwards and
    fade into the table's colour.
    """
    points_m, rgb, solid = field.points_m.copy(), field.rgb.copy(), raised.copy()
    for axis, shift in product((0, 1), (1, -1)):
        foot = np.roll(solid, shift, axis) & ~solid
        edge = slice(0, 1) if shift == 1 else slice(-1, None)
        foot[(edge, slice(None)) if axis == 0 else (slice(None), edge)] = False  # What np.roll wrapped around.
        points_m[foot] = np.roll(points_m, shift, axis)[foot] * ON_TABLE
        rgb[foot] = (WALL_SHADE * np.roll(rgb, shift, axis)[foot]).astype(np.uint8)
        solid |= foot
    return points_m, rgb, solid


def table_colour(field: HeightField) -> palette.Rgb:
    """Median colour of what lies at table height; grey where no table is seen."""
    table = field.valid & (np.abs(field.points_m[..., 2]) <= OBJECT_HEIGHT_M)
    if not table.any():
        return palette.STEEL
    red, green, blue = np.median(field.rgb[table], axis=0).astype(int).tolist()
    return red, green, blue


def log_scene(
    recording: rr.RecordingStream,
    overhead: RgbdFrame,
    spec: StationSpec,
    scene: SceneObjects | None,
    *,
    points: bool = False,
) -> None:
    """Log table and objects, for all time.

    Args:
        recording: Where to.
        overhead: The picture that saw them.
        spec: Of the station that took it.
        scene: Where the objects came to rest, where that is known.
        points: Whether what was measured is drawn as it is, point by point, instead of as surfaces with walls.
    """
    field = back_project(overhead, spec, stride_px=POINT_STRIDE_PX if points else STRIDE_PX)
    x_m, y_m = overhead.pose_base_tool[:2, 3]
    recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    recording.log(
        "world/table",
        rr.Boxes3D(
            centers=[[x_m, y_m, -0.5 * TABLE_THICKNESS_M]],
            sizes=[[TABLE_SIDE_M, TABLE_SIDE_M, TABLE_THICKNESS_M]],
            colors=[table_colour(field)],
            fill_mode="solid",
        ),
        static=True,
    )
    if points:
        cloud = rr.Points3D(field.points_m[field.valid], colors=field.rgb[field.valid], radii=[POINT_RADIUS_M])
        recording.log("world/objects/seen", cloud, static=True)
    elif (mesh := objects_mesh(field)) is not None:
        recording.log("world/objects/seen", mesh, static=True)
    if scene is not None:
        _log_pins(recording, spec, scene)


def log_hand_camera(recording: rr.RecordingStream, spec: StationSpec) -> None:
    """Log where the camera sits on the tool and how it projects, for all time."""
    camera, k = spec.camera, spec.camera.intrinsics
    offset_m = (camera.x_tool_camera_m, camera.y_tool_camera_m, camera.z_tool_camera_m)
    recording.log(CAMERA, rr.Transform3D(translation=offset_m), static=True)
    recording.log(
        CAMERA,
        rr.Pinhole(
            resolution=(k.width, k.height),
            focal_length=(k.fx, k.fy),
            principal_point=(k.cx + CENTRE_PX, k.cy + CENTRE_PX),
            image_plane_distance=IMAGE_PLANE_M,
            color=palette.CHOSEN,
            line_width=0.0015,
        ),
        static=True,
    )


def _log_pins(recording: rr.RecordingStream, spec: StationSpec, scene: SceneObjects) -> None:
    centres_m = scene.pose_base_object[:, :3]
    tops_m = np.column_stack([centres_m[:, :2], np.full(len(centres_m), PIN_TOP_M)])
    recording.log(
        "world/objects/pins",
        rr.LineStrips3D(np.stack([centres_m, tops_m], axis=1), colors=[palette.HERE], radii=[PIN_RADIUS_M]),
        static=True,
    )
    recording.log(
        "world/objects/poses",
        rr.Points3D(
            tops_m,
            colors=[palette.HERE],
            radii=[3 * PIN_RADIUS_M],
            labels=[spec.objects[index] for index in scene.catalogue_index.tolist()],
            show_labels=False,
        ),
        static=True,
    )
