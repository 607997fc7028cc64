"""The robot's clock: how fast, and when it must not be."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest
from tests.support.bare_rig import call, let_pass, lowered, start

from handsight.collection.ur10.emulator.clock import Clock
from handsight.collection.ur10.emulator.rig import EmulatedRig

PERIOD_S = 0.002


class CountedError(Exception):
    """Enough has been seen."""


def run(clock: Clock, *, attentive: Callable[[int], bool], shown: int) -> tuple[int, list[float]]:
    """Let a clock run until it has shown so often: steps, and the factors that were told."""
    steps = shows = 0
    factors: list[float] = []

    def step() -> None:
        nonlocal steps
        steps += 1

    def show(_: float) -> None:
        nonlocal shows
        shows += 1
        if shows == shown:
            raise CountedError

    async def bounded() -> None:
        await asyncio.wait_for(clock.run(step, show, PERIOD_S, lambda: attentive(steps), factors.append), timeout=30)

    with pytest.raises(CountedError):
        asyncio.run(bounded())
    return steps, factors


def test_fast_clock_takes_several_periods_at_a_time() -> None:
    steps, factors = run(Clock(50.0), attentive=lambda _: False, shown=20)
    assert steps > 100
    assert set(factors) == {50.0}


def test_what_must_not_be_missed_is_shown_in_real_time() -> None:
    _, factors = run(Clock(50.0), attentive=lambda _: True, shown=3)
    assert set(factors) == {1.0}


def test_slow_clock_stays_slow() -> None:
    _, factors = run(Clock(0.5), attentive=lambda _: True, shown=3)
    assert set(factors) == {0.5}


def test_contact_ends_a_batch_of_periods() -> None:
    # So fast that any two readings of the wall's clock lie many periods apart: the first batch is never one of one.
    steps, _ = run(Clock(1e6), attentive=lambda taken: taken >= 2, shown=1)
    assert steps == 2


def test_touch_of_a_watched_motion_is_what_must_not_be_missed(e_series: EmulatedRig) -> None:
    start(e_series)
    assert not e_series.attentive()
    call(e_series, 3, (*lowered(e_series, e_series.robot.tip_z_m + 0.01), 0.05, 0.5), (1,))
    while e_series.robot.tip_z_m > 0.002:
        assert not e_series.attentive()
        let_pass(e_series, 0.01)
    let_pass(e_series, 0.1)
    assert e_series.attentive()
    call(e_series, 33, (5.0,), (0,))
    assert not e_series.attentive()
