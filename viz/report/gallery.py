"""Pictures of what failed: attempts of a dataset with the grasp drawn in."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.datasets.errors import CorruptDataError, counted
from handsight.datasets.reading.attempt_ids import short_id
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.reading.stats import LabelStats
from handsight.datasets.records import GraspAttempt, RgbdFrame, StationSpec
from handsight.datasets.views import station_view
from handsight.servoing.planar import PlanarPose
from handsight.viz import palette
from handsight.viz.pixels import CENTRE_PX, PictureFrame, Step, jaw_strips
from handsight.viz.report.content import Figure, Gallery
from handsight.viz.report.embedding import embedded_rgb
from handsight.viz.report.words import percent

MOST_PICTURES = 12
WIDTH_PX = 400
_LOOKED_AT = 4 * MOST_PICTURES
"""Attempts that are looked at for pictures, of which some may have none."""


def failed_attempts(dataset: GraspDataset, stats: LabelStats, name: str) -> Gallery | None:
    """One failed attempt of each object, the objects that fail most often first; None where none took a picture.

    Args:
        dataset: The version.
        stats: Its labels.
        name: How it is named in a command.
    """
    pictures: list[Figure] = []
    shown: list[str] = []
    shortened = short_id(dataset)
    for attempt in _chosen(dataset, stats)[:_LOOKED_AT]:
        if len(pictures) == MOST_PICTURES:
            break
        if (picture := _picture(dataset, attempt, stats, name)) is not None:
            pictures.append(picture)
            shown.append(shortened(attempt))
    if not pictures:
        return None
    return Gallery(
        text=(
            f"{counted(len(pictures), 'attempt')} that failed, the latest at each object, the objects that fail most "
            "often first; where the grasp lies outside the picture, it is left out. The mark is the pair of open jaws "
            "where the grasp was tried."
        ),
        pictures=tuple(pictures),
        command=f"handsight view dataset {name} {' '.join(shown)} --picture failed.png",
    )


def _chosen(dataset: GraspDataset, stats: LabelStats) -> list[str]:
    table = dataset.table("success", "excluded", "target", "overhead_taken")
    failed = table[(table["success"] == False).fillna(False) & ~table["excluded"] & table["overhead_taken"]]  # noqa: E712
    latest = failed.groupby("target", dropna=False).tail(1)
    rates = {share.name: share.rate for share in stats.objects}
    order = sorted(latest.index, key=lambda key: (rates.get(str(latest["target"][key]), 1.0), str(key)))
    seen = set(order)
    return [*map(str, order), *(str(key) for key in reversed(failed.index) if key not in seen)]


def _picture(dataset: GraspDataset, attempt: str, stats: LabelStats, name: str) -> Figure | None:
    try:
        recorded, station = dataset.attempt(attempt), dataset.station(attempt)
    except CorruptDataError:
        return None  # The doctor names it; the others can still be seen.
    frame = recorded.overhead
    if frame is None or (marked := attempted_picture(recorded, frame, station)) is None:
        return None
    target = str(dataset.rows([attempt], ["target"])["target"].iloc[0])
    share = next((one for one in stats.objects if one.name == target), None)
    often = "" if share is None else f", held in {percent(share.rate)} of {counted(share.attempts, 'attempt')}"
    what = "an unknown object" if share is None else target
    reading_mm = 1e3 * recorded.gripper.final_m
    ended = f"final opening {reading_mm:.1f} mm" if np.isfinite(reading_mm) else "no final opening was read"
    return Figure(
        picture=embedded_rgb(marked, width_px=WIDTH_PX),
        alt=f"Overhead picture of a failed attempt at {what}, the open jaws drawn in.",
        caption=f"{attempt}: {what}{often}; {recorded.failure or ended}.",
        command=f"handsight dataset show {name} {attempt} --picture attempt.png",
    )


def attempted_picture(attempt: GraspAttempt, frame: RgbdFrame, station: StationSpec) -> NDArray[np.uint8] | None:
    """A picture with the open jaws where the grasp was tried, (H, W, 3); None where that is not in the picture."""
    goal = PlanarPose(x_m=attempt.pregrasp_x_m, y_m=attempt.pregrasp_y_m, angle_rad=attempt.pregrasp_angle_rad)
    if not np.isfinite([goal.x_m, goal.y_m, goal.angle_rad]).all():
        return None
    step = PlanarPose.from_pose_base_tool(frame.pose_base_tool).step_to(goal)
    view = station_view(frame, station)
    picture = PictureFrame(camera=view.camera, plane_m=view.plane_m)
    drawn = (step.dx_m, step.dy_m, step.dangle_rad)
    return marked_picture(
        frame.rgb, picture, drawn, width_m=station.gripper_stroke_m, colour=palette.EMPTY, dashed=True
    )


def marked_picture(
    rgb: NDArray[np.uint8],
    frame: PictureFrame,
    step: Step,
    *,
    width_m: float,
    colour: palette.Rgb,
    dashed: bool = False,
) -> NDArray[np.uint8]:
    """A picture with open jaws after a step (dx [m], dy [m], dangle [rad]). (H, W, 3) -> (H, W, 3)."""
    marked = np.ascontiguousarray(rgb).copy()
    thick = max(2, round(rgb.shape[1] / 130))
    strips = [np.rint(strip - CENTRE_PX).astype(np.int32) for strip in jaw_strips(frame, step, width_m, dashed=dashed)]
    for ink, more in ((palette.OUTLINE, max(2, thick // 2)), (colour, 0)):
        for number, strip in enumerate(strips):
            wide = (thick if number < 2 else max(1, thick // 2)) + more
            cv2.polylines(marked, [strip], isClosed=False, color=ink, thickness=wide, lineType=cv2.LINE_AA)
    return marked
