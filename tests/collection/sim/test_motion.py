from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handsight.collection.sim.motion import trapezoid


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
