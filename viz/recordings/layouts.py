"""How the viewer lays out a servo trace: the scene, what the camera saw, and how the scores went.

Every range is fixed when the file is written. The viewer would otherwise fit axes, colours and eye to the step that
happens to be shown, and two steps could not be compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from handsight.datasets.records import RgbdFrame, StationSpec
from handsight.viz.recordings.recording import paused_layout
from handsight.viz.recordings.scales import HEIGHT_PX

TIMELINE = "servo_step"

CAMERA = "/world/tool/camera"
OUTSIDE = "/scene/rgb"
BACKGROUND = (18, 20, 24)
EYE_OFFSET_M = (0.54, -0.70, 0.50)
"""From the middle of the scene to the eye: in front of the robot and to its right, looking down at 30 degrees."""
ARM_EYE = 1.45
"""So much farther the eye is where an arm has to fit in."""
EYE_HEIGHT = 0.75
"""Share of the pre-grasp height at which the eye of a trace looks."""
INPUTS = (("Input · colour", "input/rgb"), ("Input · height", "input/height"))


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceRanges:
    """Everything whose range the viewer must not choose."""

    last_step: int
    step_mm: float
    """Half-range of the plot of chosen steps [mm]."""
    turn_deg: float
    """Half-range of the plot of chosen turns [degrees]."""
    time_ms: float
    """Range of the plot of times [ms]."""
    slope: float | None
    """Half-range of the plot of gradients; None for methods that have none."""
    width_px: int
    height_px: int
    input_px: int
    scene_centre_m: tuple[float, float, float]
    outside_px: tuple[int, int] | None = None
    """Width and height of the pictures from outside; None where there are none."""

    @classmethod
    def of(
        cls, station: StationSpec, overhead: RgbdFrame, *, middle_m: tuple[float, float], **ranges: Any
    ) -> TraceRanges:
        """Ranges over a station; the eye looks between where servoing happens and where the overhead picture was taken.

        Args:
            station: The station.
            overhead: The overhead picture.
            middle_m: Middle of the servo run, (x, y) in the base frame [m].
            ranges: The other fields.
        """
        k = station.camera.intrinsics
        overhead_x_m, overhead_y_m = overhead.pose_base_tool[:2, 3].tolist()
        centre_m = (
            0.5 * (middle_m[0] + overhead_x_m),
            0.5 * (middle_m[1] + overhead_y_m),
            EYE_HEIGHT * station.pregrasp_height_m,
        )
        return cls(width_px=k.width, height_px=k.height, scene_centre_m=centre_m, **ranges)


def trace_blueprint(ranges: TraceRanges, *, following: bool = False) -> rrb.Blueprint:
    """Scene, pictures and network inputs above; plots and text below.

    Args:
        ranges: What is shown.
        following: Whether the viewer follows the newest step, as while servoing, or stands at the first.
    """
    return paused_layout(
        rrb.Vertical(
            rrb.Horizontal(
                _scene_views(ranges),
                _picture_view(ranges),
                rrb.Vertical(
                    rrb.Horizontal(_depth_view(ranges), _now_view(ranges)),
                    rrb.Horizontal(*_next_views(ranges.input_px)),
                    row_shares=[0.5, 0.5],
                ),
                column_shares=[0.34, 0.33, 0.33],
            ),
            rrb.Horizontal(*_plots(ranges), _texts(), column_shares=[0.21, 0.19, 0.15, 0.15, 0.30]),
            row_shares=[0.64, 0.36],
        ),
        timeline=TIMELINE,
        fps=2.0,
        following=following,
    )


def _scene_views(ranges: TraceRanges) -> rrb.Spatial3DView | rrb.Vertical:
    """The scene as measured and, where there are pictures of it, as seen from outside."""
    if ranges.outside_px is None:
        return _scene_view(ranges)
    return rrb.Vertical(_scene_view(ranges), _outside_view(*ranges.outside_px))


def _outside_view(width_px: int, height_px: int) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        name="Scene camera",
        origin=OUTSIDE,
        background=BACKGROUND,
        visual_bounds=picture_bounds(width_px, height_px),
    )


def _scene_view(ranges: TraceRanges) -> rrb.Spatial3DView:
    x_m, y_m, z_m = ranges.scene_centre_m
    offset_x_m, offset_y_m, offset_z_m = EYE_OFFSET_M
    hidden = ("depth", "muted", "samples/**", "text/**", "scale", "contour/**", "gradient")
    return rrb.Spatial3DView(
        name="Scene",
        origin="/world",
        contents=["+ $origin/**", *(f"- {CAMERA}/{name}" for name in hidden)],
        background=BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(x_m + ARM_EYE * offset_x_m, y_m + ARM_EYE * offset_y_m, z_m + offset_z_m),
            look_target=(x_m, y_m, z_m),
            eye_up=(0.0, 0.0, 1.0),
        ),
    )


def _picture_view(ranges: TraceRanges) -> rrb.Tabs:
    """The picture with all that was scored and chosen, and the same in its own colours."""
    name = "S · samples · chosen step · gradient" if ranges.slope else "S · samples · chosen step"
    layers = ("rgb", "muted", "heat", "contour/**", "samples/**", "arrow", "gradient", "jaws/**", "text", "scale")

    def picture(name: str, shown: Sequence[str]) -> rrb.Spatial2DView:
        return rrb.Spatial2DView(
            name=name,
            origin=CAMERA,
            contents=["+ $origin", *(f"+ $origin/{layer}" for layer in shown)],
            background=BACKGROUND,
            visual_bounds=picture_bounds(ranges.width_px, ranges.height_px + HEIGHT_PX),
        )

    bare = [layer for layer in layers if layer not in ("muted", "heat")]
    return rrb.Tabs(picture(name, layers), picture("In colour", bare), active_tab=0)


def _depth_view(ranges: TraceRanges) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        name="Depth",
        origin=CAMERA,
        contents=["+ $origin", "+ $origin/depth", "+ $origin/jaws/**"],
        background=BACKGROUND,
        visual_bounds=picture_bounds(ranges.width_px, ranges.height_px),
    )


def _now_view(ranges: TraceRanges) -> rrb.Tabs:
    """The network's input at this step."""
    return rrb.Tabs(*_square_views(ranges.input_px, INPUTS), active_tab=0)


