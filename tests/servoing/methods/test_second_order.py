"""Newton's method on sampled paraboloids, and Gauss and Newton's on planes."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tests.support.bumps import BEST_STEPS, Bump

from handsight.servoing.errors import ServoSettingsError
from handsight.servoing.methods.gauss_newton import GaussNewton
from handsight.servoing.methods.second_order import SecondOrder, climbing_step, literal_step

NUMBERS = st.floats(-2, 2)


@given(g=st.tuples(*[NUMBERS] * 3), h=st.tuples(*[NUMBERS] * 6))
def test_a_climbing_step_never_leads_down_and_stays_in_range(g: tuple[float, ...], h: tuple[float, ...]) -> None:
    gradient = torch.tensor(g, dtype=torch.float64)
    a, b, c, d, e, f = h
    hessian = torch.tensor([[a, b, c], [b, d, e], [c, e, f]], dtype=torch.float64)
    step = climbing_step(gradient, hessian)
    assert float(gradient @ step) >= -1e-9
    assert float(torch.linalg.vector_norm(step)) <= 1 + 1e-9


def test_it_is_newtons_step_where_the_top_is_in_range() -> None:
    hessian = torch.diag(torch.tensor([-2.0, -1.0, -4.0], dtype=torch.float64))
    top = torch.tensor([0.3, -0.2, 0.1], dtype=torch.float64)
    gradient = -hessian @ top
    torch.testing.assert_close(climbing_step(gradient, hessian), top)
    # The printed formula has the other sign, and half of the matrix: away from the top, twice as far.
    torch.testing.assert_close(literal_step(gradient, hessian), -2 * top)


def test_the_printed_formula_descends_at_a_maximum() -> None:
    rng = np.random.default_rng(0)
    near_top = Bump((0.01, 0.01, 0.05))
    here = float(near_top(torch.zeros(1, 3)))
    ours, printed = (
        SecondOrder(literal=literal, learning_rate=rate).begin().propose(near_top, here, rng).step
        for literal, rate in ((False, 1.0), (True, 0.05))
    )
    assert float(near_top(ours[None])) > here
    assert float(near_top(printed[None])) < here


def test_gauss_and_newtons_step_reaches_certainty_on_a_plane() -> None:
    class Plane(Bump):
        def __call__(self, steps: torch.Tensor) -> torch.Tensor:
            return 0.6 + steps @ torch.tensor([30.0, 15.0, 0.0])

    plane = Plane(BEST_STEPS[0])
    step = GaussNewton(damping=1e-9).begin().propose(plane, 0.6, np.random.default_rng(0)).step
    assert float(plane(step[None])) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("method", [GaussNewton(), GaussNewton(literal=True), SecondOrder(), SecondOrder(literal=True)])
def test_flat_scores_move_nothing(method: GaussNewton | SecondOrder) -> None:
    class Flat(Bump):
        def __call__(self, steps: torch.Tensor) -> torch.Tensor:
            return torch.full((len(steps),), 0.25)

    step = method.begin().propose(Flat(BEST_STEPS[0]), 0.25, np.random.default_rng(0)).step
    assert bool(torch.isfinite(step).all())
    assert float(step.abs().max()) < 1e-3 or method.literal


@pytest.mark.parametrize("bad", [{"samples": 3}, {"learning_rate": 0.0}, {"max_steps": -1}])
def test_impossible_settings(bad: dict[str, float]) -> None:
    for method in (SecondOrder, GaussNewton):
        with pytest.raises(ServoSettingsError):
            method(**bad)  # type: ignore[arg-type]  # one dict holds integers and floats
    with pytest.raises(ServoSettingsError):
        GaussNewton(damping=-1.0)
