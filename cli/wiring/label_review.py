"""What ``handsight dataset suspect`` does: divide, cross-validate, rank, record."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from handsight.cli.errors import EXPECTED, CommandError
from handsight.cli.output import progress_bar
from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.curation.folds import read_folds
from handsight.datasets.errors import counted
from handsight.datasets.format.schema import Viewpoint
from handsight.datasets.inputs.materialize import GraspInputs, materialize, usable_attempts
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.reading.selection import matches
from handsight.datasets.records import RgbdFrame
from handsight.datasets.views import station_view
from handsight.evaluation.label_issues import LabelIssue, LabelReview, rank_label_issues, review_folds
from handsight.servoing.homography import InputGrid
from handsight.servoing.planar import PlanarPose
from handsight.training.cross_validation import check_folds, out_of_fold_scores
from handsight.training.trainer import Epoch, TrainSettings
from handsight.viz.examples import LabelIssueExample
from handsight.viz.recordings.label_issues import write_label_issues
from handsight.viz.recordings.recording import check_recording_path

VIEWPOINT: Viewpoint = "overhead"
"""The picture that every attempt has; ``handsight train`` learns from it too, so both share a cache."""

FOLDS = 3
"""Folds made when no stored ones are named: with more, each network sees a little more and all take longer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReviewPlan:
    """Everything that was asked for, checked before the first network is trained."""

    settings: TrainSettings
    fold_of_attempt: NDArray[np.integer[Any]]
    """Shape (N,)."""
    listed: NDArray[np.bool_]
    """Which attempts may be listed. Shape (N,)."""


def plan_review(
    dataset: GraspDataset, *, folds: str, epochs: int, where: str, seed: int, rrd: Path | None
) -> ReviewPlan:
    """Check the options against the version; reads no picture and writes nothing.

    Raises:
        NoTrainingDataError: The version holds no labelled attempt.
        CommandError: Some of the options make no sense here; every fault is in the message.
    """
    attempts = usable_attempts(dataset, VIEWPOINT)
    faults: list[str] = []
    with _noted(faults):
        settings = TrainSettings(epochs=epochs, seed=seed)
    with _noted(faults):
        listed = _listed(attempts, where)
    with _noted(faults):
        fold_of_attempt = _folds(dataset, attempts, folds, seed)
    with _noted(faults):
        if rrd is not None:
            check_recording_path(rrd)
    if faults:
        raise CommandError("; ".join(faults))
    return ReviewPlan(settings=settings, fold_of_attempt=fold_of_attempt, listed=listed)


@contextmanager
def _noted(faults: list[str]) -> Iterator[None]:
    """Add what is wrong to a list and go on, so that all of it is reported at once."""
    try:
        yield
    except EXPECTED as error:
        faults.append(str(error))


def _folds(dataset: GraspDataset, attempts: pd.DataFrame, name: str, seed: int) -> NDArray[np.integer[Any]]:
    """The stored folds of that name, or folds for this review alone where none is given."""
    folds = (
        read_folds(dataset, name).fold[attempts.index].to_numpy()
        if name
        else review_folds(attempts, count=FOLDS, seed=seed)
    )
    check_folds(attempts["success"].to_numpy(dtype=np.float32), folds)
    return folds


def _listed(attempts: pd.DataFrame, where: str) -> NDArray[np.bool_]:
    listed = matches(attempts, where).to_numpy(dtype=bool) if where else np.ones(len(attempts), bool)
    if not listed.any():
        raise CommandError(
            f"--where {where!r} holds for none of {counted(len(attempts), 'labelled attempt')}: loosen it"
        )
    return listed


def review_labels(dataset: GraspDataset, plan: ReviewPlan, count: int) -> tuple[GraspInputs, LabelReview]:
    """Train and rank behind progress bars; returns what was judged with the ``count`` most doubted of those listed."""
    grid = InputGrid(size_px=plan.settings.network.size_px)
    with progress_bar("warp", len(plan.listed)) as bar:
        data = materialize(dataset, viewpoint=VIEWPOINT, grid=grid, on_attempt=bar.advance)
    scores = _scores(data, plan)
    return data, rank_label_issues(data.attempts, scores, listed=plan.listed, count=count)


def _scores(data: GraspInputs, plan: ReviewPlan) -> NDArray[np.float32]:
    folds, epochs = len(np.unique(plan.fold_of_attempt)), plan.settings.epochs
    done = 0
    with progress_bar("doubt", folds * epochs) as bar:

        def show(epoch: Epoch) -> None:
            nonlocal done
            done += 1
            bar.advance(f"network {(done - 1) // epochs + 1} of {folds}, loss {epoch.train_loss:.3f}")

        return out_of_fold_scores(data, plan.fold_of_attempt, plan.settings, on_epoch=show)


def write_review(path: Path, dataset: GraspDataset, data: GraspInputs, suspects: Sequence[LabelIssue]) -> None:
    """Write the suspects as a recording, one a step."""
    positions = data.attempts.index.get_indexer(pd.Index([one.attempt for one in suspects]))
    examples = []
    with progress_bar("record", len(suspects)) as bar:
        pictures = dataset.frames(VIEWPOINT, [one.attempt for one in suspects])
        for suspect, position, (_, frame) in zip(suspects, positions, pictures, strict=True):
            row, inputs = data.attempts.iloc[position], data.inputs[position]
            examples.append(_example(dataset, suspect, row, frame, inputs))
            bar.advance()
    write_label_issues(path, examples)


def _example(
    dataset: GraspDataset, suspect: LabelIssue, row: pd.Series[Any], frame: RgbdFrame, inputs: NDArray[np.float16]
) -> LabelIssueExample:
    spec = dataset.station(suspect.attempt)
    goal = PlanarPose(x_m=row["pregrasp_x_m"], y_m=row["pregrasp_y_m"], angle_rad=row["pregrasp_angle_rad"])
    step = PlanarPose.from_pose_base_tool(frame.pose_base_tool).step_to(goal)
    return LabelIssueExample(
        suspect=suspect,
        view=station_view(frame, spec),
        grasp=(step.dx_m, step.dy_m, step.dangle_rad),
        inputs=inputs,
        jaws_m=spec.gripper_stroke_m,
        widths_m=(row["width_before_m"], row["width_closed_m"], row["width_lifted_m"], row["width_final_m"]),
        closed_width_m=spec.closed_width_m,
        commands=commands(dataset, suspect),
    )


def commands(dataset: GraspDataset, suspect: LabelIssue) -> tuple[str, str]:
    """The commands that correct the label and that set the attempt aside, ready to paste into a shell."""
    place = shlex.quote(curated_place(dataset))
    reason = shlex.quote(f"doubted {suspect.label}, S {suspect.predicted_success:.2f}")
    call = "handsight dataset"
    return (
        f"{call} relabel {place} {suspect.attempt} --to {suspect.other_label} -m {reason}",
        f"{call} exclude {place} {suspect.attempt} -m {reason}",
    )


def curated_place(dataset: GraspDataset) -> str:
    """The branch on which to curate what this version holds: its own, or ``main`` where it is no branch."""
    path = str(dataset.repository.path)
    on_branch = dataset.ref != DEFAULT_REF and dataset.ref in dataset.repository.branches()
    return f"{path}@{dataset.ref}" if on_branch else path
