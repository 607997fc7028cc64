"""How the viewer lays out heatmaps: a tab for each example, its angle moved by one slider, and one for the overview."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import rerun as rr
import rerun.blueprint as rrb

from handsight.viz.examples import ForesightOverview, HeatmapExample
from handsight.viz.heat_look import axial_deg
from handsight.viz.recordings.layouts import BACKGROUND, input_views, picture_bounds
from handsight.viz.recordings.overview import overview_layout
from handsight.viz.recordings.recording import paused_layout
from handsight.viz.recordings.scales import HEIGHT_PX

HEAT_TIMELINE: Final = "angle_deg"
TITLE_LENGTH: Final = 24
"""Letters of a tab's title; all of it is in its text."""


def key_of(number: int) -> str:
    """The entity below which an example is."""
    return f"/{number:03d}"


def heatmaps_blueprint(examples: Sequence[HeatmapExample], overview: ForesightOverview | None) -> rrb.Blueprint:
    """The layout of a recording of heatmaps."""
    tabs: list[rrb.Container] = [_example_tab(number, example) for number, example in enumerate(examples)]
    if overview is not None:
        tabs.insert(0, overview_layout(overview))
    content = rrb.Tabs(*tabs, active_tab=0) if len(tabs) > 1 else tabs[0]
    return paused_layout(content, timeline=HEAT_TIMELINE, fps=6.0)


def _example_tab(number: int, example: HeatmapExample) -> rrb.Container:
    root, k = key_of(number), example.view.camera.intrinsics
    with_scale = picture_bounds(k.width, k.height + HEIGHT_PX)
    outcome = "" if example.held is None else " · held" if example.held else " · empty"

    def picture(name: str, *layers: str, bounds: rrb.VisualBounds2D = with_scale) -> rrb.Spatial2DView:
        return rrb.Spatial2DView(
            name=name,
            origin=f"{root}/picture",
            contents=[f"$origin/{layer}" for layer in layers],
            background=BACKGROUND,
            visual_bounds=bounds,
        )

    moving = ("heat", "contour/**", "jaws/**", "turn/**", "text", "scale")
    over_all = ("highest/**", "best/**", "scale")
    return rrb.Vertical(
        rrb.Horizontal(
            picture("Predicted success at the slider's angle", "muted", *moving),
            picture("Best over all angles", "muted", *over_all),
            picture("Angle of the best", "muted", "angles", "strokes/**", "hues"),
        ),
        rrb.Horizontal(
            picture("At this angle, over depth", "shaded", *moving),
            _table_view(root, example),
            rrb.Vertical(
                rrb.Horizontal(
                    rrb.Tabs(
                        picture("Attempted grasp", "rgb", "attempted/**", bounds=picture_bounds(k.width, k.height)),
                        _numbers_view(root, example),
                        _depth_view(root, example),
                        input_views(example.grid.size_px, root=root, name="Input at the best"),
                        active_tab=0,
                    ),
                    _plot(root, example),
                ),
                rrb.TextDocumentView(name="About", origin=f"{root}/text"),
                row_shares=[0.42, 0.58],
            ),
            column_shares=[0.3, 0.3, 0.4],
        ),
        row_shares=[0.54, 0.46],
        name=f"{example.title[:TITLE_LENGTH]}{outcome}",
    )


def _table_view(root: str, example: HeatmapExample) -> rrb.Spatial3DView:
    plane_m = example.view.plane_m
    y_m = -example.view.camera.y_tool_camera_m
    return rrb.Spatial3DView(
        name="On the table, in 3D",
        origin=f"{root}/table",
        background=BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(0.25 * plane_m, y_m - 0.75 * plane_m, 0.85 * plane_m),
            look_target=(0.0, y_m - 0.03, 0.0),
            eye_up=(0.0, 0.0, 1.0),
        ),
    )


def _numbers_view(root: str, example: HeatmapExample) -> rrb.Spatial2DView:
    rows, columns = example.maps.scores.shape[1:]
    return rrb.Spatial2DView(
        name="Scores", origin=f"{root}/scores", background=BACKGROUND, visual_bounds=picture_bounds(columns, rows)
    )


def _depth_view(root: str, example: HeatmapExample) -> rrb.Spatial2DView:
    k = example.view.camera.intrinsics
    return rrb.Spatial2DView(
        name="Depth", origin=f"{root}/depth", background=BACKGROUND, visual_bounds=picture_bounds(k.width, k.height)
    )


def _plot(root: str, example: HeatmapExample) -> rrb.TimeSeriesView:
    last = max(axial_deg(angle_rad) for angle_rad in example.maps.angles_rad.tolist())
    return rrb.TimeSeriesView(
        name="Best S by angle [°]",
        origin=f"{root}/plots",
        axis_x=rrb.TimeAxis(
            view_range=rr.TimeRange(
                start=rr.TimeRangeBoundary.absolute(seq=0), end=rr.TimeRangeBoundary.absolute(seq=last + 1)
            )
        ),
        axis_y=rrb.ScalarAxis(range=(-0.05, 1.05)),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightBottom),
    )
