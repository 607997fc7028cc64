"""Predicted against happened: what a network says of grasps that were recorded, and where it is wrong."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypedDict

import numpy as np
import torch
from numpy.typing import NDArray

from handsight.datasets.format.schema import Viewpoint
from handsight.datasets.inputs.materialize import grasp_input
from handsight.datasets.reading.reader import GraspDataset
from handsight.evaluation.results import wilson_95
from handsight.evaluation.temperature import Temperature, fit_temperature
from handsight.servoing.planar import PlanarPose
from handsight.servoing.scorer import GraspScorer
from handsight.servoing.scores import check_scores
from handsight.training.errors import HeldOutError
from handsight.training.held_out import held_out_attempts
from handsight.training.run import TrainedRun

MOST_FITTED = 1000
"""Held-out attempts that a temperature is fitted on at most; a few hundred settle it."""
BINS = 10
_BATCH = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class Foresight:
    """One attempt and what the network makes of it, from the picture that was taken before the grasp."""

    attempt: str
    target: str
    held: bool
    raw: float
    """Predicted success of the grasp that was executed, as the network gives it."""
    score: float
    """The same, calibrated where the run allows it."""

    @property
    def surprise(self) -> float:
        """How far the prediction is from what happened: 0 for one that was sure and right, 1 sure and wrong."""
        return 1 - self.score if self.held else self.score


class ReliabilityRow(TypedDict):
    """Attempts whose score lies in one bin."""

    low: float
    high: float
    attempts: int
    mean_score: float
    held: int
    rate: float
    ci95: tuple[float, float]
    """Wilson's interval for the rate."""


def calibrate(run: TrainedRun, dataset: GraspDataset) -> Temperature:
    """The temperature of a run, fitted on what it held out; one that is not fitted says why.

    Args:
        run: The network.
        dataset: A version at hand, beside which those of the run are looked for.
    """
    try:
        parts = held_out_attempts(run.record, beside=dataset)
    except HeldOutError as error:
        return Temperature(source=str(error))
    scorer = run.scorer()
    scores, labels, room = [], [], MOST_FITTED
    for part in parts:
        some = part.attempts[:room]
        room -= len(some)
        if some:
            scores.append(scores_at_grasps(scorer, part.dataset, some, viewpoint=part.viewpoint))
            labels.append(part.dataset.rows(some, ["success"]).loc[list(some), "success"].to_numpy(dtype=np.float32))
    return fit_temperature(np.concatenate(scores), np.concatenate(labels), source="held out from its training")


def learnt_from(run: TrainedRun, dataset: GraspDataset) -> frozenset[str] | None:
    """Ids of the attempts that a run was trained on; None where that cannot be told. Arguments as of `calibrate`."""
    try:
        return frozenset(one for part in held_out_attempts(run.record, beside=dataset) for one in part.learnt)
    except HeldOutError:
        return None


def scores_at_grasps(
    scorer: GraspScorer,
    dataset: GraspDataset,
    attempts: Sequence[str],
    *,
    viewpoint: Viewpoint = "overhead",
    on_attempt: Callable[[], None] | None = None,
) -> NDArray[np.float32]:
    """Predicted success of the grasps that were executed, from the pictures taken before them. Shape (N,).

    Raises:
        ScoreError: A score is not in [0, 1].
        FrameNotFoundError: An attempt has no such picture.
    """
    names = ["pregrasp_x_m", "pregrasp_y_m", "pregrasp_angle_rad"]
    poses = dataset.rows(attempts, names).loc[list(attempts), names].to_numpy(dtype=np.float64)
    scores: list[NDArray[np.float32]] = []
    waiting: list[NDArray[np.float32]] = []

    def score() -> None:
        with torch.no_grad():
            # What a network learns from is stored in half precision.
            inputs = torch.from_numpy(np.stack(waiting).astype(np.float16).astype(np.float32))
            scores.append(scorer(inputs).numpy(force=True))
        waiting.clear()

    for (attempt, frame), (x_m, y_m, angle_rad) in zip(dataset.frames(viewpoint, attempts), poses, strict=True):
        goal = PlanarPose(x_m=float(x_m), y_m=float(y_m), angle_rad=float(angle_rad))
        waiting.append(grasp_input(frame, dataset.station(attempt), goal, scorer.grid))
        if len(waiting) == _BATCH:
            score()
        if on_attempt is not None:
            on_attempt()
    if waiting:
        score()
    found = np.concatenate(scores) if scores else np.empty(0, np.float32)
    check_scores(found, len(attempts))
    return found


def foresights(
    dataset: GraspDataset, attempts: Sequence[str], raw: NDArray[np.float32], temperature: Temperature
) -> list[Foresight]:
    """The scores beside what happened, in the order of the attempts; those without a label are left out."""
    rows = dataset.rows(attempts, ["success", "target"])
    labelled = rows["success"].notna()
    calibrated = temperature(raw)
    found = []
    for attempt, one, score in zip(attempts, raw.tolist(), calibrated.tolist(), strict=True):
        if labelled[attempt]:
            held, target = bool(rows.at[attempt, "success"]), rows.at[attempt, "target"]
            name = target if isinstance(target, str) else ""
            found.append(Foresight(attempt=attempt, target=name, held=held, raw=one, score=score))
    return found


def most_wrong(seen: Iterable[Foresight]) -> list[Foresight]:
    """Those that surprise most first; equals in the order given."""
    return sorted(seen, key=lambda one: -one.surprise)


def reliability_rows(seen: Sequence[Foresight]) -> list[ReliabilityRow]:
    """How often grasps held of those that the network gave about the same score; empty bins are left out."""
    edges = np.linspace(0, 1, BINS + 1).tolist()
    rows = []
    for low, high in pairwise(edges):
        inside = [one for one in seen if low <= one.score < high or (high == 1.0 and one.score == 1.0)]
        if inside:
            held = sum(one.held for one in inside)
            rows.append(
                ReliabilityRow(
                    low=low,
                    high=high,
                    attempts=len(inside),
                    mean_score=float(np.mean([one.score for one in inside])),
                    held=held,
                    rate=held / len(inside),
                    ci95=wilson_95(held, len(inside)),
                )
            )
    return rows
