"""The simulated contact: forces, fingers inside objects, labels against the truth, random grasps that hold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks import Figure
from benchmarks._contact_station import ContactStation
from handsight.collection.attempt import attempt_seed, run_attempt
from handsight.collection.policy import UniformPolicy
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.grippers import GRIPPERS
from handsight.evaluation.results import wilson_95

SEED = 777
ATTEMPTS = 500
"""Of each gripper."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """What one attempt came to."""

    force_n: float
    """When contact ended the descent; 0 when the table's height did."""
    deepest_m: float
    """Largest overlap of a finger and an object at any step."""
    label: bool | None
    """Whether the gripper says that it holds; None when the attempt was not completed."""
    truth: bool


def run() -> list[Figure]:
    """All figures of every gripper, the one the project collects with first."""
    return [figure for name in GRIPPERS for figure in figures(name, attempted(name, ATTEMPTS))]


def attempted(gripper: str, attempts: int) -> list[Touch]:
    """Random attempts over the objects that training data are collected with."""
    station = ContactStation(SimConfig(gripper=gripper))
    try:
        return [_touch(station, number) for number in range(attempts)]
    finally:
        station.close()


def _touch(station: ContactStation, number: int) -> Touch:
    done = run_attempt(station, UniformPolicy(), number, attempt_seed(SEED, number))
    return Touch(
        force_n=done.contact_force_n,
        deepest_m=station.deepest_m,
        label=done.success if done.labelled else None,
        truth=done.labelled and station.holds,
    )


def figures(gripper: str, touches: list[Touch]) -> list[Figure]:
    """Forces, overlaps, labels and successes of one gripper's attempts; at least one of them was completed."""
    labelled = [touch for touch in touches if touch.label is not None]
    return [*_forces(gripper, touches), *_overlaps(gripper, touches), *_labels(gripper, labelled)]


def _forces(gripper: str, touches: list[Touch]) -> list[Figure]:
    forces_n = [touch.force_n for touch in touches if touch.force_n > 0] or [0.0]
    what = "Sum of the normal forces of all contacts of arm and hand when they ended the descent."
    return [
        Figure(name=f"{gripper}, contact, {name}", ours=float(value), unit="N", n=len(forces_n), what=what)
        for name, value in zip(("99 %", "median", "largest"), np.percentile(forces_n, (99, 50, 100)), strict=True)
    ]


def _overlaps(gripper: str, touches: list[Touch]) -> list[Figure]:
    deepest_mm = [1e3 * touch.deepest_m for touch in touches]
    what = "Largest overlap of a finger and an object at any step of an attempt, the squeeze of the grip included."
    return [
        Figure(name=f"{gripper}, finger in object, {name}", ours=float(value), unit="mm", n=len(touches), what=what)
        for name, value in zip(("99 %", "largest"), np.percentile(deepest_mm, (99, 100)), strict=True)
    ]


def _labels(gripper: str, labelled: list[Touch]) -> list[Figure]:
    return [
        _share(
            f"{gripper}, label is true",
            sum(touch.label == touch.truth for touch in labelled),
            len(labelled),
            "Labelled attempts whose label says what holds in truth: an object off the table that a finger presses on.",
        ),
        _share(
            f"{gripper}, random grasps that hold",
            sum(bool(touch.label) for touch in labelled),
            len(labelled),
            "Labelled attempts at random poses whose label is success; the paper has 18.5 to 20 % (section V-B).",
        ),
    ]


def _share(name: str, count: int, of: int, what: str) -> Figure:
    low, high = wilson_95(count, of)
    interval = f"{count} of {of}; 95 % interval {100 * low:.2f} to {100 * high:.2f} % (Wilson)."
    return Figure(name=name, ours=100 * count / of, unit="%", n=of, what=f"{what} {interval}")
