"""What is done about a stop, in which order, how often, and what never is."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.line_server import answering
from tests.support.rig_files import write_rig_file

from handsight.collection.errors import DeviceLostError, RigPausedError
from handsight.collection.ur10.dashboard import Dashboard
from handsight.collection.ur10.logs import OperatorLog
from handsight.collection.ur10.recovery import Recovery
from handsight.collection.ur10.rig import RecoveryConfig, RigConfig
from handsight.collection.ur10.rig_file import load_rig


class Controller:
    """A dashboard with a safety state; what it was asked is kept."""

    def __init__(self, safety: str = "NORMAL", mode: str = "RUNNING", *, remote: bool = True, early: int = 0) -> None:
        self.safety, self.mode, self.remote, self.early = safety, mode, remote, early
        self.asked: list[str] = []

    def answer(self, got: bytes) -> bytes:
        return b"".join(f"{self._one(line)}\n".encode() for line in got.decode().splitlines())

    def _one(self, line: str) -> str:
        self.asked.append(line)
        if line == "unlock protective stop":
            self.early -= 1
            if self.early >= 0:
                return "Cannot unlock protective stop until 5s after occurrence."
            self.safety = "NORMAL"
            return "Protective stop releasing"
        if line == "restart safety":
            self.safety, self.mode = "NORMAL", "POWER_OFF"
        if line == "power on":
            self.mode = "IDLE"
        if line == "brake release":
            self.mode = "RUNNING"
        answers = {
            "safetystatus": f"Safetystatus: {self.safety}",
            "robotmode": f"Robotmode: {self.mode}",
            "is in remote control": str(self.remote).lower(),
        }
        return answers.get(line, "done")

    @property
    def acts(self) -> list[str]:
        """What it was asked for that changes something."""
        return [line for line in self.asked if line not in ("safetystatus", "robotmode", "is in remote control")]


class Fake:
    """Arm and gripper that write down what they are asked for."""

    def __init__(self, fails: int = 0) -> None:
        self.did: list[str] = []
        self.fails = fails
        self.child = self

    def kill(self) -> None:
        self.did.append("kill")

    def take_control(self) -> None:
        self.fails -= 1
        if self.fails >= 0:
            raise DeviceLostError("arm: not yet")
        self.did.append("take control")

    def state(self) -> None:
        return None

    def pose_of(self, _: object) -> np.ndarray:
        pose = np.eye(4)
        pose[2, 3] = 0.12
        return pose

    def lift_straight(self, height_m: float, *, speed_m_s: float) -> None:
        self.did.append(f"lift to {height_m:.2f} at {speed_m_s}")

    def disconnect(self) -> None:
        self.did.append("disconnect")

    def recover(self) -> None:
        self.did.append("recover")

    def open(self) -> None:
        self.did.append("open")


@pytest.fixture
def rig(tmp_path: Path) -> RigConfig:
    return load_rig(write_rig_file(tmp_path, robot="127.0.0.1", camera="127.0.0.3", generation="e-series"))


def recovered(
    rig: RigConfig, controller: Controller, devices: Fake, *, times: int = 1, **settings: Any
) -> list[dict[str, Any]]:
    """Recover so often against a controller, by a clock that only sleeping moves; returns the log."""
    now_s = 0.0

    def sleep(seconds: float) -> None:
        nonlocal now_s
        now_s += seconds

    with answering(controller.answer, greeting=b"Connected\n") as (_, port):
        rig = replace(
            rig,
            robot=replace(rig.robot, dashboard_port=port),
            recovery=replace(RecoveryConfig(), **settings),
        )
        log = OperatorLog(rig.operator_log, who="test")
        recovery = Recovery(rig, devices, devices, log, clock=lambda: now_s, sleep=sleep)  # type: ignore[arg-type]
        for _ in range(times):
            recovery.recover("descend: arm: protective stop")
            controller.safety = "PROTECTIVE_STOP"
    return [json.loads(line) for line in rig.operator_log.read_text(encoding="utf-8").splitlines()]


def test_a_protective_stop_is_waited_out_and_the_jaws_open_before_the_tool_is_lifted(rig: RigConfig) -> None:
    controller, devices = Controller("PROTECTIVE_STOP", early=3), Fake()
    log = recovered(rig, controller, devices)
    assert controller.acts == ["close safety popup", *["unlock protective stop"] * 4]
    assert devices.did == ["kill", "disconnect", "take control", "recover", "open", "lift to 0.22 at 0.05"]
    assert [line["what"] for line in log] == ["recovery begins", "protective stop", "recovered"]
    assert {line["who"] for line in log} == {"test"}


@pytest.mark.parametrize("safety", ["ROBOT_EMERGENCY_STOP", "SYSTEM_EMERGENCY_STOP", "SAFEGUARD_STOP"])
def test_what_a_person_caused_is_never_cleared(rig: RigConfig, safety: str) -> None:
    controller, devices = Controller(safety), Fake()
    with pytest.raises(RigPausedError, match=safety):
        recovered(rig, controller, devices, restart_safety=True)
    assert controller.acts == []
    assert devices.did == ["kill", "disconnect"]


@pytest.mark.parametrize("safety", ["FAULT", "VIOLATION"])
def test_a_broken_safety_system_is_restarted_only_where_the_operator_allows_it(rig: RigConfig, safety: str) -> None:
    controller = Controller(safety)
    with pytest.raises(RigPausedError, match="look at the controller's log"):
        recovered(rig, controller, Fake())
    assert controller.acts == []
    recovered(rig, controller, Fake(), restart_safety=True)
    assert controller.acts == ["close safety popup", "restart safety", "power on", "brake release"]


def test_an_arm_without_power_is_switched_on_or_left(rig: RigConfig) -> None:
    with pytest.raises(RigPausedError, match="mode POWER_OFF"):
        recovered(rig, Controller(mode="POWER_OFF"), Fake(), power_on=False)
    controller = Controller(mode="POWER_OFF")
    recovered(rig, controller, Fake())
    assert controller.acts == ["power on", "brake release"]


def test_local_control_is_a_persons_business(rig: RigConfig) -> None:
    with pytest.raises(RigPausedError, match="local control"):
        recovered(rig, Controller(remote=False), Fake())


def test_more_stops_than_the_cap_pause_the_rig(rig: RigConfig) -> None:
    devices = Fake()
    with pytest.raises(RigPausedError, match="more than 2 protective stops within 10 minutes"):
        recovered(rig, Controller("PROTECTIVE_STOP"), devices, times=3, protective_stops_per_10_min=2)
    assert devices.did.count("open") == 2


def test_what_fails_on_the_way_is_tried_again_and_then_given_up(rig: RigConfig) -> None:
    devices = Fake(fails=2)
    recovered(rig, Controller(), devices)
    assert devices.did[-1] == "lift to 0.22 at 0.05"
    with pytest.raises(RigPausedError, match="recovery ended with: arm: not yet"):
        recovered(rig, Controller(), Fake(fails=3))


def test_a_controller_that_does_not_answer_is_waited_for_and_then_given_up(rig: RigConfig) -> None:
    with answering(lambda got: b"") as (_, port):
        gone = replace(rig, robot=replace(rig.robot, dashboard_port=port))
    times = iter(range(0, 1000, 20))
    recovery = Recovery(
        gone,
        Fake(),  # type: ignore[arg-type]
        Fake(),  # type: ignore[arg-type]
        OperatorLog(gone.operator_log),
        clock=lambda: float(next(times)),
        sleep=lambda seconds: None,
    )
    with pytest.raises(RigPausedError, match="has not answered for 60 s"):
        recovery.recover("begin")


def test_a_dashboard_that_hangs_up_is_lost() -> None:
    with (
        answering(lambda got: None, greeting=b"Connected\n") as (address, port),
        Dashboard(address, port) as dashboard,
        pytest.raises(DeviceLostError, match="robotmode"),
    ):
        dashboard.ask("robotmode")
