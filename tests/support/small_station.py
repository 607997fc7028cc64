"""A station with a small camera, for attempts that are made up."""

from __future__ import annotations

from handsight.datasets import SessionHeader, StationSpec
from handsight.servoing.camera import HandCamera, Intrinsics


def small_header(*, source: str, seed: int | None) -> SessionHeader:
    """A session without objects, with pictures of 64x48."""
    camera = HandCamera(
        intrinsics=Intrinsics.from_vertical_fov(width=64, height=48, fov_y_rad=0.73),
        x_tool_camera_m=0.0,
        y_tool_camera_m=0.0,
        z_tool_camera_m=-0.1,
    )
    station = StationSpec(
        source=source, camera=camera, depth_scale_m=0.001, gripper_stroke_m=0.085, closed_width_m=0.002
    )
    return SessionHeader(station=station, seed=seed, objects_per_scene=0, config={})
