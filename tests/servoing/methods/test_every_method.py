"""Every registered method on objectives whose best step is known; a method entered in the registry is tested here."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from tests.support.bumps import BEST_STEPS, bump

from handsight.servoing.errors import UnknownMethodError
from handsight.servoing.methods.global_first import GlobalFirst
from handsight.servoing.methods.registry import METHODS, RANDOM, servo_method
from handsight.servoing.optimiser import ServoMethod

SERVOING = {name: method for name, method in METHODS.items() if method.settings is not None}
LOCAL = {name: method for name, method in SERVOING.items() if not isinstance(method.settings, GlobalFirst)}


def climb(method: ServoMethod, best: tuple[float, float, float], seed: int) -> list[float]:
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


@pytest.mark.parametrize("name", SERVOING)
@pytest.mark.parametrize("best", BEST_STEPS)
def test_it_climbs_to_the_top(name: str, best: tuple[float, float, float]) -> None:
    scores = climb(SERVOING[name], best, seed=1)
    assert scores[0] < 0.85
    assert max(scores) > 0.97


@pytest.mark.parametrize("name", SERVOING)
def test_equal_seeds_give_equal_steps(name: str) -> None:
    assert climb(SERVOING[name], BEST_STEPS[0], seed=3) == climb(SERVOING[name], BEST_STEPS[0], seed=3)
    assert climb(SERVOING[name], BEST_STEPS[0], seed=3) != climb(SERVOING[name], BEST_STEPS[0], seed=4)


@pytest.mark.parametrize("name", LOCAL)
@pytest.mark.parametrize("score_here", [0.0, 0.6, 1.0])
def test_it_proposes_a_step_inside_its_range(name: str, score_here: float) -> None:
    method = servo_method(name)
    assert method is SERVOING[name]
    settings: Any = method.settings
    reach = settings.range.scaled(score_here) * (1 + 1e-6)
    optimiser, rng = method.begin(), np.random.default_rng(0)
    for best in BEST_STEPS:
        proposal = optimiser.propose(bump(best), score_here, rng)
        assert proposal.step.shape == (3,)
        assert (proposal.step.abs() <= reach).all()
        assert (proposal.samples.abs() <= reach).all()
        assert proposal.scores.shape == (len(proposal.samples),)


def test_the_random_baseline_is_the_only_method_that_does_not_servo() -> None:
    assert METHODS.keys() - SERVOING.keys() == {RANDOM}
    assert METHODS[RANDOM].max_steps == 0
    for refused in (lambda: servo_method(RANDOM), METHODS[RANDOM].begin):
        with pytest.raises(UnknownMethodError, match="'random', which does not servo"):
            refused()


def test_a_method_is_entered_under_its_own_name() -> None:
    assert {name: method.name for name, method in METHODS.items()} == {name: name for name in METHODS}
