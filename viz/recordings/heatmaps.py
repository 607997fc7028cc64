"""Heatmaps at all angles as a Rerun recording: where the network would grasp, and how turned.

The slider is the timeline ``angle_deg``, the turn of the gripper from 0 to 179 degrees: by half a turn more, equal jaws
stand as before. Each example has a tab and the entities below its number, ``/000`` for the first; an overview of many
attempts, where there is one, comes before them:

    picture/{rgb, muted, shaded}            the picture; the same and its depth, muted, to lie under heat
    picture/{heat, contour, jaws, turn, text}       at the angle of the slider: scores, threshold, best pose, its angle
    picture/{highest, best, angles, strokes}        over all angles: highest score and best pose; the angle of each
    picture/{attempted, scale, hues}        the grasp that was attempted; colour scales
    scores                                  predicted success as numbers, 16 bits between 0 and 1, in grid points
    depth                                   depth, in raw pixels
    table/{surface, jaws}                   heat over the surface that was seen, and the best pose at this angle, in 3D
    plots/{best, threshold}                 best score of each angle
    input/{rgb, height}                     the network's input at the best pose
    text                                    what was attempted, predicted, and how scores are to be read
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import torch

from handsight.servoing.heatmap import Heatmap
from handsight.servoing.homography import predict_inputs
from handsight.servoing.prepared_view import PreparedView
from handsight.viz import palette
from handsight.viz.errors import RecordingError
from handsight.viz.examples import ForesightOverview, HeatmapExample, heatmap_faults
from handsight.viz.heat_look import angle_rgba, axial_deg, contours, muted, shaded_depth, strokes
from handsight.viz.pixels import CENTRE_PX, PictureFrame, Step, best_step
from handsight.viz.recordings.encoding import (
    DEPTH_UNIT_M,
    OVERLAY_ORDER,
    depth_png,
    encoded_png,
    height_image,
    jpeg,
    log_overlay,
    log_placed,
    png,
    scores_png,
)
from handsight.viz.recordings.glyphs import LABEL_ORDER, log_jaws, log_label, log_outlined
from handsight.viz.recordings.heat_surface import HeatSurface
from handsight.viz.recordings.heatmap_layouts import HEAT_TIMELINE, heatmaps_blueprint, key_of
from handsight.viz.recordings.overview import log_overview
from handsight.viz.recordings.recording import write_recording
from handsight.viz.recordings.scales import angle_scale, score_scale

KIND = "handsight_heatmaps"
STROKE_PX = 16.0
STROKE_EVERY = 3
CORNER_PX = 44.0
"""From the corner of a picture to the middle of the mark that shows how the jaws are turned."""
SURE_SHARE = 0.5
"""Strokes are drawn where the score is at least this share of the best."""


def write_heatmaps(path: Path, examples: Sequence[HeatmapExample], overview: ForesightOverview | None = None) -> None:
    """Write examples as a self-contained ``.rrd`` with its layout.

    Args:
        path: The file to write; an existing one is replaced.
        examples: One tab each.
        overview: Predicted against happened, in a tab before them; None for none.

    Raises:
        RecordingError: There is no example, a heatmap does not fit, or ``path`` cannot be written.
    """
    faults = heatmap_faults(examples)
    if len({tuple(example.maps.angles_rad) for example in examples}) > 1:
        faults.append("the maps of examples are at different angles, expected the same for all: they share a slider")
    if faults:
        raise RecordingError("; ".join(faults))
    with write_recording(path, kind=KIND, name="heatmaps", blueprint=heatmaps_blueprint(examples, overview)) as stream:
        if overview is not None:
            log_overview(stream, overview)
        for number, example in enumerate(examples):
            log_heatmaps(stream, key_of(number), example)


def log_heatmaps(stream: rr.RecordingStream, root: str, example: HeatmapExample) -> None:
    """Log all of one example below an entity; the time of the stream is left at no angle."""
    _log_once(stream, root, example)
    _log_over_angles(stream, root, example)
    surface = HeatSurface.of(example.view)
    surface.log_shape(stream, f"{root}/table/surface")
    turns_deg = {axial_deg(angle_rad): index for index, angle_rad in enumerate(example.maps.angles_rad.tolist())}
    for turn_deg, index in sorted(turns_deg.items()):
        stream.set_time(HEAT_TIMELINE, sequence=turn_deg)
        _log_angle(stream, root, example, example.maps.at(index), surface)
    stream.disable_timeline(HEAT_TIMELINE)


def _log_once(stream: rr.RecordingStream, root: str, example: HeatmapExample) -> None:
    view, frame = example.view, _frame(example)
    k = view.camera.intrinsics
    near_m, far_m = view.plane_m - palette.TALLEST_M, view.plane_m + palette.BELOW_TABLE_M
    stream.log(f"{root}/picture/rgb", jpeg(view.rgb), static=True)
    stream.log(f"{root}/picture/muted", jpeg(muted(view.rgb)), static=True)
    stream.log(f"{root}/picture/shaded", jpeg(shaded_depth(view.depth_m, near_m=near_m, far_m=far_m)), static=True)
    stream.log(f"{root}/depth", depth_png(view.depth_m, unit_m=DEPTH_UNIT_M, range_m=(near_m, far_m)), static=True)
    below = rr.Transform3D(translation=(0.0, float(k.height), 0.0))
    name = ("calibrated S" if example.temperature.fitted else "S") + f" · line: threshold {example.shown_threshold:.2f}"
    stream.log(
        f"{root}/picture/scale",
        encoded_png(score_scale(k.width, name=name, threshold=example.shown_threshold)),
        below,
        static=True,
    )
    stream.log(
        f"{root}/picture/hues",
        encoded_png(angle_scale(k.width, name="turn of the jaws at the best score")),
        below,
        static=True,
    )
    if example.grasp is not None:
        colour = palette.HERE if example.held is None else palette.HELD if example.held else palette.EMPTY
        log_jaws(
            stream,
            f"{root}/picture/attempted",
            frame,
            example.grasp,
            width_m=example.jaws_m,
            colour=colour,
            dashed=example.held is False,
            static=True,
        )
    step = best_step(example.heatmap, frame)
    _log_input(stream, root, example, step)
    stream.log(f"{root}/text", rr.TextDocument(_text(example, step), media_type="text/markdown"), static=True)
    stream.log(f"{root}/plots/best", rr.SeriesLines(names="best S", colors=[palette.CHOSEN], widths=2.0), static=True)
    stream.log(
        f"{root}/plots/best",
        rr.SeriesPoints(names="best S", colors=[palette.CHOSEN], markers="circle", marker_sizes=3.0),
        static=True,
    )
    stream.log(
        f"{root}/plots/threshold",
        rr.SeriesLines(names="threshold", colors=[palette.THRESHOLD], widths=2.0),
        static=True,
    )


def _log_over_angles(stream: rr.RecordingStream, root: str, example: HeatmapExample) -> None:
    """What does not move with the slider: the best of all angles."""
    maps, frame = example.maps, _frame(example)
    highest = Heatmap(scores=maps.best, columns_px=maps.columns_px, rows_px=maps.rows_px, angle_rad=0.0)
    picture = f"{root}/picture"
    log_overlay(stream, f"{picture}/highest/heat", highest, static=True)
    log_outlined(stream, f"{picture}/highest/contour", _shown(contours(highest, example.shown_threshold)), static=True)
    step = best_step(example.heatmap, frame)
    best = f"{picture}/best"
    log_jaws(stream, f"{best}/jaws", frame, step, width_m=example.jaws_m, colour=palette.CHOSEN, static=True)
    text = f"S {float(maps.best.max()):.2f} at {axial_deg(step[2])}°"
    log_label(stream, f"{best}/text", frame, [step], text, width_m=example.jaws_m, static=True)
    hues = angle_rgba(maps.best_angle_rad, maps.best)
    log_placed(stream, f"{picture}/angles", highest, png(hues, draw_order=OVERLAY_ORDER), static=True)
    least = SURE_SHARE * float(maps.best.max())
    lines = strokes(highest, maps.best_angle_rad, least=least, every=STROKE_EVERY, length_px=STROKE_PX)
    log_outlined(stream, f"{picture}/strokes", _shown(lines), static=True)


def _log_angle(
    stream: rr.RecordingStream, root: str, example: HeatmapExample, heatmap: Heatmap, surface: HeatSurface
) -> None:
    frame = _frame(example)
    step, best = best_step(heatmap, frame), float(heatmap.scores.max())
    picture = f"{root}/picture"
    log_overlay(stream, f"{picture}/heat", heatmap)
    log_outlined(stream, f"{picture}/contour", _shown(contours(heatmap, example.shown_threshold)))
    log_jaws(stream, f"{picture}/jaws", frame, step, width_m=example.jaws_m, colour=palette.CHOSEN)
    log_label(stream, f"{picture}/text", frame, [step], f"S {best:.2f}", width_m=example.jaws_m)
    _log_turn(stream, f"{picture}/turn", heatmap.angle_rad)
    stream.log(f"{root}/scores", scores_png(heatmap.scores))
    surface.log_heat(stream, f"{root}/table/surface", heatmap)
    surface.log_jaws(stream, f"{root}/table/jaws", step, width_m=example.jaws_m, colour=palette.CHOSEN)
    stream.log(f"{root}/plots/best", rr.Scalars(best))
    stream.log(f"{root}/plots/threshold", rr.Scalars(example.shown_threshold))


def _log_turn(stream: rr.RecordingStream, path: str, angle_rad: float) -> None:
    """In the corner, how the jaws are turned at this angle of the slider."""
    middle = np.array([CORNER_PX, CORNER_PX])
    along = np.array([math.cos(angle_rad), math.sin(angle_rad)])
    across = np.array([-along[1], along[0]])
    ends = [middle - 20 * along, middle + 20 * along]
    tips = [np.stack([end - 9 * across, end + 9 * across]) for end in ends]
    log_outlined(stream, f"{path}/jaws", [np.stack(ends), *tips])
    stream.log(
        f"{path}/text",
        rr.Points2D(
            [[CORNER_PX + 96, CORNER_PX - 12]],
            radii=[0.0],
            colors=[palette.HERE],
            labels=[f"jaws at {axial_deg(angle_rad)}°"],
            show_labels=True,
            draw_order=LABEL_ORDER,
        ),
    )


def _frame(example: HeatmapExample) -> PictureFrame:
    return PictureFrame(camera=example.view.camera, plane_m=example.view.plane_m)


def _shown(lines: Sequence[np.ndarray]) -> list[np.ndarray]:
    """From raw pixels to Rerun's."""
    return [line + CENTRE_PX for line in lines]


