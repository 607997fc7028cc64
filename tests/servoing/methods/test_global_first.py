"""The global first step."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from tests.support.bumps import Bump

from handsight.servoing.errors import ServoSettingsError
from handsight.servoing.methods.global_first import GlobalFirst, GlobalSearch, search_everywhere
from handsight.servoing.methods.registry import FULL_CEM, METHODS

FAR = (0.17, -0.12, 1.4)
"""Beyond the range of every local method."""


@pytest.mark.parametrize("seed", range(4))
def test_it_finds_what_is_out_of_reach_of_the_local_methods(seed: int) -> None:
    proposal = search_everywhere(Bump(FAR), GlobalSearch(), np.random.default_rng(seed))
    assert float(proposal.scores.max()) > 0.99
    assert torch.equal(proposal.step, proposal.samples[proposal.scores.argmax()])
    # The same grasp turned by half a turn is as good.
    assert float(Bump(FAR)(proposal.step[None])) > 0.99


def test_it_stays_in_the_picture() -> None:
    objective = Bump((0.3, 0.0, 0.0))  # Outside: the best inside is on the edge.
    proposal = search_everywhere(objective, GlobalSearch(), np.random.default_rng(0))
    assert bool(objective.footprint.contains(proposal.samples).all())


def test_only_the_first_step_is_global() -> None:
    optimiser, rng = GlobalFirst().begin(), np.random.default_rng(0)
    first = optimiser.propose(Bump(FAR), 0.0, rng)
    second = optimiser.propose(Bump(FAR), 0.0, rng)
    assert float(first.step[0]) > 0.1
    assert bool((second.samples.abs() <= GlobalFirst().then.range.scaled(0.0) * (1 + 1e-6)).all())


@pytest.mark.parametrize(
    "bad", [{"angles": 0}, {"every": 0}, {"rounds": (4, 0)}, {"x_m": 0.0}, {"narrowing": float("nan")}]
)
def test_impossible_searches(bad: dict[str, float]) -> None:
    with pytest.raises(ServoSettingsError):
        GlobalSearch(**bad)  # type: ignore[arg-type]  # one dict holds numbers of both kinds and tuples
    with pytest.raises(ServoSettingsError, match="at least 1"):
        GlobalFirst(max_steps=0)


def test_both_cems_score_as_many_samples_in_a_run() -> None:
    """Section IV-A: the limits are such that both take equal time."""
    single = METHODS["cem-1"].settings
    assert isinstance(single, type(FULL_CEM))
    assert FULL_CEM.samples * FULL_CEM.iterations * FULL_CEM.max_steps == single.samples * single.max_steps
