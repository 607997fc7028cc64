"""What a servo run shows, step by step: the same entities in a file that is written later and in a viewer that watches.

Step k of the timeline ``servo_step`` is pass k of the loop. Entities:

    world/{table, objects}                              the scene, once
    world/arm                                           the arm's links at every step, where its model is known
    world/tool/{gripper, camera}                        gripper and camera at every step
    world/tool/camera/{rgb, depth}                      pictures, in raw pixels
    world/tool/camera/{muted, heat, contour}            predicted success, over little colour; threshold around it
    world/tool/camera/{samples, arrow, gradient, jaws, text}    what was scored and chosen, over the pictures
    world/tool/camera/scale                             colours of scores
    world/{trajectory, grasp}                           where the tool has been, where it grasped
    scene/rgb                                           the station from outside, where pictures of it were given
    input/{rgb, height}                                 the network's input
    next/{predicted, observed, difference}              the input that the chosen step was to lead to, and that it did
    plots/score/{here, predicted, threshold}            success metrics
    plots/step/{dx_mm, dy_mm}, plots/turn/dangle_deg    the chosen steps
    plots/gradient/{x, y, angle}                        slope of S in sampling ranges, where the method has one
    plots/time/{look_ms, compute_ms}                    how long a step took
    text/{trial, steps}                                 summary and table
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from handsight.evaluation.trial import TrialRecording
from handsight.evaluation.watching import TrialStart
from handsight.servoing.heatmap import Heatmap
from handsight.servoing.loop import ServoStep
from handsight.servoing.optimiser import Proposal
from handsight.viz import palette
from handsight.viz.heat_look import contours, muted
from handsight.viz.pixels import CENTRE_PX, PictureFrame, Step
from handsight.viz.recordings.arm_drawing import DrawnArm, log_arm, log_arm_shape
from handsight.viz.recordings.encoding import (
    depth_png,
    difference_image,
    encoded_png,
    height_image,
    jpeg,
    log_overlay,
    png,
)
from handsight.viz.recordings.glyphs import STAY, gripper_boxes, log_arrow, log_jaws, log_label, log_outlined
from handsight.viz.recordings.layouts import CAMERA, OUTSIDE, TIMELINE
from handsight.viz.recordings.scales import score_scale
from handsight.viz.recordings.scene import log_hand_camera, log_scene
from handsight.viz.recordings.summary import cause, outcome, step_table, trial_summary, under_way

MUTED_ORDER = 5.0
"""Over the picture in its colours, under heat."""
SAMPLES_ORDER = 20.0
ARROW_FROM_M = 0.001
"""A grasp nearer than this is executed from here: it needs no arrow, and its jaws would cover those shown."""
GRADIENT_M = 0.10
"""Length that the arrow of a gradient approaches as it gets steeper [m]."""
STEEP = 0.1
"""Gradient, in S per sampling range, whose arrow is half as long."""
MOST_SAMPLES = 1500
"""Of a step are shown."""
NO_NEXT = "no next view"
NOTE_PX = 32.0
SERIES = {
    "plots/score/here": ("S(p)", palette.MEASURED),
    "plots/score/predicted": ("S(p+Δp)", palette.CHOSEN),
    "plots/score/threshold": ("threshold", palette.THRESHOLD),
    "plots/step/dx_mm": ("Δx [mm]", palette.AXIS_X),
    "plots/step/dy_mm": ("Δy [mm]", palette.AXIS_Y),
    "plots/turn/dangle_deg": ("Δθ [°]", palette.TURN),
    "plots/time/look_ms": ("look [ms]", palette.MEASURED),
    "plots/time/compute_ms": ("compute [ms]", palette.CHOSEN),
    "plots/gradient/x": ("∂S/∂x", palette.AXIS_X),
    "plots/gradient/y": ("∂S/∂y", palette.AXIS_Y),
    "plots/gradient/angle": ("∂S/∂θ", palette.TURN),
}


@dataclass(slots=True)
class TraceLog:
    """Logs one servo run to a stream."""

    stream: rr.RecordingStream
    start: TrialStart
    arm: DrawnArm | None = None
    """The station's arm; None draws its gripper alone."""
    live: bool = False
    """Whether somebody watches, who is told how far the run is until there is a summary."""
    _steps: list[ServoStep] = field(default_factory=list)

    def begin(self) -> None:
        """Log what does not move."""
        start, stream = self.start, self.stream
        log_scene(stream, start.overhead, start.station, start.scene)
        if self.arm is not None:
            log_arm_shape(stream, self.arm)
        stream.log("world/tool", rr.TransformAxes3D(0.06), static=True)
        stream.log("world/tool/gripper", gripper_boxes(start.station.gripper_stroke_m), static=True)
        log_hand_camera(stream, start.station)
        k = start.station.camera.intrinsics
        stream.log(
            f"{CAMERA}/scale",
            encoded_png(
                score_scale(k.width, name=f"S · line: threshold {start.threshold:.2f}", threshold=start.threshold)
            ),
            rr.Transform3D(translation=(0.0, float(k.height), 0.0)),
            static=True,
        )
        for path, (label, colour) in SERIES.items():
            stream.log(path, rr.SeriesLines(names=label, colors=[colour], widths=2.0), static=True)
            stream.log(
                path, rr.SeriesPoints(names=label, colors=[colour], markers="circle", marker_sizes=2.5), static=True
            )

    def step(self, step: ServoStep, heatmap: Heatmap | None = None, outside: NDArray[np.uint8] | None = None) -> None:
        """Log the next pass of the loop, with a heatmap and a picture of the station where there are any."""
        number, stream = len(self._steps), self.stream
        if self._steps:
            self._log_observed(step)
        self._steps.append(step)
        stream.set_time(TIMELINE, sequence=number)
        self._log_poses()
        self._log_pictures(step, heatmap)
        self._log_candidates(step)
        self._log_predicted(step)
        self._log_plots(step)
        if outside is not None:
            stream.log(OUTSIDE, jpeg(outside))
        if self.live:
            stream.log("text/trial", under_way(self.start.method, self.start.number, len(self._steps), step.score))

    def end(self, recording: TrialRecording) -> None:
        """Log the grasp, in the colour of what came of it, and the summary."""
        trial, trace, stream = recording.trial, recording.trace, self.stream
        stream.set_time(TIMELINE, sequence=max(0, len(self._steps) - 1))
        self._log_grasp(recording)
        stream.log("text/trial", trial_summary(recording), static=True)
        stream.log("text/steps", step_table(recording), static=True)
        stream.send_property(
            "trial",
            rr.AnyValues(
                method=trace.method,
                number=trial.number,
                success=trial.success,
                outcome=outcome(recording),
                cause=cause(recording) or "none",
                moves=trial.moves,
                final_score=trace.grasp_score,
                threshold=trace.threshold,
                confident=trace.confident,
            ),
        )

    def _log_poses(self) -> None:
        height_m = self.start.station.pregrasp_height_m
        poses = [step.pose.pose_base_tool(height_m) for step in self._steps]
        stream = self.stream
        stream.log("world/tool", rr.Transform3D(translation=poses[-1][:3, 3], mat3x3=poses[-1][:3, :3]))
        if self.arm is not None:
            log_arm(stream, self.arm, poses[-1])
        path_m = np.array([pose[:3, 3] for pose in poses])  # (number + 1, 3)
        stream.log("world/trajectory/path", rr.LineStrips3D([path_m], colors=[palette.TRAJECTORY], radii=[0.0025]))
        stream.log("world/trajectory/stops", rr.Points3D(path_m, colors=[palette.TRAJECTORY], radii=[0.005]))

    def _log_pictures(self, step: ServoStep, heatmap: Heatmap | None) -> None:
        view, inputs, stream, spec = step.view, step.inputs.numpy(force=True), self.stream, self.start.station
        height_m = spec.pregrasp_height_m - spec.camera.z_tool_camera_m
        stream.log(f"{CAMERA}/rgb", jpeg(view.rgb))
        if heatmap is not None:
            stream.log(f"{CAMERA}/muted", jpeg(muted(view.rgb), draw_order=MUTED_ORDER))
            log_overlay(stream, f"{CAMERA}/heat", heatmap)
            lines = [line + CENTRE_PX for line in contours(heatmap, self.start.threshold)]
            log_outlined(stream, f"{CAMERA}/contour", lines)
        range_m = (height_m - palette.TALLEST_M, height_m + palette.BELOW_TABLE_M)
        stream.log(f"{CAMERA}/depth", depth_png(view.depth_m, unit_m=spec.depth_scale_m, range_m=range_m))
        stream.log("input/rgb", png(_colours(inputs)))
        stream.log("input/height", height_image(inputs[3], top_m=palette.TALLEST_M))

    def _log_candidates(self, step: ServoStep) -> None:
        stream, frame, width_m = self.stream, _frame(step), self.start.station.gripper_stroke_m
        log_jaws(stream, f"{CAMERA}/jaws/here", frame, STAY, width_m=width_m, colour=palette.HERE)
        if step.proposal is None:
            # The viewer shows the latest of everything: what the last pass did not choose has to be taken away.
            for path in ("samples", "arrow", "gradient", "jaws/chosen", "text"):
                stream.log(f"{CAMERA}/{path}", rr.Clear(recursive=True))
            return
        _log_samples(stream, step.proposal, frame)
        dx_m, dy_m, dangle_rad = step.proposal.step.tolist()
        chosen = (dx_m, dy_m, dangle_rad)
        log_jaws(stream, f"{CAMERA}/jaws/chosen", frame, chosen, width_m=width_m, colour=palette.CHOSEN, above=2.0)
        log_arrow(stream, f"{CAMERA}/arrow", frame, chosen, colour=palette.CHOSEN)
        if step.proposal.gradient is not None:
            uphill = _uphill(step.proposal.gradient.tolist())
            log_arrow(stream, f"{CAMERA}/gradient", frame, uphill, colour=palette.TRAJECTORY)
        text = f"S {step.score:.2f} → {step.predicted:.2f}"
        log_label(stream, f"{CAMERA}/text", frame, [STAY, chosen], text, width_m=width_m)

    def _log_predicted(self, step: ServoStep) -> None:
        """The view that the chosen step is to lead to; what it really leads to is logged with the next pass."""
        if step.predicted_inputs is not None:
            self.stream.log("next/predicted", png(_colours(step.predicted_inputs.numpy(force=True))))
            return
        blank = np.zeros(step.inputs.shape[-2:], np.float32)
        self.stream.log("next/predicted", png(_colours(np.stack([blank] * 3))))
        self.stream.log("next/observed", png(_colours(np.stack([blank] * 3))))
        self.stream.log("next/difference", difference_image(blank))
        for name in ("predicted", "observed", "difference"):
            note = rr.Points2D(
                [[NOTE_PX, NOTE_PX]], radii=[0.0], labels=[NO_NEXT], colors=[palette.HERE], show_labels=True
            )
            self.stream.log(f"next/{name}/note", note)

    def _log_observed(self, step: ServoStep) -> None:
        """What the step before this pass led to, at the time of that step."""
        before = self._steps[-1]
        if before.predicted_inputs is None:
            return
        predicted, observed = (one.numpy(force=True)[:3] for one in (before.predicted_inputs, step.inputs))
        self.stream.set_time(TIMELINE, sequence=len(self._steps) - 1)
        self.stream.log("next/observed", png(_colours(observed)))
        self.stream.log("next/difference", difference_image(np.abs(predicted - observed).mean(axis=0)))

    def _log_plots(self, step: ServoStep) -> None:
        stream = self.stream
        stream.log("plots/score/here", rr.Scalars(step.score))
        stream.log("plots/score/threshold", rr.Scalars(self.start.threshold))
        stream.log("plots/time/look_ms", rr.Scalars(1e3 * step.look_s))
        stream.log("plots/time/compute_ms", rr.Scalars(1e3 * step.compute_s))
        if step.proposal is None:
            return
        stream.log("plots/score/predicted", rr.Scalars(step.predicted))
        dx_mm, dy_mm, dangle_deg = mm_deg(step.proposal)
        stream.log("plots/step/dx_mm", rr.Scalars(dx_mm))
        stream.log("plots/step/dy_mm", rr.Scalars(dy_mm))
        stream.log("plots/turn/dangle_deg", rr.Scalars(dangle_deg))
        if step.proposal.gradient is not None:
            for name, slope in zip(("x", "y", "angle"), step.proposal.gradient.tolist(), strict=True):
                stream.log(f"plots/gradient/{name}", rr.Scalars(slope))

    def _log_grasp(self, recording: TrialRecording) -> None:
        """On the last step: the executed grasp over the picture and, at table height, in the scene."""
        trace, spec, stream = recording.trace, recording.station, self.stream
        last = trace.steps[-1]
        frame = _frame(last)
        planar = last.pose.step_to(trace.grasp_pose)
        grasp = (planar.dx_m, planar.dy_m, planar.dangle_rad)
        colour = palette.HELD if recording.trial.success else palette.EMPTY
        if math.hypot(*grasp[:2]) > ARROW_FROM_M:
            log_arrow(stream, f"{CAMERA}/arrow", frame, grasp, colour=colour)
        else:
            stream.log(f"{CAMERA}/jaws/here", rr.Clear(recursive=True))
        missed, width_m = not recording.trial.success, spec.gripper_stroke_m
        log_jaws(
            stream,
            f"{CAMERA}/jaws/grasp",
            frame,
            grasp,
            width_m=width_m,
            colour=colour,
            dashed=missed,
            above=2.0,
        )
        text = f"{outcome(recording)} · S {trace.grasp_score:.2f}"
        log_label(stream, f"{CAMERA}/text", frame, [grasp], text, width_m=spec.gripper_stroke_m)
        pose = trace.grasp_pose.pose_base_tool(0.0)
        start_m = trace.grasp_pose.pose_base_tool(spec.pregrasp_height_m)[:3, 3]
        stream.log("world/grasp/jaws", rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
        stream.log("world/grasp/jaws", gripper_boxes(spec.gripper_stroke_m, colour=colour))
        stream.log("world/grasp/descent", rr.LineStrips3D([[start_m, pose[:3, 3]]], colors=[colour], radii=[0.002]))


def _uphill(gradient: Sequence[float]) -> Step:
    """Where S rises on the table, as a step whose length grows with the slope and stays within the picture."""
    slope_x, slope_y, _ = gradient
    share = GRADIENT_M / (math.hypot(slope_x, slope_y) + STEEP)
    return share * slope_x, share * slope_y, 0.0


def mm_deg(proposal: Proposal) -> tuple[float, float, float]:
    """A chosen step in millimetres and degrees."""
    dx_m, dy_m, dangle_rad = proposal.step.tolist()
    return 1e3 * dx_m, 1e3 * dy_m, math.degrees(dangle_rad)


def _log_samples(stream: rr.RecordingStream, proposal: Proposal, frame: PictureFrame) -> None:
    scores = proposal.scores.numpy(force=True)
    points_px = frame.points(proposal.samples.numpy(force=True))
    if len(scores) > MOST_SAMPLES:
        # A search over the whole picture scores tens of thousands: the best show where it looked, the others do not.
        best = np.sort(np.argpartition(scores, -MOST_SAMPLES)[-MOST_SAMPLES:])
        scores, points_px = scores[best], points_px[best]
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


def _frame(step: ServoStep) -> PictureFrame:
    return PictureFrame(camera=step.view.camera, plane_m=step.view.plane_m)


def _colours(inputs: NDArray[np.float32]) -> NDArray[np.uint8]:
    """The colours of a network input. (>=3, size, size) -> (size, size, 3)."""
    return np.rint(255 * np.clip(inputs[:3], 0, 1).transpose(1, 2, 0)).astype(np.uint8)