def _log_input(stream: rr.RecordingStream, root: str, example: HeatmapExample, step: Step) -> None:
    prepared = PreparedView.from_view(example.view, pixels_per_cell=example.grid.pixels_per_cell)
    steps = torch.tensor([step], dtype=torch.float32)
    inputs = predict_inputs(prepared, steps, grid=example.grid, view_plane_m=example.view_plane_m)[0].numpy(force=True)
    stream.log(f"{root}/input/rgb", png(np.rint(255 * inputs[:3].transpose(1, 2, 0)).astype(np.uint8)), static=True)
    stream.log(f"{root}/input/height", height_image(inputs[3], top_m=palette.TALLEST_M), static=True)


def _text(example: HeatmapExample, step: Step) -> str:
    dx_m, dy_m, dangle_rad = step
    maps = example.maps
    seen = example.foresight
    rows = [
        ("best S", f"**{float(maps.best.max()):.3f}**"),
        ("there: Δx, Δy, Δθ", f"{1e3 * dx_m:+.0f} mm, {1e3 * dy_m:+.0f} mm, {math.degrees(dangle_rad):+.0f}°"),
        ("best S without turning", f"{float(maps.at(maps.straight).scores.max()):.3f}"),
        ("threshold", _threshold(example)),
    ]
    if seen is not None:
        verdict = "**wrong**" if seen.surprise > 0.5 else "right"
        rows.append(("attempted grasp", f"predicted S {seen.score:.3f}, {'held' if seen.held else 'empty'}: {verdict}"))
    elif example.held is not None:
        rows.append(("attempted grasp", "held" if example.held else "empty"))
    table = [f"| {name} | {value} |" for name, value in rows]
    lines = [f"### {example.title}", "", f"Shown: {example.temperature}.", "", table[0], "|:--|:--|", *table[1:], ""]
    return "\n".join([*lines, _how(example)]) + "\n"


def _threshold(example: HeatmapExample) -> str:
    if not example.temperature.fitted:
        return f"{example.threshold:.2f}"
    return f"{example.shown_threshold:.2f}, which is {example.threshold:.2f} as the network gives it"


def _how(example: HeatmapExample) -> str:
    if example.maps.dense:
        return (
            f"{len(example.maps.angles_rad)} angles, each one pass of the network over the turned picture; turned maps "
            "are read between the points of its lattice."
        )
    return (
        f"{len(example.maps.angles_rad)} angles, crop by crop: the network of this run pads its pictures, so that it "
        "has no dense form."
    )
