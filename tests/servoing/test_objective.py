"""Predictions do not depend on the batch they are made in."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
import torch
from tests.support.drawn_table import BRIGHTNESS, GRID, START, DrawnTable
from tests.support.scorers import FunctionScorer

from handsight.servoing.errors import ScoreError
from handsight.servoing.objective import Objective


def test_predictions_do_not_depend_on_the_batch() -> None:
    view, _ = DrawnTable(START).look()
    objective = Objective(view, BRIGHTNESS)
    steps = torch.from_numpy(np.random.default_rng(0).normal(size=(9, 3)).astype(np.float32) * 0.05)
    alone = torch.stack([objective(step[None])[0] for step in steps])
    torch.testing.assert_close(objective(steps), alone)


def test_only_what_the_scorer_reads_is_predicted() -> None:
    view, _ = DrawnTable(START).look()
    reading = ReadsTwenty(lambda inputs: inputs[:, 0, :20, :20].mean((1, 2)), GRID)
    steps = torch.tensor([[0.01, -0.02, 0.3], [0.0, 0.05, -1.2]])
    objective = Objective(view, reading)
    torch.testing.assert_close(objective(steps), objective.scores(objective.inputs(steps)))
    assert [shape[-2:] for shape in reading.shapes] == [(20, 20), (32, 32)]


@dataclass(frozen=True, slots=True)
class ReadsTwenty(FunctionScorer):
    """A scorer of the first rows and columns that notes what it is given."""

    shapes: list[tuple[int, ...]] = field(default_factory=list)
    reach_px: int = 20

    def __call__(self, inputs: torch.Tensor) -> torch.Tensor:
        self.shapes.append(tuple(inputs.shape))
        return self.function(inputs)


def test_the_gradient_of_the_predicted_success_is_that_of_finite_differences() -> None:
    """What exact gradient ascent climbs, through the resampled picture; in double precision, so that it is no guess."""
    view, _ = DrawnTable(START).look()
    objective = Objective(view, FunctionScorer(lambda inputs: torch.sigmoid(inputs.mean((1, 2, 3))), GRID))
    steps = torch.tensor([[0.011, -0.007, 0.1], [-0.02, 0.013, -0.3]], dtype=torch.float64, requires_grad=True)
    (gradient,) = torch.autograd.grad(objective(steps).sum(), steps)
    nudge = 1e-6
    expected = torch.zeros_like(gradient)
    for axis in range(3):
        by = torch.zeros(3, dtype=torch.float64)
        by[axis] = nudge
        with torch.no_grad():
            expected[:, axis] = (objective(steps + by) - objective(steps - by)) / (2 * nudge)
    assert gradient.abs().max() > 0.01
    torch.testing.assert_close(gradient, expected, rtol=1e-4, atol=1e-6)


def test_steps_that_ask_for_no_gradient_keep_nothing_for_one() -> None:
    view, _ = DrawnTable(START).look()
    assert not Objective(view, BRIGHTNESS)(torch.zeros(2, 3)).requires_grad


def test_another_number_of_scores_than_steps_is_refused() -> None:
    view, _ = DrawnTable(START).look()
    objective = Objective(view, FunctionScorer(lambda inputs: inputs[:, 0, :1, 0], GRID))
    with pytest.raises(ScoreError, match=r"shape \(2, 1\), expected \(2,\)"):
        objective(torch.zeros(2, 3))
