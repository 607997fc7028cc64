"""The robot's clock against the wall's.

The robot's time never runs faster than ``factor`` times the wall's, and is never made up for: while this process draws
a picture or waits for a processor, the robot stands still.

A fast clock and a client that polls. A client that stops a descent when the force rises notices it some milliseconds
of wall time late, and so does its command arrive. At ``factor`` 10 these are ten times as many milliseconds of the
robot's, in which a hand at 0.05 m/s goes five millimetres instead of half of one and presses far beyond the threshold.
So contact is always shown in real time: as long as something presses on the arm and a motion is under way that its
client may stop, the factor is at most 1. In free space there is nothing to overshoot, and with the arm at rest nothing
to miss. A synchronous motion, in which the client can do nothing but wait, runs fast throughout.

Time that a client sleeps or computes is charged ``factor`` times: attempts per hour by this clock are too low with a
fast one, never too high.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

LONGEST_CATCH_UP_S = 0.02
"""Robot time beyond this is given up and not caught up with [s, at factor 1]."""
TOUCHING_N = 3.0
CARRIED_N = 25.0
"""Force from which on something presses on the arm, with open jaws, and with jaws that may carry something."""
SHORTEST_SLEEP_S = 0.001


class Clock:
    """Calls one function for every control period."""

    def __init__(self, factor: float) -> None:
        self.factor = factor

    def now_factor(self, *, attentive: bool) -> float:
        """The factor now; ``attentive`` while what happens must not be missed."""
        return min(self.factor, 1.0) if attentive else self.factor

    async def run(
        self,
        step: Callable[[], None],
        show: Callable[[float], None],
        period_s: float,
        attentive: Callable[[], bool],
        on_factor: Callable[[float], None],
    ) -> None:
        """Run for ever.

        Args:
            step: Called for every control period.
            show: Called after one or several of them, with the wall's time.
            period_s: Of robot time.
            attentive: Whether time must not run fast now.
            on_factor: Told the factor.
        """
        last_s = time.perf_counter()
        owed_s = 0.0
        while True:
            now_s = time.perf_counter()
            factor = self.now_factor(attentive=attentive())
            on_factor(factor)
            owed_s = min(owed_s + (now_s - last_s) * factor, LONGEST_CATCH_UP_S * max(factor, 1.0))
            last_s = now_s
            if owed_s >= period_s:
                while owed_s >= period_s:
                    owed_s -= period_s
                    step()
                    if factor > 1.0 and attentive():
                        owed_s = 0.0  # Contact: what follows is shown in real time.
                show(time.perf_counter())
            await asyncio.sleep(max((period_s - owed_s) / factor, SHORTEST_SLEEP_S))
