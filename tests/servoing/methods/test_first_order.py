"""First-order ascent and the gradient it regresses."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tests.support.bumps import BEST_STEPS, WIDTH, bump

from handsight.servoing.errors import ServoSettingsError
from handsight.servoing.methods.first_order import FirstOrder
from handsight.servoing.regression import regress_gradient


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


@pytest.mark.parametrize("bad", [{"samples": 3}, {"learning_rate": 0.0}, {"decay": 1.0}, {"max_steps": -1}])
def test_impossible_first_order_settings(bad: dict[str, float]) -> None:
    with pytest.raises(ServoSettingsError):
        FirstOrder(**bad)  # type: ignore[arg-type]  # one dict holds integers and floats
