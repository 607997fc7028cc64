"""What the emulated force reading has in it."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.bare_rig import let_pass

from handsight.collection.ur10.emulator.rig import EmulatedRig


def median_fz_n(rig: EmulatedRig) -> float:
    readings = []
    for _ in range(100):
        rig.tick(0.0)
        readings.append(rig.robot.read("actual_TCP_force")[2])
    return float(np.median(readings))


def test_payload_that_the_controller_does_not_know_of_pulls_down(rig: EmulatedRig) -> None:
    before_n = median_fz_n(rig)
    rig.robot.payload_kg = 1.3
    assert median_fz_n(rig) - before_n == pytest.approx(1.3 * 9.81, abs=1.5)


def test_zeroing_works_with_a_sensor_alone(cb3: EmulatedRig, e_series: EmulatedRig) -> None:
    for rig in (cb3, e_series):
        let_pass(rig, 0.1)
        rig.robot.sensor.zero()
    assert median_fz_n(e_series) == pytest.approx(0.0, abs=0.3)
    assert abs(median_fz_n(cb3)) > 3


def test_estimate_of_a_cb3_is_noisier_and_within_ten_newtons(cb3: EmulatedRig, e_series: EmulatedRig) -> None:
    spread_n = []
    for rig in (cb3, e_series):
        rig.robot.payload_kg = 1.3
        readings = []
        for _ in range(200):
            rig.tick(0.0)
            readings.append(rig.robot.read("actual_TCP_force")[2])
        spread_n.append(float(np.std(readings)))
        assert abs(np.median(readings)) < 10
    assert spread_n[0] > 2 * spread_n[1]


def test_drift_walks_away_and_is_taken_out(rig: EmulatedRig) -> None:
    before_n = median_fz_n(rig)
    rig.robot.sensor.drift_n_s = 2.0
    let_pass(rig, 3.0)
    assert median_fz_n(rig) - before_n > 5
    rig.robot.sensor.calm()
    assert median_fz_n(rig) == pytest.approx(before_n, abs=1.5)
