"""One servo run as a file: what was seen, what was chosen, what came of it; ``trace_log.py`` has the entities.

The last step also shows the grasp that was executed, in the colour of its label.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handsight.datasets.errors import counted
from handsight.evaluation.trial import TrialRecording
from handsight.evaluation.watching import TrialStart
from handsight.servoing.heatmap import Heatmap
from handsight.viz.errors import RecordingError
from handsight.viz.pixels import place_heatmap
from handsight.viz.recordings.arm_drawing import DrawnArm
from handsight.viz.recordings.layouts import TraceRanges, trace_blueprint
from handsight.viz.recordings.recording import write_recording
from handsight.viz.recordings.trace_log import TraceLog, mm_deg

KIND = "handsight_servo_trace"
HALF_RANGES = (5.5, 11.0, 22.0, 33.0, 55.0, 110.0)
"""Ranges of the plots of steps [mm or degrees]; over others the viewer labels nothing but 0 on the axis."""
TIME_RANGES_MS = (22.0, 55.0, 110.0, 220.0, 550.0, 1100.0, 2200.0, 5500.0)


def write_servo_trace(
    path: Path,
    recording: TrialRecording,
    heatmaps: Sequence[Heatmap] | None = None,
    outside: Sequence[NDArray[np.uint8]] | None = None,
    arm: DrawnArm | None = None,
) -> None:
    """Write a trial as a self-contained ``.rrd`` with its layout.

    Args:
        path: The file to write; an existing one is replaced, and nothing is left behind on an error.
        recording: The trial with everything seen.
        heatmaps: One map per step of the trace, drawn over the pictures; None draws none.
        outside: One picture of the station per step, each (H, W, 3); None shows none.
        arm: The station's arm; None draws its gripper alone.

    Raises:
        RecordingError: The trace is empty, maps or pictures do not match its steps, or ``path`` cannot be written.
    """
    trace = recording.trace
    _check(recording, heatmaps, outside)
    name = f"{trace.method}-{recording.trial.number:06d}"
    blueprint = trace_blueprint(_ranges(recording, outside))
    with write_recording(path, kind=KIND, name=name, blueprint=blueprint) as stream:
        log = TraceLog(stream, trial_start(recording), arm)
        log.begin()
        for number, step in enumerate(trace.steps):
            log.step(
                step,
                heatmaps[number] if heatmaps is not None else None,
                outside[number] if outside is not None else None,
            )
        log.end(recording)


def trial_start(recording: TrialRecording) -> TrialStart:
    """What was known of a trial before its first step."""
    return TrialStart(
        method=recording.trace.method,
        number=recording.trial.number,
        threshold=recording.trace.threshold,
        station=recording.station,
        overhead=recording.overhead,
        scene=recording.scene,
    )


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
    steps = recording.trace.steps
    chosen = np.abs([mm_deg(step.proposal) for step in steps if step.proposal] or [(0.0, 0.0, 0.0)])
    x_m, y_m = np.mean([(step.pose.x_m, step.pose.y_m) for step in steps], axis=0).tolist()
    times_ms = [1e3 * value for step in steps for value in (step.look_s, step.compute_s)]
    slopes = [
        step.proposal.gradient.abs().max() for step in steps if step.proposal and step.proposal.gradient is not None
    ]
    return TraceRanges.of(
        recording.station,
        recording.overhead,
        last_step=len(steps) - 1,
        middle_m=(x_m, y_m),
        step_mm=_range(float(chosen[:, :2].max()), HALF_RANGES),
        turn_deg=_range(float(chosen[:, 2].max()), HALF_RANGES),
        time_ms=_range(max(times_ms), TIME_RANGES_MS),
        slope=1.1 * float(max(slopes)) if slopes else None,
        input_px=steps[0].inputs.shape[-1],
        outside_px=(outside[0].shape[1], outside[0].shape[0]) if outside else None,
    )


def _range(largest: float, ranges: Sequence[float]) -> float:
    return next((value for value in ranges if value >= 1.05 * largest), 1.05 * largest)
