"""Pictures of trials that failed: what the camera saw last, and the grasp that was chosen from it."""

from __future__ import annotations

from collections.abc import Sequence

from handsight.datasets.errors import counted
from handsight.evaluation.causes import cause_of
from handsight.evaluation.trial import TrialRecording
from handsight.viz import palette
from handsight.viz.pixels import PictureFrame
from handsight.viz.report.content import Figure, Gallery
from handsight.viz.report.embedding import embedded_rgb
from handsight.viz.report.gallery import WIDTH_PX, marked_picture

MOST_PICTURES = 12


def failed_trials(recordings: Sequence[tuple[TrialRecording, str]], *, text: str) -> Gallery | None:
    """One picture of each trial; None where there is none.

    Args:
        recordings: Trials that failed, of methods that servo, each with the call that shows it step by step.
        text: How they were chosen.
    """
    pictures = tuple(_picture(*one) for one in recordings[:MOST_PICTURES])
    if not pictures:
        return None
    return Gallery(
        title=f"{counted(len(pictures), 'trial')} that failed",
        text=f"{text} The mark is the pair of open jaws of the grasp, on the last picture before it.",
        pictures=pictures,
    )


def _picture(recording: TrialRecording, command: str) -> Figure:
    trial, trace, station = recording.trial, recording.trace, recording.station
    last = trace.steps[-1]
    step = last.pose.step_to(trace.grasp_pose)
    frame = PictureFrame(camera=last.view.camera, plane_m=last.view.plane_m)
    marked = marked_picture(
        last.view.rgb,
        frame,
        (step.dx_m, step.dy_m, step.dangle_rad),
        width_m=station.gripper_stroke_m,
        colour=palette.EMPTY,
        dashed=True,
    )
    sure = "above the threshold" if trace.confident else "below the threshold"
    cause = cause_of(trial, station.closed_width_m) or "it held"
    what = f"{trace.method}, trial {trial.number}"
    return Figure(
        picture=embedded_rgb(marked, width_px=WIDTH_PX),
        alt=f"The last picture of {what}, with the jaws of the grasp that failed drawn in.",
        caption=(
            f"{what}: S {trace.grasp_score:.2f}, {sure}, after {counted(trial.moves, 'move')}; "
            f"{trial.failure or cause}."
        ),
        command=command,
    )
