"""The picture on a card: a thumbnail with the grasp that was attempted drawn in."""

from __future__ import annotations

from pathlib import Path

import cv2
import rerun as rr
import rerun.blueprint as rrb

from handsight.datasets.records import RgbdFrame, StationSpec
from handsight.datasets.views import station_view
from handsight.servoing.planar import PlanarPose
from handsight.viz.pixels import PictureFrame
from handsight.viz.recordings.attempt import label_colour, step_from
from handsight.viz.recordings.encoding import jpeg
from handsight.viz.recordings.glyphs import log_jaws
from handsight.viz.recordings.layouts import BACKGROUND, picture_bounds
from handsight.viz.recordings.recording import write_recording

KIND = "handsight_card"
WIDTH_PX = 320
"""Of a thumbnail: what a card takes on a screen."""
ORIGIN = "/picture"


def write_card(
    path: Path, name: str, frame: RgbdFrame, goal: PlanarPose | None, station: StationSpec, *, success: bool | None
) -> None:
    """Write the recording that a card shows.

    Args:
        path: The ``.rrd``.
        name: Its recording id.
        frame: The overhead picture.
        goal: The pre-grasp pose; None where none was chosen.
        station: What recorded it.
        success: The label that counts; None where there is none.

    Raises:
        RecordingError: ``path`` cannot be written.
    """
    with write_recording(path, kind=KIND, name=name, blueprint=None) as stream:
        _log_thumbnail(stream, frame)
        if goal is not None:
            view = station_view(frame, station)
            picture = PictureFrame(camera=view.camera, plane_m=view.plane_m)
            log_jaws(
                stream,
                "picture/jaws",
                picture,
                step_from(frame, goal),
                width_m=station.gripper_stroke_m,
                colour=label_colour(success),
                dashed=success is False,
                static=True,
            )


def card_view(station: StationSpec) -> rrb.Spatial2DView:
    """How a card shows its recording."""
    k = station.camera.intrinsics
    return rrb.Spatial2DView(
        name="Picture · attempted grasp",
        origin=ORIGIN,
        background=BACKGROUND,
        visual_bounds=picture_bounds(k.width, k.height),
    )


def _log_thumbnail(stream: rr.RecordingStream, frame: RgbdFrame) -> None:
    """The picture made small, drawn as large as it was: marks over it are in its pixels."""
    height_px, width_px = frame.rgb.shape[:2]
    scale = max(1.0, width_px / WIDTH_PX)
    size = (round(width_px / scale), round(height_px / scale))
    small = cv2.resize(frame.rgb, size, interpolation=cv2.INTER_AREA)
    stream.log("picture/rgb", jpeg(small.astype(frame.rgb.dtype)), static=True)
    factors = (width_px / size[0], height_px / size[1], 1.0)
    stream.log("picture/rgb", rr.Transform3D(scale=factors), static=True)
