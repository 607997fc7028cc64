"""One servo run as a Rerun recording: what was seen, what was chosen, what came of it.

Step k of the timeline ``servo_step`` is pass k of the loop. The last one also shows the grasp that was executed, in
the colour of its label. Entities:

    world/{table, objects}                              the scene, once
    world/tool/{gripper, camera}                        gripper and camera at every step
    world/tool/camera/{rgb, heat, depth}                pictures, in raw pixels
    world/tool/camera/{samples, arrow, jaws, text}      what was scored and chosen, over the pictures
    world/{trajectory, grasp}                           where the tool has been, where it grasped
    scene/rgb                                           the station from outside, where pictures of it were given
    input/{rgb, height}                                 the network's input
    plots/score/{here, predicted, threshold}            success metrics
    plots/step/{dx_mm, dy_mm, dangle_deg}               the chosen steps
    text/{trial, steps}                                 summary and table
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from handsight.datasets.errors import counted
from handsight.evaluation.trial import TrialRecording
from handsight.servoing.heatmap import Heatmap
from handsight.servoing.loop import ServoStep, ServoTrace
from handsight.servoing.optimiser import Proposal
from handsight.viz import palette
from handsight.viz.errors import RecordingError
from handsight.viz.pixels import PictureFrame, place_heatmap
from handsight.viz.recordings.encoding import depth_png, height_image, jpeg, log_overlay, png
from handsight.viz.recordings.glyphs import STAY, gripper_boxes, log_arrow, log_jaws, log_label
from handsight.viz.recordings.layouts import CAMERA, OUTSIDE, TIMELINE, TraceRanges, trace_blueprint
from handsight.viz.recordings.recording import write_recording
from handsight.viz.recordings.scene import log_scene
from handsight.viz.recordings.summary import outcome, step_table, trial_summary

KIND = "handsight_servo_trace"
IMAGE_PLANE_M = 0.16
"""Distance from the camera at which the scene shows its picture."""
SAMPLES_ORDER = 20.0
PLOT_HALF_RANGES = (5.5, 22.0, 55.0, 110.0)
"""Ranges of the plot of steps [mm and degrees]; over others the viewer labels nothing but 0 on the axis."""
ARROW_FROM_M = 0.001
"""A grasp nearer than this is executed from here: it needs no arrow, and its jaws would cover those shown."""
SERIES = {
    "plots/score/here": ("S(p)", palette.MEASURED),
    "plots/score/predicted": ("S(p+Δp)", palette.CHOSEN),
    "plots/score/threshold": ("threshold", palette.THRESHOLD),
    "plots/step/dx_mm": ("Δx [mm]", palette.AXIS_X),
    "plots/step/dy_mm": ("Δy [mm]", palette.AXIS_Y),
    "plots/step/dangle_deg": ("Δθ [°]", palette.TURN),
}


def write_servo_trace(
    path: Path,
    recording: TrialRecording,
    heatmaps: Sequence[Heatmap] | None = None,
    outside: Sequence[NDArray[np.uint8]] | None = None,
) -> None:
    """Write a trial as a self-contained ``.rrd`` with its layout.

    Args:
        path: The file to write; an existing one is replaced, and nothing is left behind on an error.
        recording: The trial with everything seen.
        heatmaps: One map per step of the trace, drawn over the pictures; None draws none.
        outside: One picture of the station per step, each (H, W, 3); None shows none.

    Raises:
        RecordingError: The trace is empty, maps or pictures do not match its steps, or ``path`` cannot be written.
    """
    trace = recording.trace
    _check(recording, heatmaps, outside)
    ranges = _ranges(recording, outside)
    name = f"{trace.method}-{recording.trial.number:06d}"
    with write_recording(path, kind=KIND, name=name, blueprint=trace_blueprint(ranges)) as stream:
        _log_once(stream, recording)
        for number, step in enumerate(trace.steps):
            stream.set_time(TIMELINE, sequence=number)
            _log_gripper(stream, recording, number)
            _log_pictures(stream, recording, step, heatmaps[number] if heatmaps is not None else None)
            _log_candidates(stream, recording, step)
            _log_plots(stream, trace, step)
            if outside is not None:
                stream.log(OUTSIDE, jpeg(outside[number]))
        _log_grasp(stream, recording)


def _check(
    recording: TrialRecording, heatmaps: Sequence[Heatmap] | None, outside: Sequence[NDArray[np.uint8]] | None
) -> None:
    trace, scene, names = recording.trace, recording.scene, recording.station.objects
    faults = []
    if scene is not None and scene.catalogue_index.max(initial=-1) >= len(names):
        faults.append(
            f"the scene holds object {scene.catalogue_index.max()} of the catalogue, which has {len(names)}; "
            "expected scene and station of one session"
        )
    steps = counted(len(trace.steps), "servo step")
    if not trace.steps:
        faults.append("the servo trace has no steps, expected at least the one that ended it")
    if heatmaps is not None:
        if len(heatmaps) != len(trace.steps):
            faults.append(f"got {counted(len(heatmaps), 'heatmap')} for {steps}, expected one per step")
        for number, heatmap in enumerate(heatmaps):
            try:
                place_heatmap(heatmap)
            except RecordingError as error:
                faults.append(f"heatmap {number}: {error}")
    if outside is not None:
        shapes = {picture.shape for picture in outside}
        if len(outside) != len(trace.steps):
            faults.append(f"got {counted(len(outside), 'outside picture')} for {steps}, expected one each")
        if len(shapes) > 1 or any(len(shape) != 3 or shape[2] != 3 for shape in shapes):
            faults.append(f"outside pictures have the shapes {sorted(shapes)}, expected one shape (H, W, 3)")
    if faults:
        raise RecordingError("; ".join(faults))


def _ranges(recording: TrialRecording, outside: Sequence[NDArray[np.uint8]] | None) -> TraceRanges:
    trace = recording.trace
    k = recording.station.camera.intrinsics
    largest = max(
        (abs(value) for step in trace.steps if step.proposal for value in _mm_deg(step.proposal)), default=0.0
    )
    x_m, y_m = np.mean([(step.pose.x_m, step.pose.y_m) for step in trace.steps], axis=0).tolist()
    overhead_x_m, overhead_y_m = recording.overhead.pose_base_tool[:2, 3].tolist()
    return TraceRanges(
        last_step=len(trace.steps) - 1,
        step_mm_deg=next((value for value in PLOT_HALF_RANGES if value >= 1.05 * largest), 1.05 * largest),
        width_px=k.width,
        height_px=k.height,
        input_px=trace.steps[0].inputs.shape[-1],
        outside_px=(outside[0].shape[1], outside[0].shape[0]) if outside else None,
        scene_centre_m=(
            0.5 * (x_m + overhead_x_m),
            0.5 * (y_m + overhead_y_m),
            0.30 * recording.station.pregrasp_height_m,
        ),
    )


def _mm_deg(proposal: Proposal) -> tuple[float, float, float]:
    dx_m, dy_m, dangle_rad = proposal.step.tolist()
    return 1e3 * dx_m, 1e3 * dy_m, math.degrees(dangle_rad)


def _log_once(stream: rr.RecordingStream, recording: TrialRecording) -> None:
    trial, trace, spec = recording.trial, recording.trace, recording.station
    log_scene(stream, recording.overhead, spec, recording.scene)
    camera, k = spec.camera, spec.camera.intrinsics
    offset_m = (camera.x_tool_camera_m, camera.y_tool_camera_m, camera.z_tool_camera_m)
    stream.log("world/tool", rr.TransformAxes3D(0.06), static=True)
    stream.log("world/tool/gripper", gripper_boxes(spec.gripper_stroke_m), static=True)
    stream.log(CAMERA, rr.Transform3D(translation=offset_m), static=True)
    stream.log(
        CAMERA,
        rr.Pinhole(
            resolution=(k.width, k.height),
            focal_length=(k.fx, k.fy),
            principal_point=(k.cx + 0.5, k.cy + 0.5),
            image_plane_distance=IMAGE_PLANE_M,
            color=palette.CHOSEN,
            line_width=0.0015,
        ),
        static=True,
    )
    for path, (label, colour) in SERIES.items():
        stream.log(path, rr.SeriesLines(names=label, colors=[colour], widths=2.0), static=True)
        stream.log(path, rr.SeriesPoints(names=label, colors=[colour], markers="circle", marker_sizes=2.5), static=True)
    stream.log("text/trial", trial_summary(recording), static=True)
    stream.log("text/steps", step_table(recording), static=True)
    stream.send_property(
        "trial",
        rr.AnyValues(
            method=trace.method,
            number=trial.number,
            success=trial.success,
            outcome=outcome(recording),
            moves=trial.moves,
            score=trace.grasp_score,
            threshold=trace.threshold,
            confident=trace.confident,
        ),
    )


def _log_gripper(stream: rr.RecordingStream, recording: TrialRecording, number: int) -> None:
    poses = [
        step.pose.pose_base_tool(recording.station.pregrasp_height_m) for step in recording.trace.steps[: number + 1]
    ]
    stream.log("world/tool", rr.Transform3D(translation=poses[-1][:3, 3], mat3x3=poses[-1][:3, :3]))
    path_m = np.array([pose[:3, 3] for pose in poses])  # (number + 1, 3)
    stream.log("world/trajectory/path", rr.LineStrips3D([path_m], colors=[palette.TRAJECTORY], radii=[0.0025]))
    stream.log("world/trajectory/stops", rr.Points3D(path_m, colors=[palette.TRAJECTORY], radii=[0.005]))


def _log_pictures(
    stream: rr.RecordingStream, recording: TrialRecording, step: ServoStep, heatmap: Heatmap | None
) -> None:
    view, inputs = step.view, step.inputs.numpy(force=True)  # (4, size, size)
    height_m = recording.station.pregrasp_height_m - recording.station.camera.z_tool_camera_m
    stream.log(f"{CAMERA}/rgb", jpeg(view.rgb))
    if heatmap is not None:
        log_overlay(stream, f"{CAMERA}/heat", heatmap)
    stream.log(
        f"{CAMERA}/depth",
        depth_png(
            view.depth_m,
            unit_m=recording.station.depth_scale_m,
            range_m=(height_m - palette.TALLEST_M, height_m + palette.BELOW_TABLE_M),
        ),
    )
    stream.log("input/rgb", png(np.rint(255 * inputs[:3].transpose(1, 2, 0)).astype(np.uint8)))
    stream.log("input/height", height_image(inputs[3], top_m=palette.TALLEST_M))


def _log_candidates(stream: rr.RecordingStream, recording: TrialRecording, step: ServoStep) -> None:
    frame = PictureFrame(camera=step.view.camera, plane_m=step.view.plane_m)
    width_m = recording.station.gripper_stroke_m
    log_jaws(stream, f"{CAMERA}/jaws/here", frame, STAY, width_m=width_m, colour=palette.HERE)
    if step.proposal is None:
        # The viewer shows the latest of everything: what the last pass did not choose has to be taken away.
        for path in ("samples", "arrow", "jaws/chosen", "text"):
            stream.log(f"{CAMERA}/{path}", rr.Clear(recursive=True))
        return
    samples, scores = step.proposal.samples.numpy(force=True), step.proposal.scores.numpy(force=True)
    points_px = frame.points(samples)
    stream.log(
        f"{CAMERA}/samples/ring",
        rr.Points2D(points_px, colors=[palette.HERE], radii=rr.Radius.ui_points([3.8]), draw_order=SAMPLES_ORDER),
    )
    stream.log(
        f"{CAMERA}/samples/score",
        rr.Points2D(
            points_px,
            colors=palette.score_rgb(scores),
            radii=rr.Radius.ui_points([2.9]),
            draw_order=SAMPLES_ORDER + 1,
        ),
        rr.AnyValues(score=scores),
    )
    dx_m, dy_m, dangle_rad = step.proposal.step.tolist()
    chosen = (dx_m, dy_m, dangle_rad)
    log_jaws(stream, f"{CAMERA}/jaws/chosen", frame, chosen, width_m=width_m, colour=palette.CHOSEN)
    log_arrow(stream, f"{CAMERA}/arrow", frame, chosen, colour=palette.CHOSEN)
    text = f"S {step.score:.2f} → {step.predicted:.2f}"
    log_label(stream, f"{CAMERA}/text", frame, [STAY, chosen], text, width_m=width_m)


def _log_plots(stream: rr.RecordingStream, trace: ServoTrace, step: ServoStep) -> None:
    stream.log("plots/score/here", rr.Scalars(step.score))
    stream.log("plots/score/threshold", rr.Scalars(trace.threshold))
    if step.proposal is not None:
        stream.log("plots/score/predicted", rr.Scalars(step.predicted))
        for name, value in zip(("dx_mm", "dy_mm", "dangle_deg"), _mm_deg(step.proposal), strict=True):
            stream.log(f"plots/step/{name}", rr.Scalars(value))


def _log_grasp(stream: rr.RecordingStream, recording: TrialRecording) -> None:
    """On the last step: the executed grasp over the picture and, at table height, in the scene."""
    trace, spec = recording.trace, recording.station
    last = trace.steps[-1]
    frame = PictureFrame(camera=last.view.camera, plane_m=last.view.plane_m)
    planar = last.pose.step_to(trace.grasp_pose)
    grasp = (planar.dx_m, planar.dy_m, planar.dangle_rad)
    colour = palette.HELD if recording.trial.success else palette.EMPTY
    if math.hypot(*grasp[:2]) > ARROW_FROM_M:
        log_arrow(stream, f"{CAMERA}/arrow", frame, grasp, colour=colour)
    else:
        stream.log(f"{CAMERA}/jaws/here", rr.Clear(recursive=True))
    missed = not recording.trial.success
    width_m = spec.gripper_stroke_m
    log_jaws(stream, f"{CAMERA}/jaws/grasp", frame, grasp, width_m=width_m, colour=colour, dashed=missed)
    text = f"{outcome(recording)} · S {trace.grasp_score:.2f}"
    log_label(stream, f"{CAMERA}/text", frame, [grasp], text, width_m=spec.gripper_stroke_m)
    pose = trace.grasp_pose.pose_base_tool(0.0)
    start_m = trace.grasp_pose.pose_base_tool(recording.station.pregrasp_height_m)[:3, 3]
    stream.log("world/grasp/jaws", rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
    stream.log("world/grasp/jaws", gripper_boxes(spec.gripper_stroke_m, colour=colour))
    stream.log("world/grasp/descent", rr.LineStrips3D([[start_m, pose[:3, 3]]], colors=[colour], radii=[0.002]))
