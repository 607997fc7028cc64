"""Dashboard answers, letter for letter, and the states behind them."""

from __future__ import annotations

import pytest
from tests.support.bare_rig import let_pass, start

from handsight.collection.ur10.emulator.dashboard import LOCKED, TOO_EARLY
from handsight.collection.ur10.emulator.machine import RobotMode, SafetyMode
from handsight.collection.ur10.emulator.rig import EmulatedRig


def test_answers_of_a_robot_that_is_up(rig: EmulatedRig) -> None:
    ask = rig.dashboard.answer
    assert ask("robotmode") == "Robotmode: RUNNING"
    assert ask("safetymode") == "Safetymode: NORMAL"
    assert ask("safetystatus") == "Safetystatus: NORMAL"
    assert ask("running") == "Program running: false"
    assert ask("stop") == "Stopped"
    assert ask("get serial number").isdigit()
    assert ask("load x.urp") == "Loading program: x.urp"


def test_versions_tell_the_generations_apart(cb3: EmulatedRig, e_series: EmulatedRig) -> None:
    assert cb3.dashboard.answer("PolyscopeVersion").startswith("URSoftware 3.15.8.")
    assert e_series.dashboard.answer("PolyscopeVersion").startswith("URSoftware 5.11.1.")
    assert e_series.dashboard.answer("is in remote control") == "true"
    assert cb3.dashboard.answer("is in remote control").startswith("could not understand")


def test_protective_stop_is_unlocked_after_five_seconds_and_not_before(rig: EmulatedRig) -> None:
    rig.robot.protective_stop("a test")
    assert rig.dashboard.answer("safetystatus") == "Safetystatus: PROTECTIVE_STOP"
    assert rig.robot.read("safety_status_bits") & 1 << 2
    let_pass(rig, 4.9)
    assert rig.dashboard.answer("unlock protective stop") == TOO_EARLY
    let_pass(rig, 0.2)
    assert rig.dashboard.answer("close safety popup") == "closing safety popup"
    assert rig.dashboard.answer("unlock protective stop") == "Protective stop releasing"
    assert rig.dashboard.answer("safetystatus") == "Safetystatus: NORMAL"
    assert rig.robot.read("safety_status_bits") == 1


def test_power_comes_back_by_power_on_and_brake_release(rig: EmulatedRig) -> None:
    rig.robot.machine.power_off()
    assert rig.dashboard.answer("power on") == "Powering on"
    let_pass(rig, 1.5)
    assert rig.dashboard.answer("robotmode") == "Robotmode: IDLE"
    assert rig.dashboard.answer("brake release") == "Brake releasing"
    let_pass(rig, 1.5)
    assert rig.dashboard.answer("robotmode") == "Robotmode: RUNNING"


def test_controller_that_starts_anew_has_forgotten(rig: EmulatedRig) -> None:
    start(rig)
    let_pass(rig, 2.0)
    clock_s = rig.robot.clock_s
    rig.robot.reboot()
    let_pass(rig, 0.5)
    assert rig.dashboard.answer("robotmode") == "Robotmode: POWER_OFF"
    assert rig.robot.read("timestamp") == pytest.approx(0.5, abs=0.01)
    assert rig.robot.clock_s > clock_s
    assert rig.robot.read("tcp_offset") == pytest.approx((0.0,) * 6)
    assert rig.robot.program is None


def test_emergency_stop_yields_to_a_person_alone(rig: EmulatedRig) -> None:
    rig.robot.machine.emergency_stop()
    for command in ("unlock protective stop", "close safety popup", "power on", "brake release", "restart safety"):
        rig.dashboard.answer(command)
        let_pass(rig, 3.0)
        assert rig.robot.machine.safety is SafetyMode.ROBOT_EMERGENCY_STOP
        assert rig.robot.machine.mode is RobotMode.POWER_OFF
    rig.robot.machine.release()
    assert rig.dashboard.answer("safetystatus") == "Safetystatus: NORMAL"
    assert rig.dashboard.answer("robotmode") == "Robotmode: POWER_OFF"


def test_fault_of_the_safety_system_is_left_by_restarting_it(rig: EmulatedRig) -> None:
    rig.robot.machine.fault()
    rig.dashboard.answer("power on")
    assert rig.robot.machine.mode is RobotMode.POWER_OFF
    assert rig.dashboard.answer("restart safety") == "Restarting safety"
    assert rig.dashboard.answer("safetystatus") == "Safetystatus: NORMAL"


@pytest.mark.parametrize("command", ["play", "power on", "brake release", "unlock protective stop"])
def test_local_control_refuses_what_starts_something(e_series: EmulatedRig, command: str) -> None:
    e_series.robot.machine.remote = False
    assert e_series.dashboard.answer("is in remote control") == "false"
    assert e_series.dashboard.answer(command) == LOCKED
    e_series.robot.upload("def rtde_control():\nend\n")
    assert e_series.robot.program is None
