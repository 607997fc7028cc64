"""Regression of derivatives over sampled steps."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from handsight.servoing.regression import regress_gradient, regress_quadratic

NUMBERS = st.floats(-2, 2)


@given(offset=NUMBERS, g=st.tuples(*[NUMBERS] * 3), h=st.tuples(*[NUMBERS] * 6), seed=st.integers(0, 1000))
@pytest.mark.parametrize("fixed", [False, True])
def test_a_paraboloid_is_recovered(
    offset: float, g: tuple[float, ...], h: tuple[float, ...], seed: int, *, fixed: bool
) -> None:
    steps = torch.from_numpy(np.random.default_rng(seed).uniform(-1, 1, (128, 3)))
    gradient = torch.tensor(g, dtype=torch.float64)
    a, b, c, d, e, f = h
    hessian = torch.tensor([[a, b, c], [b, d, e], [c, e, f]], dtype=torch.float64)
    scores = offset + steps @ gradient + 0.5 * torch.einsum("ni,ij,nj->n", steps, hessian, steps)
    found = regress_quadratic(steps, scores, score_here=offset if fixed else None)
    torch.testing.assert_close(found, (gradient, hessian), rtol=1e-6, atol=1e-6)


def test_steps_on_a_line_give_a_slope_along_it_alone() -> None:
    along = torch.tensor([0.6, 0.8, 0.0])
    steps = torch.linspace(-1, 1, 64)[:, None] * along
    gradient = regress_gradient(steps, 0.5 + steps @ (0.3 * along))
    torch.testing.assert_close(gradient, 0.3 * along, rtol=1e-4, atol=1e-5)