def _next_views(size_px: int) -> list[rrb.Spatial2DView]:
    """What the chosen step was to lead to, and what it led to."""
    return _square_views(
        size_px,
        (("Predicted", "next/predicted"), ("Observed", "next/observed"), ("Difference", "next/difference")),
    )


def picture_bounds(width_px: int, height_px: int) -> rrb.VisualBounds2D:
    """The whole picture and nothing else."""
    return rrb.VisualBounds2D(x_range=(0, width_px), y_range=(0, height_px))


def input_views(size_px: int, *, root: str = "", name: str | None = None) -> rrb.Horizontal:
    """The network's input: colour, and height above the mean plane."""
    return rrb.Horizontal(*_square_views(size_px, INPUTS, root=root), name=name)


def _square_views(size_px: int, named: Sequence[tuple[str, str]], *, root: str = "") -> list[rrb.Spatial2DView]:
    """A view for each square picture, of its title and its entity."""
    return [
        rrb.Spatial2DView(
            name=title,
            origin=f"{root}/{origin}",
            background=BACKGROUND,
            visual_bounds=picture_bounds(size_px, size_px),
        )
        for title, origin in named
    ]


def _plots(ranges: TraceRanges) -> list[rrb.TimeSeriesView | rrb.Tabs]:
    times = _plot(ranges, "Time per step [ms]", "/plots/time", (0.0, ranges.time_ms))
    slopes = _plot(ranges, "Gradient", "/plots/gradient", (-(ranges.slope or 1.0), ranges.slope or 1.0))
    return [
        _plot(ranges, "Predicted success", "/plots/score", (-0.05, 1.05)),
        _plot(ranges, "Chosen step [mm]", "/plots/step", (-ranges.step_mm, ranges.step_mm)),
        _plot(ranges, "Chosen turn [°]", "/plots/turn", (-ranges.turn_deg, ranges.turn_deg)),
        times if ranges.slope is None else rrb.Tabs(slopes, times, active_tab=0),
    ]


def _plot(ranges: TraceRanges, name: str, origin: str, range_y: tuple[float, float]) -> rrb.TimeSeriesView:
    # One step of margin: the cursor of the last step would be lost on the border.
    steps = rrb.TimeAxis(
        view_range=rr.TimeRange(
            start=rr.TimeRangeBoundary.absolute(seq=0), end=rr.TimeRangeBoundary.absolute(seq=ranges.last_step + 1)
        )
    )
    return rrb.TimeSeriesView(
        name=name,
        origin=origin,
        axis_x=steps,
        axis_y=rrb.ScalarAxis(range=range_y),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightBottom),
    )


def _texts() -> rrb.Tabs:
    return rrb.Tabs(
        rrb.TextDocumentView(name="Trial", origin="/text/trial"),
        rrb.TextDocumentView(name="Steps", origin="/text/steps"),
        active_tab=0,
    )
