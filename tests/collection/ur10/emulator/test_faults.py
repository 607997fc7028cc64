"""Faults as they are written, and the moments at which they happen."""

from __future__ import annotations

import pytest
from tests.support.bare_rig import call, let_pass, lowered, robotiq, start

from handsight.collection.ur10.emulator.errors import FaultError
from handsight.collection.ur10.emulator.faults import ACTIONS, Fault
from handsight.collection.ur10.emulator.machine import SafetyMode
from handsight.collection.ur10.emulator.rig import EmulatedRig


def test_fault_is_read_with_its_values_and_its_moment() -> None:
    fault = Fault.parse("gripper-fault:code=14@close")
    assert (fault.name, fault.number("code"), fault.when) == ("gripper-fault", 14.0, "close")
    assert Fault.parse("freeze").number("s") == 5.0
    assert Fault.parse("drop@z<0.05").when == "z<0.05"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("slipp", "'slipp', expected one of drop"),
        ("drop@sometime", "'sometime', expected one of rest"),
        ("freeze:seconds=3", "'seconds', expected s"),
        ("freeze:s=long", "'long', expected a number"),
        ("freeze:s", "expected KEY=VALUE"),
    ],
)
def test_fault_that_does_not_exist_is_refused(text: str, said: str) -> None:
    with pytest.raises(FaultError, match=said):
        Fault.parse(text)


def test_fault_waits_for_its_phase(e_series: EmulatedRig) -> None:
    start(e_series)
    e_series.faults.arm(Fault.parse("protective-stop@descend"))
    pose = lowered(e_series, -0.05)
    call(e_series, 3, (*pose, 0.1, 0.5), (0,))
    assert str(e_series.robot.machine.safety) == str(SafetyMode.NORMAL)  # Up is not down.
    height_m = e_series.robot.pose[2]
    call(e_series, 3, (*lowered(e_series, 0.1), 0.1, 0.5), (0,))
    assert e_series.robot.machine.safety is SafetyMode.PROTECTIVE_STOP
    assert [(fired.name, fired.phase) for fired in e_series.faults.fired] == [("protective-stop", "descend")]
    let_pass(e_series, 0.5)
    assert height_m - e_series.robot.pose[2] < 0.05


def test_way_to_where_it_descends_is_no_descent(e_series: EmulatedRig) -> None:
    start(e_series)
    e_series.faults.arm(Fault.parse("protective-stop@descend"))
    aslant = list(lowered(e_series, 0.1))
    aslant[1] += 0.05
    call(e_series, 3, (*aslant, 0.1, 0.5), (0,))
    assert e_series.faults.fired == []


def test_fault_waits_for_a_height(e_series: EmulatedRig) -> None:
    start(e_series)
    limit_m = e_series.robot.tip_z_m - 0.05
    e_series.faults.arm(Fault.parse(f"emergency-stop@z<{limit_m:.4f}"))
    call(e_series, 3, (*lowered(e_series, 0.1), 0.1, 0.5), (0,))
    assert e_series.robot.machine.safety is SafetyMode.ROBOT_EMERGENCY_STOP
    assert e_series.robot.tip_z_m == pytest.approx(limit_m, abs=0.01)
    assert e_series.robot.program is None


def test_jaws_tell_closing_from_opening(e_series: EmulatedRig) -> None:
    robotiq(e_series).answer("SET ACT 1")
    let_pass(e_series, 2.0)
    e_series.faults.arm(Fault.parse("gripper-fault:code=10@close"))
    robotiq(e_series).answer("SET POS 255 GTO 1")
    let_pass(e_series, 1.0)
    assert e_series.gripper.get("FLT") == 10
    assert e_series.gripper.get("POS") < 20  # It stopped where it was.


def test_register_in_use_is_told_to_the_next_client(e_series: EmulatedRig) -> None:
    e_series.faults.arm(Fault.parse("in-use"))
    assert "input_int_register_0" in e_series.rtde.taken
    e_series.faults.clear()
    assert not e_series.rtde.taken


def test_clearing_undoes_what_lasts(e_series: EmulatedRig) -> None:
    for text in ("force-noise", "force-drift", "remote-off", "gripper-fault", "joint-hot", "drop@lift"):
        e_series.faults.arm(Fault.parse(text))
    assert e_series.robot.read("joint_temperatures")[3] > 70
    e_series.faults.clear()
    assert e_series.robot.read("joint_temperatures")[3] < 40
    assert e_series.robot.machine.remote
    assert (e_series.gripper.fault, e_series.robot.sensor.extra_noise_n, e_series.faults.armed) == (0, 0.0, [])


def test_camera_fault_needs_a_camera(e_series: EmulatedRig) -> None:
    with pytest.raises(FaultError, match="this rig has no camera"):
        e_series.faults.arm(Fault.parse("camera-frozen"))


@pytest.mark.parametrize("name", sorted(ACTIONS))
def test_every_fault_reads_as_it_is_named(name: str) -> None:
    assert Fault.parse(f"{name}@reach").name == name
