"""What the arm's client relies on in a controller: asked of the emulated ones, and of UR's own simulator.

UR's simulator is an outside judge of both: ``HANDSIGHT_URSIM=ADDRESS[,ADDRESS]``, of a CB3 or an e-Series, in remote
control, with the arm where it stands when it is new. No package brings it, so without the variable it is skipped.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.support.emulated_rig import need_ur_rtde, running_rig
from tests.support.rig_files import write_rig_file
from tests.support.ursim import ADDRESSES, NO_URSIM

from handsight.collection.ur10.arm import Arm
from handsight.collection.ur10.dashboard import Dashboard
from handsight.collection.ur10.kinematics import kinematics_id
from handsight.collection.ur10.rig_file import load_rig

POWER_S = 120.0
ANSWER_S, MOVE_S = 20.0, 60.0
STEP_M, SPEED_M_S, ACCELERATION_M_S2 = 0.03, 0.05, 0.5


@pytest.fixture(params=["emulated cb3", "emulated e-series", *(ADDRESSES or ["ursim"])])
def address(request: pytest.FixtureRequest) -> Iterator[str]:
    """Of a controller, powered or not."""
    need_ur_rtde()
    name: str = request.param
    if name == "ursim":
        pytest.skip(NO_URSIM)
    if not name.startswith("emulated "):
        yield name
        return
    with running_rig("--generation", name.removeprefix("emulated ")) as rig:
        with Dashboard(rig.robot) as dashboard:
            dashboard.ask("power off")
        yield rig.robot


@pytest.fixture
def arm(address: str, tmp_path: Path) -> Iterator[Arm]:
    """The client of the rig, of the controller's own generation, with the power on."""
    with Dashboard(address) as dashboard:
        version = re.search(r"(\d+)\.\d+\.\d+", dashboard.ask("PolyscopeVersion"))
        assert version is not None
        generation = "cb3" if version[1] == "3" else "e-series"
        assert dashboard.remote() is {"cb3": None, "e-series": True}[generation]
        power(dashboard)
    arm = Arm(
        load_rig(write_rig_file(tmp_path, robot=address, camera="127.0.0.3", generation=generation)), table_height_m=0.0
    )
    yield arm
    arm.close()


def power(dashboard: Dashboard) -> None:
    """As the recovery does it."""
    if dashboard.mode() != "RUNNING":
        dashboard.ask("power on")
        until(lambda: dashboard.mode() in ("IDLE", "RUNNING"))
        dashboard.ask("brake release")
        until(lambda: dashboard.mode() == "RUNNING")
    assert dashboard.safety() in ("NORMAL", "REDUCED")


def until(true: Callable[[], bool]) -> None:
    last_s = time.monotonic() + POWER_S
    while not true():
        assert time.monotonic() < last_s
        time.sleep(0.1)


def test_controller_does_what_the_client_relies_on(address: str, arm: Arm) -> None:
    identity = kinematics_id(address)
    assert identity is not None
    assert re.fullmatch("[0-9a-f]{48}", identity)
    arm.take_control()
    first, second = arm.state(), arm.state()
    assert second.timestamp_s > first.timestamp_s
    assert (first.stopped_by, len(first.joints_rad), len(first.temperatures_c)) == ("", 6, 6)
    down, far = list(first.tcp_pose), list(first.tcp_pose)
    down[2] -= STEP_M
    far[0] += 3.0
    assert arm.child.ask("inside_limits", down, timeout_s=ANSWER_S)
    assert not arm.child.ask("inside_limits", far, timeout_s=ANSWER_S)
    there = arm.child.ask("move_line", down, SPEED_M_S, ACCELERATION_M_S2, timeout_s=MOVE_S)
    assert there.tcp_pose[:3] == pytest.approx(down[:3], abs=1e-3)
    assert there.speed_m_s < 0.002
    arm.child.ask("move_line", list(first.tcp_pose), SPEED_M_S, ACCELERATION_M_S2, timeout_s=MOVE_S)
    # Nothing is in the way: a descent ends where it was sent, without contact.
    touch = arm.child.ask("descend", down, SPEED_M_S, ACCELERATION_M_S2, 40.0, 3, 0.2, 2.0, timeout_s=MOVE_S)
    assert not touch.contact
    assert np.isfinite(touch.baseline_n)
    assert touch.tcp_pose[:3] == pytest.approx(down[:3], abs=1e-3)


def test_controller_is_taken_over_from_a_client_that_was_killed(arm: Arm) -> None:
    arm.take_control()
    pose = list(arm.state().tcp_pose)
    arm.child.kill()
    arm.take_control()
    pose[2] -= STEP_M
    there = arm.child.ask("move_line", pose, SPEED_M_S, ACCELERATION_M_S2, timeout_s=MOVE_S)
    assert there.tcp_pose[:3] == pytest.approx(pose[:3], abs=1e-3)
