"""The picture on a card: a thumbnail with the grasp that was attempted drawn in."""

from __future__ import annotations

from pathlib import Path

import cv2
import rerun as rr
import rerun.blueprint as rrb

from handsight.datasets.records import GraspAttempt, RgbdFrame, StationSpec
from handsight.datasets.views import station_view
from handsight.viz.errors import RecordingError
from handsight.viz.pixels import PictureFrame
from handsight.viz.recordings.attempt import attempted_step, label_colour
from handsight.viz.recordings.encoding import jpeg
from handsight.viz.recordings.glyphs import log_jaws
from handsight.viz.recordings.layouts import BACKGROUND, picture_bounds
from handsight.viz.recordings.recording import write_recording

KIND = "handsight_card"
WIDTH_PX = 320
"""Of a thumbnail: what a card takes on a screen."""
ORIGIN = "/picture"


def write_card(path: Path, name: str, attempt: GraspAttempt, station: StationSpec, *, success: bool | None) -> None:
    """Write the recording that a card shows.

    Args:
        path: The ``.rrd``.
        name: Its recording id.
        attempt: As it was recorded.
        station: What recorded it.
        success: The label that counts; None where there is none.

    Raises:
        RecordingError: The attempt took no picture, or ``path`` cannot be written.
    """
    frame = attempt.overhead
    if frame is None:
        raise RecordingError(f"{name} has no picture to show ({attempt.failure}), expected an overhead one")
    with write_recording(path, kind=KIND, name=name, blueprint=None) as stream:
        _log_thumbnail(stream, frame)
        step = attempted_step(attempt, frame)
        if step is not None:
            view = station_view(frame, station)
            picture = PictureFrame(camera=view.camera, plane_m=view.plane_m)
            colour = label_colour(success)
            log_jaws(
                stream, "picture/jaws", picture, step, width_m=station.gripper_stroke_m, colour=colour, static=True
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
