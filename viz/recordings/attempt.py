"""One recorded attempt as a Rerun recording: what was seen, where it was grasped, what came of it.

Everything is there for all time but the gripper's readings, which stand on the timeline ``station_time``. Entities:

    world/{table, objects}                 the scene as a cloud of the points that the overhead picture measured
    world/tool/camera/{rgb, depth, heat}   the overhead picture, its depth, predicted success over it
    world/tool/camera/{jaws, text}         the grasp that was attempted, over the picture
    world/grasp/gripper                    the open gripper where the jaws closed
    input/{rgb, height}                    the network's input for that grasp
    plots/opening/{jaws_mm, closed_mm}     openings read, and what counts as closed
    plots/force/contact_n                  the force that ended the descent
    text/attempt                           figures, the label, what curation decided
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import torch

from handsight.datasets.records import PHASES, GraspAttempt, RgbdFrame, StationSpec
from handsight.datasets.views import station_view
from handsight.servoing.heatmap import Heatmap
from handsight.servoing.homography import InputGrid, predict_inputs
from handsight.servoing.planar import PlanarPose
from handsight.servoing.prepared_view import PreparedView
from handsight.servoing.view import View
from handsight.viz import palette
from handsight.viz.errors import RecordingError
from handsight.viz.pixels import PictureFrame, Step
from handsight.viz.recordings.encoding import depth_png, height_image, jpeg, log_overlay, png
from handsight.viz.recordings.glyphs import gripper_boxes, log_jaws, log_label
from handsight.viz.recordings.layouts import BACKGROUND, CAMERA, EYE_OFFSET_M, input_views, picture_bounds
from handsight.viz.recordings.recording import write_recording
from handsight.viz.recordings.scene import log_hand_camera, log_scene

KIND = "handsight_attempt"
TIMELINE = "station_time"
NEARER = 0.85
"""The eye is nearer than in a trace, in which the arm takes room."""
EYE_ON_M = 0.12
"""Height at which it looks."""
MOST_FORCE_N = 60.0
"""Where the plot of the contact ends; a descent is stopped at 40 N (paper, section III-B)."""
MARGIN = 1.15
"""Of a plot's range over the largest value in it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AttemptExample:
    """An attempt with what is said of it."""

    name: str
    """Its id, which becomes that of the recording."""
    title: str
    attempt: GraspAttempt
    """As it was recorded; it took an overhead picture."""
    station: StationSpec
    success: bool | None
    """The label that counts; None where there is none."""
    notes: tuple[tuple[str, str], ...] = ()
    """What else there is to say of it, name and text: curation, findings, what a network expects."""
    commands: tuple[str, ...] = ()
    """What to type to change what counts."""
    heatmap: Heatmap | None = None
    grid: InputGrid | None = None
    """Of the network whose input is shown; None for the paper's."""


def write_attempt(path: Path, example: AttemptExample) -> None:
    """Write an attempt as a self-contained ``.rrd`` with its layout.

    Raises:
        RecordingError: It took no overhead picture, or ``path`` cannot be written.
    """
    frame = example.attempt.overhead
    if frame is None:
        raise RecordingError(
            f"attempt {example.name} ended before it took a picture ({example.attempt.failure}): choose another"
        )
    blueprint = attempt_blueprint(example.station, frame)
    with write_recording(path, kind=KIND, name=example.name, title=example.title, blueprint=blueprint) as stream:
        view = station_view(frame, example.station)
        log_scene(stream, frame, example.station, example.attempt.scene, points=True)
        pose = frame.pose_base_tool
        stream.log("world/tool", rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]), static=True)
        log_hand_camera(stream, example.station)
        _log_pictures(stream, example, view)
        _log_grasp(stream, example, view, frame)
        _log_readings(stream, example)
        stream.log("text/attempt", rr.TextDocument(_text(example), media_type="text/markdown"), static=True)


