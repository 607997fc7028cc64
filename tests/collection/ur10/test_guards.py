"""When a rig pauses by itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.support.factories import make_attempt, make_header

from handsight.collection.sim.config import D435_ON_GRIPPER
from handsight.collection.ur10.guards import SuccessWindow, disk_fault, height_over_table_m, temperature_fault
from handsight.collection.ur10.rig import GuardConfig
from handsight.datasets.records import Outcome
from handsight.servoing.planar import PlanarPose

HEADER = make_header()


def test_a_hot_joint_is_named() -> None:
    config = GuardConfig(joint_temperature_c=60.0)
    assert temperature_fault(config, (30.0, 59.0, 60.0)) == ""
    assert temperature_fault(config, (30.0, 71.0, 60.0)).startswith("joint 1 has 71 degrees")


def test_a_full_disk_is_told_of_a_folder_that_is_not_there_yet(tmp_path: Path) -> None:
    assert disk_fault(GuardConfig(disk_free_gb=0.0), tmp_path / "not" / "yet") == ""
    assert "are free on the disk" in disk_fault(GuardConfig(disk_free_gb=1e6), tmp_path / "not" / "yet")


@pytest.mark.parametrize("thing_m", [0.0, 0.05])
def test_the_height_of_what_lies_on_the_table(thing_m: float) -> None:
    pose = PlanarPose(x_m=0.65, y_m=0.0, angle_rad=0.7).pose_base_tool(0.5)
    camera_m = D435_ON_GRIPPER.pose_base_camera(pose)[2, 3]
    depth = np.full((480, 640), round(1000 * camera_m), np.uint16)
    depth[200:260, 300:360] = round(1000 * (camera_m - thing_m))
    depth[:40] = 0
    assert height_over_table_m(depth, 0.001, D435_ON_GRIPPER, pose) == pytest.approx(thing_m, abs=0.0006)


def test_a_window_of_failures_is_told_once_it_is_full() -> None:
    window = SuccessWindow(GuardConfig(success_window=10, least_success=0.15, most_aborted=0.5))
    attempts = [make_attempt(HEADER, n, outcome=Outcome.HELD if n == 0 else Outcome.EMPTY) for n in range(10)]
    said = [window.add(attempt) for attempt in attempts]
    assert said[:9] == [""] * 9
    assert said[9].startswith("10.0% of the last 10 grasps succeeded")


def test_aborted_attempts_are_told_apart_from_failures() -> None:
    window = SuccessWindow(GuardConfig(success_window=4, least_success=0.0, most_aborted=0.5))
    outcomes = (Outcome.EMPTY, Outcome.ABORTED, Outcome.ABORTED, Outcome.ABORTED)
    said = [window.add(make_attempt(HEADER, n, outcome=outcome)) for n, outcome in enumerate(outcomes)]
    assert said[-1].startswith("75% of the last 4 attempts carry no label")


def test_a_window_of_nothing_watches_nothing() -> None:
    window = SuccessWindow(GuardConfig(success_window=0))
    assert window.add(make_attempt(HEADER, 0, outcome=Outcome.ABORTED)) == ""
