"""A simulated station that notes where its processor time goes, and how much of it is Bullet alone."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from time import process_time
from typing import ParamSpec, TypeVar

from handsight.collection.sim.bullet import BulletClient
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation, SimStationFactory

PHASE_OF_METHOD = {
    "reset": "settle",
    "look": "look",
    "reach": "reach",
    "descend": "descend",
    "close_gripper": "close",
    "lift": "lift",
    "shake": "lift",
}
"""Methods of a station and what their time is booked on. Without shakes, ``shake`` only comes to rest."""

STEP = "stepSimulation"
BULLET_CALLS = (STEP, "getCameraImage")

Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer")


def _nothing() -> dict[str, float]:
    return dict.fromkeys(PHASE_OF_METHOD.values(), 0.0)


@dataclass(slots=True)
class PhaseTimes:
    """Processor time of a worker, summed over its attempts.

    Time of the process, not of the clock: on a core that worker and writer share it leaves out the writer's turns.
    """

    attempts: int = 0
    steps: int = 0
    """Physics steps."""
    phase_s: dict[str, float] = field(default_factory=_nothing)
    """Whole phases [s]."""
    bullet_s: dict[str, float] = field(default_factory=_nothing)
    """Physics steps and camera pictures alone, by the phase they belong to [s]: what no station could do without."""

    @classmethod
    def read(cls, path: Path) -> PhaseTimes:
        """The times that a closed station left."""
        return cls(**json.loads(path.read_text()))


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchedStationFactory(SimStationFactory):
    """Opens a station that leaves its times in a file. Good for one worker: a second would write over them."""

    notes: Path

    def __call__(self) -> SimStation:
        """Start a client."""
        return WatchedStation(self.config, self.notes)


class WatchedStation(SimStation):
    """A simulated station whose phases and Bullet are timed from outside; it does the same to the last bit."""

    def __init__(self, config: SimConfig, notes: Path) -> None:
        """Start a client; ``notes`` is written when the station closes."""
        self.times = PhaseTimes()
        self._phase = PHASE_OF_METHOD["reset"]
        self._notes = notes
        super().__init__(config)
        for method, phase in PHASE_OF_METHOD.items():
            setattr(self, method, self._timed_phase(getattr(self, method), phase))

    @property
    def _bullet(self) -> BulletClient:
        return self._watched_bullet

    @_bullet.setter
    def _bullet(self, bullet: BulletClient) -> None:
        """Watch every client that the station turns to, before it hands it on to arm and scene."""
        self._watched_bullet = bullet
        for call in BULLET_CALLS:
            if call not in vars(bullet):
                setattr(bullet, call, self._timed_call(getattr(bullet, call), is_step=call == STEP))

    def _timed_phase(self, method: Callable[Arguments, Answer], phase: str) -> Callable[Arguments, Answer]:
        def timed(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Answer:
            self._phase = phase
            self.times.attempts += phase == PHASE_OF_METHOD["reset"]
            start_s = process_time()
            try:
                return method(*args, **kwargs)
            finally:
                self.times.phase_s[phase] += process_time() - start_s

        return timed

    def _timed_call(self, call: Callable[Arguments, Answer], *, is_step: bool) -> Callable[Arguments, Answer]:
        def timed(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Answer:
            self.times.steps += is_step
            start_s = process_time()
            answer = call(*args, **kwargs)
            self.times.bullet_s[self._phase] += process_time() - start_s
            return answer

        return timed

    def close(self) -> None:
        """Stop the client and leave the times behind."""
        super().close()
        self._notes.write_text(json.dumps(asdict(self.times)))
