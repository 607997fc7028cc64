"""What a rig's evaluation is to be held against: the simulator, with the starts, the height and the shakes of a rig.

A rig does not know where its objects lie, so its trials begin anywhere over the workspace, where those of the simulator
begin around an object. ``python tests/support/rig_in_sim.py --model RUN`` prints rates with their 95 % intervals.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation, SimStationFactory
from handsight.evaluation.evaluate import EvaluationSettings, TrialContextFactory, evaluate, method_names
from handsight.evaluation.results import result_rows
from handsight.servoing.loop import ServoSettings
from handsight.training.run import load_run

LIFT_BELOW_M = 0.02
"""A simulated lift ends below the height at which grasps begin."""


class BlindStation(SimStation):
    """A simulated station that, as a rig, does not tell where its objects lie."""

    def reset(self, rng: np.random.Generator) -> None:  # type: ignore[override]
        """Make a scene, and keep it to itself."""
        super().reset(rng)


@dataclass(frozen=True, slots=True, kw_only=True)
class BlindStationFactory(SimStationFactory):
    """Opens such stations."""

    def __call__(self) -> BlindStation:
        """Start Bullet."""
        return BlindStation(self.config)


def main() -> None:
    """Evaluate as the options say."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", type=Path, required=True)
    parser.add_argument("--objects", default="household-test")
    parser.add_argument("--methods", default="random,cem-1,global")
    parser.add_argument("--trials", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--pregrasp-m", type=float, default=0.2)
    parser.add_argument("--threshold", type=float, default=0.85)
    options = parser.parse_args()
    config = SimConfig(
        objects=options.objects,
        shakes=3,
        pregrasp_height_m=options.pregrasp_m,
        lift_height_m=min(0.25, options.pregrasp_m - LIFT_BELOW_M),
    )
    settings = EvaluationSettings(
        methods=tuple(method_names(options.methods)),
        trials=options.trials,
        seed=options.seed,
        workers=options.workers,
        servo=ServoSettings(threshold=options.threshold),
    )
    run = load_run(options.model)
    factory = TrialContextFactory(
        open_station=BlindStationFactory(config=config), run=options.model, weights_sha256=run.weights_sha256
    )
    trials = evaluate(factory, settings)
    for row in result_rows(trials, objects=options.objects, methods=settings.methods):
        print(json.dumps({name: row[name] for name in ("method", "trials", "aborted", "successes", "rate", "ci95")}))


if __name__ == "__main__":
    main()
