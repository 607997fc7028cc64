"""The contact benchmark: what it counts is what the attempts were, and watching changes none of them."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.__main__ import report
from benchmarks._contact_station import ContactStation
from benchmarks.contact import SEED, Touch, attempted, figures
from handsight.collection.attempt import attempt_seed, run_attempt
from handsight.collection.policy import UniformPolicy
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation
from handsight.datasets.records import GraspAttempt

HELD_AND_NOT = (
    Touch(force_n=0.0, deepest_m=0.001, label=True, truth=True),
    Touch(force_n=40.0, deepest_m=0.003, label=False, truth=True),
    Touch(force_n=20.0, deepest_m=0.0, label=False, truth=False),
    Touch(force_n=30.0, deepest_m=0.0, label=None, truth=False),
)


def first(station: SimStation) -> GraspAttempt:
    try:
        return run_attempt(station, UniformPolicy(), 0, attempt_seed(SEED, 0))
    finally:
        station.close()


def test_figures_count_what_was_completed() -> None:
    found = {figure.name: figure for figure in figures("2f-85", list(HELD_AND_NOT))}
    assert found["2f-85, contact, median"].ours == pytest.approx(30.0)
    assert found["2f-85, contact, largest"].ours == pytest.approx(40.0)
    assert found["2f-85, contact, 99 %"].n == 3
    assert found["2f-85, finger in object, largest"].ours == pytest.approx(3.0)
    label, random = found["2f-85, label is true"], found["2f-85, random grasps that hold"]
    assert label.ours == pytest.approx(200 / 3)
    assert random.ours == pytest.approx(100 / 3)
    assert label.n == random.n == 3
    assert "1 of 3; 95 % interval 6.15 to 79.23 %" in random.what


def test_attempts_that_touched_nothing_have_no_force() -> None:
    headline, *_ = figures("2f-85", [HELD_AND_NOT[0]])
    assert headline.ours == 0
    assert set(json.loads(json.dumps(report("contact", [headline])))) >= {"name", "ours", "unit", "n", "figures"}


def test_a_watched_attempt_is_the_same() -> None:
    watched, plain = first(ContactStation(SimConfig())), first(SimStation(SimConfig()))
    assert watched.gripper == plain.gripper
    assert watched.contact_force_n == plain.contact_force_n
    np.testing.assert_array_equal(watched.pose_base_tool_grasp, plain.pose_base_tool_grasp)


def test_what_is_held_is_seen_and_what_is_not_is_not() -> None:
    """Of these attempts two hold something; each that holds pressed on what it holds."""
    touches = attempted("2f-85", 5)
    assert [touch.truth for touch in touches] == [True, False, True, False, False]
    assert [touch.label for touch in touches] == [touch.truth for touch in touches]
    assert all(touch.deepest_m > 0 for touch in touches if touch.truth)
    assert touches[3].deepest_m == 0
