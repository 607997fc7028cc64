from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handsight.collection.sim.motion import careful, trapezoid


@given(length=st.floats(1e-4, 3), speed=st.floats(0.05, 3), acceleration=st.floats(0.1, 20))
def test_moves_end_at_the_goal_within_the_limits(length: float, speed: float, acceleration: float) -> None:
    rate_hz = 240.0
    path = trapezoid(length, speed=speed, acceleration=acceleration, rate_hz=rate_hz)
    assert path[-1] == pytest.approx(length)
    ticks = np.diff(path, prepend=0.0) * rate_hz
    assert (ticks >= -1e-9).all()
    # The duration is rounded up to whole ticks, so speeds can only come out lower than asked.
    assert ticks.max() <= speed * (1 + 1e-9)
    assert ticks[0] <= acceleration / rate_hz + 1e-9 or len(path) == 1


def test_a_move_of_nothing_is_one_tick() -> None:
    assert trapezoid(0.0, speed=1.0, acceleration=1.0, rate_hz=240).tolist() == [0.0]


@given(length=st.floats(0.05, 1), share=st.floats(0, 0.99), slow_speed=st.floats(0.05, 0.3))
def test_a_careful_move_is_slow_from_the_given_place_on(length: float, share: float, slow_speed: float) -> None:
    rate_hz, speed, acceleration = 240.0, 0.4, 3.0
    slow_from = share * length
    path = careful(
        length, slow_from=slow_from, slow_speed=slow_speed, speed=speed, acceleration=acceleration, rate_hz=rate_hz
    )
    assert path[-1] == pytest.approx(length)
    speeds = np.diff(path, prepend=0.0) * rate_hz
    assert (speeds > 0).all()
    assert speeds.max() <= speed * (1 + 1e-9)
    beyond = np.concatenate([[0.0], path[:-1]]) >= slow_from
    assert (speeds[beyond] <= slow_speed * (1 + 1e-9)).all()
    # It gets up to speed where it may.
    assert len(path) < rate_hz * (slow_from / speed + (length - slow_from) / slow_speed + 0.5)


def test_a_careful_move_with_nothing_to_be_careful_of_is_a_usual_one() -> None:
    limits = {"speed": 0.4, "acceleration": 3.0, "rate_hz": 240.0}
    usual = trapezoid(0.3, **limits)
    for slow_from in (0.3, np.inf):
        assert careful(0.3, slow_from=slow_from, slow_speed=0.1, **limits).tolist() == usual.tolist()
