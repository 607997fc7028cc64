"""A program that collects nine attempts while whichever process attempts the one numbered 5 is killed.

It is killed as often as the command line says, which counts over all processes by marks in a folder.
"""

from __future__ import annotations

import os
import signal
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handsight.collection.collector import CollectSettings, collect
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation, SimStationFactory
from handsight.datasets import GraspRepository
from handsight.datasets.records import SceneObjects
from handsight.jobs.errors import WorkerDiedError

DOOMED = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class DoomedStationFactory(SimStationFactory):
    """Opens stations that kill their own process."""

    marks: Path
    deaths: int

    def __call__(self) -> SimStation:
        """Open one."""
        return DoomedStation(self)


class DoomedStation(SimStation):
    """A station like any other but for its end."""

    def __init__(self, factory: DoomedStationFactory) -> None:
        super().__init__(factory.config)
        self._factory = factory

    def reset(self, rng: np.random.Generator) -> SceneObjects:
        """Ready a scene, or die."""
        seed = rng.bit_generator.seed_seq
        assert isinstance(seed, np.random.SeedSequence)
        number = seed.spawn_key[0]
        died = len(list(self._factory.marks.iterdir()))
        if number == DOOMED and died < self._factory.deaths:
            (self._factory.marks / str(died)).touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return super().reset(rng)


def main(dataset: str, marks: str, deaths: str) -> None:
    """Print how many attempts the session holds in the end, or the error."""
    factory = DoomedStationFactory(config=SimConfig(), marks=Path(marks), deaths=int(deaths))
    settings = CollectSettings(attempts=9, seed=11, workers=2, commit_every=100)
    try:
        print(collect(GraspRepository.create(dataset), factory, settings).attempts)
    except WorkerDiedError as error:
        print(error)


if __name__ == "__main__":
    main(*sys.argv[1:])
