"""Heatmaps as a Rerun recording: where the network would grasp, picture by picture.

Step k of the timeline ``example`` is example k. Entities:

    picture/{rgb, heat, jaws, text}     the picture, predicted success over it, the best pose, in raw pixels
    depth                               depth, in raw pixels
    scores/grid                         predicted success as numbers, in raw pixels
    input/{rgb, height}                 the network's input at the best pose
    text/example                        title, best pose, label
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import torch

from handsight.servoing.heatmap import Heatmap
from handsight.servoing.homography import predict_inputs
from handsight.servoing.prepared_view import PreparedView
from handsight.viz import palette
from handsight.viz.errors import RecordingError
from handsight.viz.examples import HeatmapExample, heatmap_faults
from handsight.viz.pixels import PictureFrame, Step, best_step, place_heatmap
from handsight.viz.recordings.encoding import DEPTH_UNIT_M, depth_png, height_image, jpeg, log_overlay, png
from handsight.viz.recordings.glyphs import log_jaws, log_label
from handsight.viz.recordings.layouts import BACKGROUND, input_views, picture_bounds
from handsight.viz.recordings.recording import paused_layout, write_recording

KIND = "handsight_heatmaps"
TIMELINE = "example"


def write_heatmaps(path: Path, examples: Sequence[HeatmapExample]) -> None:
    """Write examples as a self-contained ``.rrd`` with its layout.

    Raises:
        RecordingError: There is no example, a heatmap does not fit, or ``path`` cannot be written.
    """
    faults = heatmap_faults(examples)
    if faults:
        raise RecordingError("; ".join(faults))
    with write_recording(path, kind=KIND, name="heatmaps", blueprint=_blueprint(examples)) as stream:
        for number, example in enumerate(examples):
            stream.set_time(TIMELINE, sequence=number)
            _log_example(stream, example)


def _log_example(stream: rr.RecordingStream, example: HeatmapExample) -> None:
    view, heatmap = example.view, example.heatmap
    frame = PictureFrame(camera=view.camera, plane_m=view.plane_m)
    step = best_step(heatmap, frame)
    best = float(heatmap.scores.max())
    stream.log("picture/rgb", jpeg(view.rgb))
    log_overlay(stream, "picture/heat", heatmap)
    log_jaws(stream, "picture/jaws", frame, step, width_m=example.jaws_m, colour=palette.CHOSEN)
    log_label(stream, "picture/text", frame, [step], f"S {best:.2f}", width_m=example.jaws_m)
    near_m = view.plane_m - palette.TALLEST_M
    stream.log(
        "depth",
        depth_png(view.depth_m, unit_m=DEPTH_UNIT_M, range_m=(near_m, view.plane_m + palette.BELOW_TABLE_M)),
    )
    _log_scores(stream, heatmap)
    _log_input(stream, example, step)
    stream.log("text/example", rr.TextDocument(_text(example, step, best), media_type="text/markdown"))


def _log_scores(stream: rr.RecordingStream, heatmap: Heatmap) -> None:
    placement = place_heatmap(heatmap)
    stream.log(
        "scores/grid",
        rr.DepthImage(
            heatmap.scores, meter=1.0, colormap="Inferno", depth_range=(0.0, 1.0), magnification_filter="Nearest"
        ),
        rr.Transform3D(translation=(*placement.translation_px, 0.0), scale=(*placement.scale, 1.0)),
    )


def _log_input(stream: rr.RecordingStream, example: HeatmapExample, step: Step) -> None:
    prepared = PreparedView.from_view(example.view, pixels_per_cell=example.grid.pixels_per_cell)
    inputs = predict_inputs(prepared, torch.tensor([step]), grid=example.grid)[0].numpy(force=True)
    stream.log("input/rgb", png(np.rint(255 * inputs[:3].transpose(1, 2, 0)).astype(np.uint8)))
    stream.log("input/height", height_image(inputs[3], top_m=palette.TALLEST_M))


def _text(example: HeatmapExample, step: Step, best: float) -> str:
    dx_m, dy_m, dangle_rad = step
    rows = [
        f"## {example.title}",
        "",
        f"| best S | {best:.3f} |",
        "|:--|:--|",
        f"| Δx, Δy | {1e3 * dx_m:+.0f}, {1e3 * dy_m:+.0f} mm |",
        f"| Δθ | {math.degrees(dangle_rad):.0f}° |",
    ]
    if example.held is not None:
        rows.append(f"| grasp here | {'held' if example.held else 'empty'} |")
    return "\n".join(rows) + "\n"


def _blueprint(examples: Sequence[HeatmapExample]) -> rrb.Blueprint:
    cameras = [example.view.camera.intrinsics for example in examples]
    bounds = picture_bounds(max(k.width for k in cameras), max(k.height for k in cameras))

    def picture(name: str, origin: str, contents: str | list[str] = "$origin/**") -> rrb.Spatial2DView:
        return rrb.Spatial2DView(
            name=name, origin=origin, contents=contents, background=BACKGROUND, visual_bounds=bounds
        )

    return paused_layout(
        rrb.Vertical(
            rrb.Horizontal(
                picture("Picture", "/picture", ["/picture/rgb"]),
                picture("Predicted success · best pose", "/picture"),
            ),
            rrb.Horizontal(
                picture("Depth", "/depth"),
                picture("Scores", "/scores"),
                rrb.Vertical(
                    input_views(max(example.grid.size_px for example in examples)),
                    rrb.TextDocumentView(name="Example", origin="/text/example"),
                    row_shares=[0.48, 0.52],
                ),
            ),
            row_shares=[0.58, 0.42],
        ),
        timeline=TIMELINE,
        fps=1.0,
    )
