"""What ``handsight dataset suspect`` does: progress bars around the review of labels, and its recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from handsight.cli.errors import EXPECTED, CommandError
from handsight.cli.output import progress_bar
from handsight.datasets.inputs.materialize import GraspInputs, materialize
from handsight.datasets.inputs.viewpoint import DEFAULT_VIEWPOINT
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.records import RgbdFrame
from handsight.datasets.views import station_view
from handsight.evaluation.label_issues import LabelIssue, LabelReview, rank_label_issues
from handsight.evaluation.label_review import ReviewPlan, collect_faults, curation_commands, plan_review
from handsight.servoing.homography import InputGrid
from handsight.servoing.planar import PlanarPose
from handsight.training.course import Epoch
from handsight.training.cross_validation import out_of_fold_scores
from handsight.viz.examples import LabelIssueExample
from handsight.viz.recordings.label_issues import write_label_issues
from handsight.viz.recordings.recording import check_recording_path


def checked_plan(
    dataset: GraspDataset, *, folds: str, epochs: int, where: str, seed: int, rrd: Path | None
) -> ReviewPlan:
    """Check all options before the first network is trained; reads no picture and writes nothing.

    Raises:
        CommandError: Some of the options make no sense here; every fault is in the message.
    """
    faults: list[str] = []
    with collect_faults(faults, EXPECTED):
        plan = plan_review(dataset, folds=folds, epochs=epochs, where=where, seed=seed)
    with collect_faults(faults, EXPECTED):
        if rrd is not None:
            check_recording_path(rrd)
    if faults:
        raise CommandError("; ".join(faults))
    return plan


def review_labels(dataset: GraspDataset, plan: ReviewPlan, count: int) -> tuple[GraspInputs, LabelReview]:
    """Train and rank behind progress bars; returns what was judged, and at most ``count`` issues of those listed."""
    grid = InputGrid(size_px=plan.settings.network.size_px)
    with progress_bar("warp", len(plan.listed)) as bar:
        data = materialize(dataset, viewpoint=DEFAULT_VIEWPOINT, grid=grid, on_attempt=bar.advance)
    scores = cross_validated_scores(data, plan)
    return data, rank_label_issues(data.attempts, scores, listed=plan.listed, count=count)


def cross_validated_scores(data: GraspInputs, plan: ReviewPlan) -> NDArray[np.float32]:
    """Scores of all attempts by networks that never saw them, behind a progress bar."""
    folds, epochs = len(np.unique(plan.fold_of_attempt)), plan.settings.epochs
    done = 0
    with progress_bar("train", folds * epochs) as bar:

        def show(epoch: Epoch) -> None:
            nonlocal done
            done += 1
            bar.advance(f"network {(done - 1) // epochs + 1} of {folds}, loss {epoch.train_loss:.3f}")

        return out_of_fold_scores(data, plan.fold_of_attempt, plan.settings, on_epoch=show)


def write_review(path: Path, dataset: GraspDataset, data: GraspInputs, issues: Sequence[LabelIssue]) -> None:
    """Write the issues as a recording, one a step."""
    positions = data.attempts.index.get_indexer(pd.Index([issue.attempt for issue in issues]))
    examples = []
    with progress_bar("record", len(issues)) as bar:
        frames = dataset.frames(DEFAULT_VIEWPOINT, [issue.attempt for issue in issues])
        for issue, position, (_, frame) in zip(issues, positions, frames, strict=True):
            row, inputs = data.attempts.iloc[position], data.inputs[position]
            examples.append(_example(dataset, issue, row, frame, inputs))
            bar.advance()
    write_label_issues(path, examples)


def _example(
    dataset: GraspDataset, issue: LabelIssue, row: pd.Series[Any], frame: RgbdFrame, inputs: NDArray[np.float16]
) -> LabelIssueExample:
    spec = dataset.station(issue.attempt)
    goal = PlanarPose(x_m=row["pregrasp_x_m"], y_m=row["pregrasp_y_m"], angle_rad=row["pregrasp_angle_rad"])
    step = PlanarPose.from_pose_base_tool(frame.pose_base_tool).step_to(goal)
    return LabelIssueExample(
        issue=issue,
        view=station_view(frame, spec),
        grasp=(step.dx_m, step.dy_m, step.dangle_rad),
        inputs=inputs,
        jaws_m=spec.gripper_stroke_m,
        widths_m=(row["width_before_m"], row["width_closed_m"], row["width_lifted_m"], row["width_final_m"]),
        closed_width_m=spec.closed_width_m,
        commands=curation_commands(dataset, issue),
    )
