"""What counts and what does not: faults before the descent abort a trial, whatever comes after is the method's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from tests.support.scorers import FunctionScorer
from tests.support.scripted_station import ScriptedStation

from handsight.evaluation.trial import Trial, run_trial
from handsight.servoing.loop import ServoSettings


def run(station: ScriptedStation, score: float = 0.5, method: str = "cem-1") -> Trial:
    scorer = FunctionScorer(lambda inputs: torch.full((len(inputs),), score))
    return run_trial(station, scorer, method, 0, seed=1, settings=ServoSettings())[0]


STATION_FAULTS: dict[str, tuple[dict[str, Any], str]] = {
    "never settles": ({"faults": {"settle": 0}}, "settle: scripted"),
    "camera lost at once": ({"faults": {"look": 0}}, "look: scripted"),
    "camera lost while servoing": ({"faults": {"look": 3}}, "look: scripted"),
    "start out of reach": ({"faults": {"reach": 0}}, "reach: scripted"),
    "no valid depth": ({"depth_m": 0.0}, "no pixel of the depth picture is valid"),
}


@pytest.mark.parametrize("name", STATION_FAULTS)
def test_a_fault_before_the_descent_aborts_the_trial(name: str) -> None:
    changes, reason = STATION_FAULTS[name]
    station = ScriptedStation(**changes)
    trial = run(station)
    assert trial.aborted
    assert not trial.success
    assert reason in trial.failure
    assert "descend" not in station.calls, "the arm left the pre-grasp height"


@pytest.mark.parametrize("score", [float("nan"), 1.5, -0.1])
def test_a_network_that_gives_no_scores_aborts_the_trial(score: float) -> None:
    station = ScriptedStation()
    trial = run(station, score)
    assert trial.aborted
    assert "not in [0, 1]" in trial.failure
    assert "descend" not in station.calls


def test_scores_of_the_wrong_shape_abort_the_trial() -> None:
    station = ScriptedStation()
    column = FunctionScorer(lambda inputs: torch.full((len(inputs), 1), 0.5))
    trial, recording = run_trial(station, column, "cem-1", 0, seed=1, settings=ServoSettings())
    assert (trial.aborted, recording) == (True, None)
    assert "expected (1,)" in trial.failure
    assert "descend" not in station.calls


def test_scores_that_fail_only_while_servoing_abort_too() -> None:
    """The start is scored well; the batch of proposals has one that is not a number."""

    def score(inputs: torch.Tensor) -> torch.Tensor:
        scores = torch.full((len(inputs),), 0.5)
        if len(inputs) > 1:
            scores[-1] = float("nan")
        return scores

    station = ScriptedStation()
    trial, _ = run_trial(station, FunctionScorer(score), "cem-1", 0, seed=1, settings=ServoSettings())
    assert trial.aborted
    assert "1 of 256 scores" in trial.failure
    assert "descend" not in station.calls


def test_a_picture_without_depth_aborts_random_grasps_too() -> None:
    """They do not look at it; but all methods of a trial begin alike, so that the trial ends alike."""
    assert run(ScriptedStation(depth_m=0.0), method="random").aborted


@pytest.mark.parametrize("phase", ["descend", "close", "lift", "shake"])
@pytest.mark.parametrize("method", ["random", "cem-1"])
def test_a_grasp_that_is_blocked_is_the_methods_failure(phase: str, method: str) -> None:
    trial = run(ScriptedStation(faults={phase: 0}), method=method)
    assert not trial.aborted
    assert not trial.success
    assert trial.failure == f"{phase}: scripted"
    assert trial.truth_held is None


def test_a_servo_step_out_of_reach_is_not_taken_and_the_trial_counts() -> None:
    trial = run(ScriptedStation(faults={"reach": 1}))
    assert not trial.aborted
    assert trial.success


def test_a_trial_in_which_all_goes_well_counts() -> None:
    trial = run(ScriptedStation(), score=1.0)
    assert (trial.success, trial.aborted, trial.failure, trial.moves) == (True, False, "", 0)


def test_a_trial_keeps_what_its_cause_is_told_from() -> None:
    station = ScriptedStation(contact_force_n=17.0, contact_height_m=0.06, widths_m=(0.03, 0.02, 0.0), truth_held=False)
    trial = run(station, score=1.0)
    assert not trial.success
    assert (trial.score, trial.contact_force_n) == (1.0, 17.0)
    assert trial.contact_height_m == pytest.approx(0.06)
    assert (trial.closed_m, trial.lifted_m, trial.final_m) == (0.03, 0.02, 0.0)


def test_how_far_the_nearest_object_was_pushed_is_told_by_a_station_that_knows() -> None:
    assert run(ScriptedStation(), score=1.0).pushed_m is None
    trial = run(SeeingStation(touched_by="palm"), score=1.0)
    assert trial.touched_by == "palm"
    assert trial.pushed_m == pytest.approx(0.05)


@dataclass
class SeeingStation(ScriptedStation):
    """Knows its objects: one under the gripper, which a grasp moves by 30 and 40 mm, and one far from it."""

    def object_positions_m(self) -> NDArray[np.float64]:
        x_m, y_m = self.pose.x_m, self.pose.y_m
        moved = "close" in self.calls
        under = (x_m + 0.03, y_m + 0.04, 0.3) if moved else (x_m, y_m, 0.02)
        return np.array([(x_m + 1.0, y_m, 0.02), under])


def test_what_was_not_reached_was_not_measured() -> None:
    blocked = run(ScriptedStation(faults={"lift": 0}, contact_force_n=17.0), method="random")
    assert (blocked.contact_force_n, blocked.closed_m, blocked.lifted_m, blocked.score) == (17.0, 0.03, None, None)
    stopped = run(ScriptedStation(faults={"descend": 0}), method="random")
    assert (stopped.contact_force_n, stopped.contact_height_m, stopped.closed_m) == (None, None, None)