def attempt_blueprint(station: StationSpec, overhead: RgbdFrame) -> rrb.Blueprint:
    """The layout of an attempt's recording; the same for all attempts of a station, which looks from one place."""
    k = station.camera.intrinsics
    bounds = picture_bounds(k.width, k.height)

    def picture(name: str, contents: list[str]) -> rrb.Spatial2DView:
        return rrb.Spatial2DView(
            name=name, origin=CAMERA, contents=contents, background=BACKGROUND, visual_bounds=bounds
        )

    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(
                picture("Picture · attempted grasp", ["+ $origin/**", f"- {CAMERA}/depth", f"- {CAMERA}/heat"]),
                picture("Predicted success · unturned", ["+ $origin", f"+ {CAMERA}/rgb", f"+ {CAMERA}/heat"]),
                _scene_view(overhead),
                column_shares=[0.36, 0.28, 0.36],
            ),
            rrb.Horizontal(
                picture("Depth", ["+ $origin", "+ $origin/depth", "+ $origin/jaws/**"]),
                input_views(InputGrid().size_px),
                rrb.Vertical(
                    rrb.TimeSeriesView(name="Opening [mm]", origin="/plots/opening", axis_y=_from_zero(station)),
                    rrb.TimeSeriesView(
                        name="Force [N]", origin="/plots/force", axis_y=rrb.ScalarAxis(range=(0.0, MOST_FORCE_N))
                    ),
                    row_shares=[0.6, 0.4],
                ),
                rrb.TextDocumentView(name="Attempt", origin="/text/attempt"),
                column_shares=[0.2, 0.24, 0.24, 0.32],
            ),
            row_shares=[0.58, 0.42],
        ),
        rrb.TimePanel(timeline=TIMELINE, play_state="paused", state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_layout=False,
        auto_views=False,
    )


def pregrasp_pose(x_m: float, y_m: float, angle_rad: float) -> PlanarPose | None:
    """The pose of a grasp as it is recorded; None where none was chosen."""
    return PlanarPose(x_m=x_m, y_m=y_m, angle_rad=angle_rad) if math.isfinite(x_m) else None


def step_from(frame: RgbdFrame, goal: PlanarPose) -> Step:
    """From where a picture was taken to a pre-grasp pose."""
    step = PlanarPose.from_pose_base_tool(frame.pose_base_tool).step_to(goal)
    return step.dx_m, step.dy_m, step.dangle_rad


def label_colour(success: bool | None) -> palette.Rgb:
    """The colour of a label; grey where there is none."""
    return palette.STEEL if success is None else palette.HELD if success else palette.EMPTY


def _scene_view(overhead: RgbdFrame) -> rrb.Spatial3DView:
    x_m, y_m = overhead.pose_base_tool[:2, 3].tolist()
    offset_x_m, offset_y_m, offset_z_m = EYE_OFFSET_M
    flat = [f"- {CAMERA}/{name}" for name in ("depth", "jaws/**", "text/**", "heat")]
    return rrb.Spatial3DView(
        name="Scene · grasp",
        origin="/world",
        # Depth under a camera would be drawn as a second cloud, in the colours of its heights.
        contents=["+ $origin/**", *flat],
        background=BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(x_m + NEARER * offset_x_m, y_m + NEARER * offset_y_m, NEARER * offset_z_m + EYE_ON_M),
            look_target=(x_m, y_m, EYE_ON_M),
            eye_up=(0.0, 0.0, 1.0),
        ),
    )


def _from_zero(station: StationSpec) -> rrb.ScalarAxis:
    return rrb.ScalarAxis(range=(0.0, MARGIN * 1e3 * station.gripper_stroke_m))


def _log_pictures(stream: rr.RecordingStream, example: AttemptExample, view: View) -> None:
    stream.log(f"{CAMERA}/rgb", jpeg(view.rgb), static=True)
    range_m = (view.plane_m - palette.TALLEST_M, view.plane_m + palette.BELOW_TABLE_M)
    depth = depth_png(view.depth_m, unit_m=example.station.depth_scale_m, range_m=range_m)
    stream.log(f"{CAMERA}/depth", depth, static=True)
    if example.heatmap is not None:
        log_overlay(stream, f"{CAMERA}/heat", example.heatmap, static=True)


