"""One recorded attempt as a picture: what the camera saw, how high it was, and the grasp in both."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Final

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec

from handsight.datasets.records import GraspAttempt, RgbdFrame, StationSpec
from handsight.datasets.views import station_view
from handsight.servoing.planar import PlanarPose
from handsight.viz import palette
from handsight.viz.errors import FigureError
from handsight.viz.figures.pictures import DPI, GAP_PX, WIDTH_PX, draw_jaws, frame_picture
from handsight.viz.figures.style import STYLE, check_figure_path, save_png
from handsight.viz.pixels import PictureFrame

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage

LEFT_PX: Final = 28
"""For the names of the views."""
RIGHT_PX: Final = 74
"""For the scale of heights."""
TOP_PX: Final = 46
SCALE_PX: Final = 12
NAMES: Final = ("overhead", "pre-grasp")
UNMEASURED: Final = "#9aa1aa"


def attempt_figure(path: Path, name: str, attempt: GraspAttempt, station: StationSpec, *, success: bool | None) -> Path:
    """Draw the pictures of an attempt beside their depth, with the open jaws where the grasp was to be.

    Depth is drawn as height above the table top, so that both views have one scale; what was not measured is grey.

    Args:
        path: The ``.png`` to write.
        name: Id of the attempt.
        attempt: As it was recorded.
        station: What recorded it.
        success: Its label, curated or recorded; None where it has none.

    Returns:
        The file written, 1200 pixels wide.

    Raises:
        FigureError: The attempt took no picture, or the path cannot be written; nothing is written then.
    """
    check_figure_path(path, ".png")
    pictures = zip(NAMES, (attempt.overhead, attempt.pregrasp), strict=True)
    taken = [(view, frame) for view, frame in pictures if frame is not None]
    if not taken:
        raise FigureError(f"attempt {name} ended before it took a picture ({attempt.failure}): choose another")
    with mpl.rc_context({**STYLE, "text.parse_math": False}):
        figure, grid = _sheet(len(taken), station)
        for row, (view, frame) in enumerate(taken):
            rgb, depth = figure.add_subplot(grid[row, 0]), figure.add_subplot(grid[row, 1])
            rgb.imshow(frame.rgb, interpolation="antialiased")
            heights = _draw_heights(depth, frame, station)
            for axes in (rgb, depth):
                _draw_grasp(axes, attempt, frame, station, success=success)
                frame_picture(axes, station.camera.intrinsics)
            rgb.set_ylabel(view, fontsize=8, labelpad=5)
        _draw_scale(figure, heights)
        _write_facts(figure, name, attempt, success=success)
        return save_png(figure, path)


def _sheet(rows: int, station: StationSpec) -> tuple[Figure, GridSpec]:
    """A figure with a place for two pictures in each row, of exactly their shape."""
    k = station.camera.intrinsics
    cell_px = (WIDTH_PX - LEFT_PX - RIGHT_PX - GAP_PX) / 2
    cell_height_px = cell_px * k.height / k.width
    height_px = round(TOP_PX + rows * (cell_height_px + GAP_PX))
    grid = GridSpec(
        rows,
        2,
        left=LEFT_PX / WIDTH_PX,
        right=1 - RIGHT_PX / WIDTH_PX,
        top=1 - TOP_PX / height_px,
        bottom=GAP_PX / height_px,
        wspace=GAP_PX / cell_px,
        hspace=GAP_PX / cell_height_px,
    )
    return Figure(figsize=(WIDTH_PX / DPI, height_px / DPI), dpi=DPI, facecolor="white"), grid


def _table_m(frame: RgbdFrame, station: StationSpec) -> float:
    """Distance of the table top from the camera [m]."""
    return float(frame.pose_base_tool[2, 3]) - station.camera.z_tool_camera_m


def _draw_heights(axes: Axes, frame: RgbdFrame, station: StationSpec) -> AxesImage:
    view = station_view(frame, station)
    axes.set_facecolor(UNMEASURED)
    height_m = np.where(view.valid, _table_m(frame, station) - view.depth_m, np.nan)
    # Reversed, so that heights have the colours that depth has in the other figures.
    return axes.imshow(
        1e2 * height_m,
        cmap="viridis_r",
        vmin=-1e2 * palette.BELOW_TABLE_M,
        vmax=1e2 * palette.TALLEST_M,
        interpolation="antialiased",
    )


def _draw_grasp(
    axes: Axes, attempt: GraspAttempt, frame: RgbdFrame, station: StationSpec, *, success: bool | None
) -> None:
    """The open jaws at the pre-grasp pose, if one was chosen, in the colour of the label."""
    goal = PlanarPose(x_m=attempt.pregrasp_x_m, y_m=attempt.pregrasp_y_m, angle_rad=attempt.pregrasp_angle_rad)
    if not np.isfinite([goal.x_m, goal.y_m, goal.angle_rad]).all():
        return
    step = PlanarPose.from_pose_base_tool(frame.pose_base_tool).step_to(goal)
    draw_jaws(
        axes,
        PictureFrame(camera=station.camera, plane_m=_table_m(frame, station)),
        (step.dx_m, step.dy_m, step.dangle_rad),
        width_m=station.gripper_stroke_m,
        colour=palette.CHOSEN if success is None else palette.HELD if success else palette.EMPTY,
        dashed=success is False,
    )


def _draw_scale(figure: Figure, heights: AxesImage) -> None:
    """The colours of heights beside all rows."""
    height_px = figure.get_figheight() * DPI
    left, bottom = 1 - (RIGHT_PX - GAP_PX) / WIDTH_PX, GAP_PX / height_px
    axes = figure.add_axes((left, bottom, SCALE_PX / WIDTH_PX, 1 - TOP_PX / height_px - bottom))
    bar = figure.colorbar(heights, cax=axes, extend="both")
    bar.outline.set_visible(False)
    axes.tick_params(length=0, labelsize=7)
    axes.set_ylabel("height above the table [cm]", fontsize=7)


def _write_facts(figure: Figure, name: str, attempt: GraspAttempt, *, success: bool | None) -> None:
    height_px = figure.get_figheight() * DPI
    label = "no label" if success is None else "success" if success else "failure"
    headline = f"{name} · {attempt.outcome.name.lower()} · {label}"
    angle_deg = math.degrees(attempt.pregrasp_angle_rad)
    readings = [
        f"x {attempt.pregrasp_x_m:.3f} m, y {attempt.pregrasp_y_m:.3f} m, {angle_deg:.0f}°",
        f"contact {attempt.contact_force_n:.0f} N",
        f"final opening {1e3 * attempt.gripper.final_m:.1f} mm",
    ]
    known = [text for text in readings if "nan" not in text]
    left = LEFT_PX / WIDTH_PX
    figure.text(left, 1 - 8 / height_px, headline, va="top", fontsize=8, fontweight="bold")
    figure.text(left, 1 - 28 / height_px, " · ".join([*known, *filter(None, [attempt.failure])]), va="top", fontsize=7)
