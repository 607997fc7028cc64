"""The real ``ur_rtde``, in a process of its own, takes the emulator for a robot."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from tests.support.emulated_rig import RunningRig, need_ur_rtde, running_rig

CONNECT = """
import json, sys, time
import rtde_control, rtde_receive, dashboard_client
address = sys.argv[1]
R = rtde_receive.RTDEReceiveInterface(address)
C = rtde_control.RTDEControlInterface(address)
D = dashboard_client.DashboardClient(address)
D.connect()
C.setTcp([0, 0, 0.16, 0, 0, 0])
C.setPayload(1.3, [0, 0, 0.06])
def at(z):
    pose = R.getActualTCPPose()
    pose[2] = z
    return pose
def until(condition, limit_s=20):
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.005)
"""

MOVES = (
    CONNECT
    + """
answers = {"tcp": C.getTCPOffset(), "steady": C.isSteady()}
answers["inside"] = C.isPoseWithinSafetyLimits(at(0.3)), C.isPoseWithinSafetyLimits(at(-0.2))
answers["line"] = C.moveL(at(0.3), 0.5, 2.0), R.getActualTCPPose()[2]
answers["joints_s"] = len(R.getActualQ())
base = sorted(R.getActualTCPForce()[2] for _ in range(40) if time.sleep(0.003) is None)[20]
assert C.moveL(at(-0.05), 0.05, 0.5, True)
hits = 0
while hits < 3 and C.getAsyncOperationProgress() >= 0:
    hits = hits + 1 if R.getActualTCPForce()[2] - base > 40 else 0
    time.sleep(0.002)
C.stopL(5.0)
answers["touched"] = hits, R.getActualTCPPose()[2], R.isProtectiveStopped()
answers["away"] = C.moveL(at(0.2), 0.5, 2.0)
q = R.getActualQ()
q[0] += 0.2
answers["turned"] = C.moveJ(q, 1.0, 2.0), abs(R.getActualQ()[0] - q[0])
print(json.dumps(answers))
"""
)

RECOVERS = (
    CONNECT
    + """
answers = {"crash": C.moveL(at(-0.1), 0.5, 2.0)}
until(R.isProtectiveStopped)
try:
    D.unlockProtectiveStop()
    answers["early"] = "unlocked"
except Exception as error:
    answers["early"] = str(error)
then = R.getTimestamp()
until(lambda: R.getTimestamp() > then + 5.2)
D.closeSafetyPopup()
D.unlockProtectiveStop()
until(lambda: not R.isProtectiveStopped())
answers["without_upload"] = C.moveL(at(0.3), 0.5, 2.0)
answers["reuploaded"] = C.reuploadScript()
until(C.isProgramRunning)  # It returns before the client has read that the program runs.
answers["away"] = C.moveL(at(0.3), 0.5, 2.0), R.getActualTCPPose()[2]
print(json.dumps(answers))
"""
)

IS_REFUSED = """
import json, sys
import rtde_control
try:
    rtde_control.RTDEControlInterface(sys.argv[1])
    print(json.dumps({"said": "connected"}))
except Exception as error:
    print(json.dumps({"said": str(error)}))
"""

FEEDS = (
    CONNECT
    + """
C.setWatchdog(10)
for _ in range(10):
    C.kickWatchdog()
    time.sleep(0.02)
answers = {"fed": C.isProgramRunning()}
until(lambda: not C.isProgramRunning())
answers["starved"] = C.isProgramRunning()
print(json.dumps(answers))
"""
)

STALE = """
import json, sys, time
import rtde_receive
R = rtde_receive.RTDEReceiveInterface(sys.argv[1], 50.0, ["timestamp", "actual_TCP_pose", "safety_status_bits"])
print("connected", flush=True)
seen, last, since = 0, -1.0, time.monotonic()
while time.monotonic() < since + 1.0:
    now = R.getTimestamp()
    if now != last:
        last, since, seen = now, time.monotonic(), seen + 1
    time.sleep(0.005)
print(json.dumps({"seen": seen}))
"""


@pytest.fixture(params=["cb3", "e-series"])
def rig(request: pytest.FixtureRequest) -> Iterator[RunningRig]:
    need_ur_rtde()
    with running_rig("--generation", request.param) as running:
        yield running


def test_it_moves_touches_and_leaves(rig: RunningRig) -> None:
    answers = rig.client(MOVES)
    assert answers["tcp"] == pytest.approx((0, 0, 0.16, 0, 0, 0))
    assert answers["steady"] is True
    assert answers["inside"] == [True, False]
    assert answers["line"] == [True, pytest.approx(0.3, abs=1e-3)]
    hits, height_m, stopped = answers["touched"]
    # 40 N are 10 mm of the spring; the rest is what a client of a busy machine needs to notice.
    assert (hits, stopped) == (3, False)
    assert -0.035 < height_m < -0.008
    assert answers["away"] is True
    assert answers["turned"] == [True, pytest.approx(0.0, abs=1e-3)]


def test_it_recovers_from_a_protective_stop(rig: RunningRig) -> None:
    answers = rig.client(RECOVERS)
    assert answers["crash"] is False
    assert "5s after occurrence" in answers["early"]
    assert answers["without_upload"] is False
    assert answers["reuploaded"] is True
    assert answers["away"] == [True, pytest.approx(0.3, abs=1e-3)]
    assert len(rig.do("status")["protective_stops"]) == 1


def test_it_is_refused_registers_that_somebody_else_writes(rig: RunningRig) -> None:
    rig.do("fault", fault="in-use")
    assert "already in use" in rig.client(IS_REFUSED)["said"]
    rig.do("clear")
    assert rig.client(IS_REFUSED)["said"] == "connected"


def test_its_watchdog_ends_the_program(rig: RunningRig) -> None:
    assert rig.client(FEEDS) == {"fed": True, "starved": False}


def test_local_control_is_told(rig: RunningRig) -> None:
    rig.do("fault", fault="remote-off")
    said = rig.client(IS_REFUSED)["said"]
    if rig.do("status")["remote"]:
        pytest.fail("remote control came back by itself")
    assert ("remote" in said) == ("e-series" in rig.generation)


@pytest.mark.parametrize("fault", ["drop", "freeze:s=4", "kill-controller:s=1"])
def test_its_readings_stand_still_when_the_connection_fails(rig: RunningRig, fault: str) -> None:
    rig.do("fault", fault=f"{fault}@t>3")
    assert rig.client(STALE)["seen"] > 5