def _log_grasp(stream: rr.RecordingStream, example: AttemptExample, view: View, frame: RgbdFrame) -> None:
    attempt = example.attempt
    goal = pregrasp_pose(attempt.pregrasp_x_m, attempt.pregrasp_y_m, attempt.pregrasp_angle_rad)
    if goal is None:
        return
    step = step_from(frame, goal)
    stroke_m = example.station.gripper_stroke_m
    colour, outcome = label_colour(example.success), example.attempt.outcome.name.lower()
    picture = PictureFrame(camera=view.camera, plane_m=view.plane_m)
    missed = example.success is False
    log_jaws(stream, f"{CAMERA}/jaws", picture, step, width_m=stroke_m, colour=colour, dashed=missed, static=True)
    log_label(stream, f"{CAMERA}/text", picture, [step], outcome, width_m=stroke_m, static=True)
    pose = example.attempt.pose_base_tool_grasp
    if np.isfinite(pose).all():
        stream.log("world/grasp", rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]), static=True)
        stream.log("world/grasp/gripper", gripper_boxes(stroke_m, colour=colour), static=True)
    grid = example.grid or InputGrid()
    prepared = PreparedView.from_view(view, pixels_per_cell=grid.pixels_per_cell)
    inputs = predict_inputs(prepared, torch.tensor([step]), grid=grid)[0].numpy(force=True)  # (4, size, size)
    stream.log("input/rgb", png(np.rint(255 * inputs[:3].transpose(1, 2, 0)).astype(np.uint8)), static=True)
    stream.log("input/height", height_image(inputs[3], top_m=palette.TALLEST_M), static=True)


def _log_readings(stream: rr.RecordingStream, example: AttemptExample) -> None:
    attempt, gripper = example.attempt, example.attempt.gripper
    ends_s = dict(zip(PHASES, np.cumsum(attempt.phase_s.astype(float)).tolist(), strict=True))
    readings = {
        "reach": gripper.before_m,
        "close": gripper.closed_m,
        "lift": gripper.lifted_m,
        "shake": gripper.final_m,
    }
    for path, name, colour in (
        ("plots/opening/jaws_mm", "jaws", palette.CHOSEN),
        ("plots/opening/closed_mm", "counts as closed", palette.THRESHOLD),
        ("plots/force/contact_n", "contact", palette.CHOSEN),
    ):
        stream.log(path, rr.SeriesLines(names=name, colors=[colour], widths=2.0), static=True)
        stream.log(path, rr.SeriesPoints(names=name, colors=[colour], markers="circle", marker_sizes=3.0), static=True)
    for phase, width_m in readings.items():
        stream.set_time(TIMELINE, duration=ends_s[phase])
        if math.isfinite(width_m):
            stream.log("plots/opening/jaws_mm", rr.Scalars(1e3 * width_m))
        stream.log("plots/opening/closed_mm", rr.Scalars(1e3 * example.station.closed_width_m))
    for phase, force_n in (("reach", 0.0), ("descend", attempt.contact_force_n)):
        stream.set_time(TIMELINE, duration=ends_s[phase])
        stream.log("plots/force/contact_n", rr.Scalars(force_n))


def _text(example: AttemptExample) -> str:
    attempt, gripper = example.attempt, example.attempt.gripper
    widths_m = (gripper.before_m, gripper.closed_m, gripper.lifted_m, gripper.final_m)
    widths = " → ".join("—" if math.isnan(width_m) else f"{1e3 * width_m:.1f}" for width_m in widths_m)
    label = "none" if example.success is None else "success" if example.success else "failure"
    outcome = attempt.outcome.name.lower() + (f" ({attempt.failure})" if attempt.failure else "")
    rows = [
        ("outcome", f"**{outcome}**"),
        ("label that counts", label),
        ("before → closed → lifted → final", f"{widths} mm"),
        ("counts as closed", f"at or below {1e3 * example.station.closed_width_m:.1f} mm"),
        ("contact", f"{attempt.contact_force_n:.1f} N"),
        *example.notes,
    ]
    if attempt.truth_held is not None:
        rows.append(("simulator", "object held" if attempt.truth_held else "nothing held"))
    table = [f"| {name} | {value} |" for name, value in rows]
    lines = [f"## {example.title}", "", example.name, "", table[0], "|:--|:--|", *table[1:]]
    for command in example.commands:
        lines += ["", "```", command, "```"]
    return "\n".join(lines) + "\n"
