"""How the viewer lays out a servo trace: the scene, what the camera saw, and how the scores went.

Every range is fixed when the file is written. The viewer would otherwise fit axes, colours and eye to the step that
happens to be shown, and two steps could not be compared.
"""

from __future__ import annotations

from dataclasses import dataclass

import rerun as rr
import rerun.blueprint as rrb

from handsight.viz.recordings.recording import paused_layout

TIMELINE = "servo_step"

CAMERA = "/world/tool/camera"
OUTSIDE = "/scene/rgb"
BACKGROUND = (18, 20, 24)
EYE_OFFSET_M = (0.54, -0.70, 0.50)
"""From the middle of the scene to the eye: in front of the robot and to its right, looking down at 30 degrees."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceRanges:
    """Everything whose range the viewer must not choose."""

    last_step: int
    step_mm_deg: float
    """Half-range of the plot of chosen steps [mm and degrees]."""
    width_px: int
    height_px: int
    input_px: int
    scene_centre_m: tuple[float, float, float]
    outside_px: tuple[int, int] | None = None
    """Width and height of the pictures from outside; None where there are none."""


def trace_blueprint(ranges: TraceRanges) -> rrb.Blueprint:
    """Scene, pictures and network input above; plots and text below."""
    return paused_layout(
        rrb.Vertical(
            rrb.Horizontal(
                _scene_views(ranges),
                _picture_view(ranges),
                rrb.Vertical(_depth_view(ranges), input_views(ranges.input_px), row_shares=[0.55, 0.45]),
                column_shares=[0.36, 0.40, 0.24],
            ),
            rrb.Horizontal(*_plots(ranges), _texts(), column_shares=[0.36, 0.36, 0.28]),
            row_shares=[0.64, 0.36],
        ),
        timeline=TIMELINE,
        fps=2.0,
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
    return rrb.Spatial3DView(
        name="Scene",
        origin="/world",
        contents=["+ $origin/**", f"- {CAMERA}/depth", f"- {CAMERA}/samples/**", f"- {CAMERA}/text/**"],
        background=BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(x_m + offset_x_m, y_m + offset_y_m, z_m + offset_z_m),
            look_target=(x_m, y_m, z_m),
            eye_up=(0.0, 0.0, 1.0),
        ),
    )


def _picture_view(ranges: TraceRanges) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        name="Picture · heatmap · samples · chosen step",
        origin=CAMERA,
        contents=["+ $origin/**", f"- {CAMERA}/depth"],
        background=BACKGROUND,
        visual_bounds=picture_bounds(ranges.width_px, ranges.height_px),
    )


def _depth_view(ranges: TraceRanges) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        name="Depth",
        origin=CAMERA,
        contents=["+ $origin", "+ $origin/depth", "+ $origin/jaws/**"],
        background=BACKGROUND,
        visual_bounds=picture_bounds(ranges.width_px, ranges.height_px),
    )


def picture_bounds(width_px: int, height_px: int) -> rrb.VisualBounds2D:
    """The whole picture and nothing else."""
    return rrb.VisualBounds2D(x_range=(0, width_px), y_range=(0, height_px))


def input_views(size_px: int, *, root: str = "", name: str | None = None) -> rrb.Horizontal:
    """The network's input: colour, and height above the mean plane."""
    return rrb.Horizontal(
        *(
            rrb.Spatial2DView(
                name=title,
                origin=f"{root}/{origin}",
                background=BACKGROUND,
                visual_bounds=picture_bounds(size_px, size_px),
            )
            for title, origin in (("Input · colour", "input/rgb"), ("Input · height", "input/height"))
        ),
        name=name,
    )


def _plots(ranges: TraceRanges) -> tuple[rrb.TimeSeriesView, rrb.TimeSeriesView]:
    # One step of margin: the cursor of the last step would be lost on the border.
    steps = rrb.TimeAxis(
        view_range=rr.TimeRange(
            start=rr.TimeRangeBoundary.absolute(seq=0), end=rr.TimeRangeBoundary.absolute(seq=ranges.last_step + 1)
        )
    )
    return (
        rrb.TimeSeriesView(
            name="Predicted success",
            origin="/plots/score",
            axis_x=steps,
            axis_y=rrb.ScalarAxis(range=(-0.05, 1.05)),
            plot_legend=rrb.PlotLegend(rrb.Corner2D.RightBottom),
        ),
        rrb.TimeSeriesView(
            name="Chosen step Δp",
            origin="/plots/step",
            axis_x=steps,
            axis_y=rrb.ScalarAxis(range=(-ranges.step_mm_deg, ranges.step_mm_deg)),
            plot_legend=rrb.PlotLegend(rrb.Corner2D.RightBottom),
        ),
    )


def _texts() -> rrb.Tabs:
    return rrb.Tabs(
        rrb.TextDocumentView(name="Trial", origin="/text/trial"),
        rrb.TextDocumentView(name="Steps", origin="/text/steps"),
        active_tab=0,
    )
