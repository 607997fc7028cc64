"""Optimisers on objectives whose best step is known."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from handsight.servoing.errors import ServoSettingsError
from handsight.servoing.methods.cem import Cem
from handsight.servoing.methods.first_order import FirstOrder, regress_gradient
from handsight.servoing.optimiser import Method, ScoreSteps
from handsight.servoing.sampling import StepRange

WIDTH = torch.tensor([0.05, 0.05, 0.5])
METHODS: dict[str, Method] = {"cem": Cem(), "full cem": Cem(iterations=5), "first-order": FirstOrder()}
BEST_STEPS = [(0.03, -0.02, 0.3), (-0.04, 0.04, -0.4), (0.0, 0.05, 0.0)]


def bump(best: tuple[float, float, float]) -> ScoreSteps:
    """Predicted success that falls off smoothly around one best step."""
    centre = torch.tensor(best)

    def score(steps: Tensor) -> Tensor:
        return torch.exp(-0.5 * (((steps - centre) / WIDTH) ** 2).sum(-1))

    return score


def climb(method: Method, best: tuple[float, float, float], seed: int) -> list[float]:
    """Scores along a run on a bump that moves against every step, as the world does."""
    optimiser, rng = method.begin(), np.random.default_rng(seed)
    remaining = torch.tensor(best)
    scores = []
    for _ in range(method.max_steps):
        objective = bump(tuple(remaining.tolist()))
        here = float(objective(torch.zeros(1, 3)))
        scores.append(here)
        remaining = remaining - optimiser.propose(objective, here, rng).step
    return scores


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("best", BEST_STEPS)
def test_methods_climb_to_the_top(name: str, best: tuple[float, float, float]) -> None:
    scores = climb(METHODS[name], best, seed=1)
    assert scores[0] < 0.85
    assert max(scores) > 0.97


@pytest.mark.parametrize("name", METHODS)
def test_equal_seeds_give_equal_steps(name: str) -> None:
    assert climb(METHODS[name], BEST_STEPS[0], seed=3) == climb(METHODS[name], BEST_STEPS[0], seed=3)
    assert climb(METHODS[name], BEST_STEPS[0], seed=3) != climb(METHODS[name], BEST_STEPS[0], seed=4)


def test_cem_steps_to_the_best_pose_it_scored() -> None:
    proposal = Cem().begin().propose(bump(BEST_STEPS[0]), 0.3, np.random.default_rng(0))
    assert torch.equal(proposal.step, proposal.samples[proposal.scores.argmax()])
    assert len(proposal.samples) == 64 + 1


def test_sampling_range_shrinks_with_the_score() -> None:
    """Section IV: the range is scaled by 1 - S_0."""
    step_range = StepRange(x_m=0.1, y_m=0.2, angle_rad=1.0)
    torch.testing.assert_close(step_range.scaled(0.0), torch.tensor([0.1, 0.2, 1.0]))
    torch.testing.assert_close(step_range.scaled(0.75), torch.tensor([0.1, 0.2, 1.0]) * 0.25)
    wide, fine = (
        FirstOrder().begin().propose(bump(BEST_STEPS[0]), here, np.random.default_rng(0)).samples.abs().max(0).values
        for here in (0.0, 0.8)
    )
    torch.testing.assert_close(fine, wide * 0.2)


@given(
    slope=st.tuples(*[st.floats(-2, 2)] * 3),
    offset=st.floats(-1, 1),
    seed=st.integers(0, 1000),
)
def test_regression_recovers_a_plane(slope: tuple[float, float, float], offset: float, seed: int) -> None:
    steps = torch.from_numpy(np.random.default_rng(seed).uniform(-1, 1, (64, 3)))
    scores = steps @ torch.tensor(slope, dtype=steps.dtype) + offset
    torch.testing.assert_close(regress_gradient(steps, scores), torch.tensor(slope, dtype=steps.dtype))


def test_regressed_gradient_matches_autograd_on_a_smooth_function() -> None:
    objective, reach = bump(BEST_STEPS[0]), 0.02
    origin = torch.zeros(1, 3, requires_grad=True)
    (exact,) = torch.autograd.grad(objective(origin * WIDTH).sum(), origin)
    steps = torch.from_numpy(np.random.default_rng(0).uniform(-reach, reach, (256, 3)).astype(np.float32))
    torch.testing.assert_close(regress_gradient(steps, objective(steps * WIDTH)), exact[0], rtol=0.02, atol=2e-3)


@pytest.mark.parametrize("bad", [{"elite": 0}, {"elite": 100}, {"iterations": 0}, {"max_steps": -1}])
def test_impossible_cem_settings(bad: dict[str, int]) -> None:
    with pytest.raises(ServoSettingsError):
        Cem(**bad)  # type: ignore[arg-type]  # only integers are in these dicts


@pytest.mark.parametrize("bad", [{"samples": 3}, {"learning_rate": 0.0}, {"decay": 1.0}, {"max_steps": -1}])
def test_impossible_first_order_settings(bad: dict[str, float]) -> None:
    with pytest.raises(ServoSettingsError):
        FirstOrder(**bad)  # type: ignore[arg-type]  # one dict holds integers and floats
