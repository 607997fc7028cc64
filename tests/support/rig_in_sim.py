"""A rig's evaluation and what it is to be held against: the simulator, with a rig's starts, height, contact and shakes.

A rig does not know where its objects lie, so its trials begin anywhere over the workspace, where those of the simulator
begin around an object; it stops at 40 N, where the simulator stops at 10; and what lies on its table stays there, so a
grasp that fails is tried again. Here the starts and the contact are those of a rig, and every trial has a scene of its
own, on the emulated rig by its control port.

    python tests/support/rig_in_sim.py --model RUN
    python tests/support/rig_in_sim.py --model RUN --rig rig.toml --control 7000

prints rates with their 95 % intervals, as lines of JSON.
"""

from __future__ import annotations

import argparse
import json
import socket
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation, SimStationFactory
from handsight.collection.ur10.emulator.physics import ARM_YIELD_N
from handsight.collection.ur10.rig import MotionConfig
from handsight.collection.ur10.rig_file import load_rig
from handsight.collection.ur10.station import Ur10Station
from handsight.collection.ur10.station_factory import Ur10StationFactory
from handsight.evaluation.evaluate import EvaluationSettings, TrialContextFactory, evaluate, method_names
from handsight.evaluation.results import result_rows
from handsight.servoing.loop import ServoSettings
from handsight.training.run import load_run

LIFT_BELOW_M = 0.02
"""A simulated lift ends below the height at which grasps begin."""


class BlindStation(SimStation):
    """A simulated station that, as a rig, does not tell where its objects lie."""

    def reset(self, rng: np.random.Generator) -> None:  # type: ignore[override]  # It tells less than it could.
        """Make a scene, and keep it to itself."""
        super().reset(rng)


@dataclass(frozen=True, slots=True, kw_only=True)
class BlindStationFactory(SimStationFactory):
    """Opens such stations."""

    def __call__(self) -> BlindStation:
        """Start Bullet."""
        return BlindStation(self.config)


class RefilledStation(Ur10Station):
    """A rig at which somebody lays out other objects before every attempt."""

    def __init__(self, factory: RefilledFactory) -> None:
        """Connect; see the factory."""
        super().__init__(factory.rig, factory.calibration, factory.spec, data_folder=factory.data_folder)
        self._control = (factory.rig.robot.address, factory.control_port)

    def reset(self, rng: np.random.Generator) -> None:
        """As on a rig, with an empty table; then other objects fall while the arm stands above them."""
        self._somebody(b'{"do": "empty", "held": true}')
        super().reset(rng)
        self._somebody(b'{"do": "refill", "exchange": true}')
        began_s = self.arm.state().timestamp_s
        while self.arm.state().timestamp_s < began_s + SETTLE_S:
            pass  # Every state is a new one, so this waits for the controller.

    def _somebody(self, does: bytes) -> None:
        with socket.create_connection(self._control, timeout=30) as connection:
            connection.sendall(does + b"\n")
            connection.makefile(encoding="utf-8").readline()


SETTLE_S = 3.0
"""Of the robot's time, until what fell lies."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RefilledFactory(Ur10StationFactory):
    """Opens such stations."""

    control_port: int

    def __call__(self) -> RefilledStation:
        """Connect to everything."""
        return RefilledStation(self)


def simulated(options: argparse.Namespace) -> BlindStationFactory:
    """The simulator in the part of the rig."""
    config = SimConfig(
        objects=options.objects,
        shakes=3,
        pregrasp_height_m=options.pregrasp_m,
        lift_height_m=min(0.25, options.pregrasp_m - LIFT_BELOW_M),
        contact_force_n=MotionConfig().contact_force_n,
        touch_speed_m_s=MotionConfig().descend_speed_m_s,
        yield_force_n=ARM_YIELD_N,
    )
    return BlindStationFactory(config=config)


def emulated(options: argparse.Namespace) -> RefilledFactory:
    """The emulated rig of a file."""
    found = Ur10StationFactory.of(load_rig(options.rig))
    return RefilledFactory(rig=found.rig, calibration=found.calibration, control_port=options.control)


def main() -> None:
    """Evaluate as the options say."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", type=Path, required=True)
    parser.add_argument("--rig", type=Path)
    parser.add_argument("--control", type=int, default=7000)
    parser.add_argument("--objects", default="household-test")
    parser.add_argument("--methods", default="random,cem-1,global")
    parser.add_argument("--trials", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--pregrasp-m", type=float, default=0.2)
    parser.add_argument("--threshold", type=float, default=0.85)
    options = parser.parse_args()
    settings = EvaluationSettings(
        methods=tuple(method_names(options.methods)),
        trials=options.trials,
        seed=options.seed,
        workers=1 if options.rig else options.workers,
        servo=ServoSettings(threshold=options.threshold),
    )
    factory = TrialContextFactory(
        open_station=emulated(options) if options.rig else simulated(options),
        run=options.model,
        weights_sha256=load_run(options.model).weights_sha256,
    )
    trials = evaluate(factory, settings)
    for row in result_rows(trials, objects=options.objects, methods=settings.methods):
        print(json.dumps({name: row[name] for name in ("method", "trials", "aborted", "successes", "rate", "ci95")}))


if __name__ == "__main__":
    main()
