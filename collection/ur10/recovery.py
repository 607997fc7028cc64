"""What is done about a stop without a person, how often, and where a person has to come.

The ladder: see what the controller says; wait out and unlock a protective stop; power an arm that has lost it; give
the client a new process; get the gripper going; open the jaws; lift the tool slowly. An emergency or safeguard stop is
never cleared: somebody caused it. Every step goes to the operator log.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

from handsight.collection.errors import DeviceError, DeviceLostError, PoseRefusedError, RigPausedError
from handsight.collection.ur10.arm import Arm
from handsight.collection.ur10.dashboard import Dashboard
from handsight.collection.ur10.gripper import Gripper
from handsight.collection.ur10.logs import OperatorLog
from handsight.collection.ur10.rig import RigConfig

RECONNECT_S = 60.0
"""How long a controller that does not answer is waited for."""
UNLOCK_S = 30.0
POWER_S = 90.0
POLL_S = 0.25
TRIES = 3
"""Of a whole recovery: what went wrong may go wrong again on the way."""
PERSON_NEEDED = {
    "SAFEGUARD_STOP": "somebody is in the cell",
    "AUTOMATIC_MODE_SAFEGUARD_STOP": "somebody is in the cell",
    "SYSTEM_EMERGENCY_STOP": "an emergency stop was pressed",
    "ROBOT_EMERGENCY_STOP": "an emergency stop was pressed",
    "SYSTEM_THREE_POSITION_ENABLING_STOP": "somebody holds the enabling device",
}
BROKEN = ("FAULT", "VIOLATION")


class Recovery:
    """The ladder of one rig, with its caps."""

    def __init__(
        self,
        rig: RigConfig,
        arm: Arm,
        gripper: Gripper,
        log: OperatorLog,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Nothing was recovered from yet; ``clock`` and ``sleep`` are the process's own unless given."""
        self._rig, self._arm, self._gripper, self._log = rig, arm, gripper, log
        self._clock, self._sleep = clock, sleep
        self._recoveries: deque[float] = deque()
        self._stops: deque[float] = deque()

    def recover(self, cause: str) -> None:
        """Get the rig to where an attempt can begin: arm up, jaws open, everything connected.

        Raises:
            RigPausedError: A person has to come, or it happened too often.
        """
        self._count(
            self._recoveries, 3600.0, self._rig.recovery.recoveries_per_hour, "recoveries within an hour", cause
        )
        self._log.note("recovery begins", cause=cause)
        for left in reversed(range(TRIES)):
            try:
                self._climb(cause)
            except PoseRefusedError as error:
                raise RigPausedError(f"{error}; free the arm by hand, then go on with 'rig home'") from error
            except DeviceError as error:
                self._log.note("recovery step failed", error=str(error))
                if not left:
                    raise RigPausedError(f"{cause}; recovery ended with: {error}") from error
            else:
                break
        self._log.note("recovered", cause=cause)

    def _climb(self, cause: str) -> None:
        self._arm.child.kill()
        self._gripper.disconnect()
        with self._dashboard() as dashboard:
            self._safe(dashboard, cause)
            self._powered(dashboard)
            if dashboard.remote() is False:
                raise RigPausedError("the controller is in local control: switch it to remote control")
        self._arm.take_control()
        self._gripper.recover()
        self._gripper.open()
        height_m = min(
            float(self._arm.pose_of(self._arm.state())[2, 3]) + self._rig.recovery.retreat_m,
            self._rig.workspace.overhead_height_m,
        )
        self._arm.lift_straight(height_m, speed_m_s=self._rig.recovery.retreat_speed_m_s)

    def _dashboard(self) -> Dashboard:
        until = self._clock() + RECONNECT_S
        while True:
            try:
                return Dashboard(self._rig.robot.address, self._rig.robot.dashboard_port)
            except DeviceLostError as error:
                if self._clock() > until:
                    raise RigPausedError(f"the controller has not answered for {RECONNECT_S:g} s: {error}") from error
                self._sleep(POLL_S)

    def _safe(self, dashboard: Dashboard, cause: str) -> None:
        """Have the safety system say NORMAL or REDUCED."""
        safety = dashboard.safety()
        if safety in PERSON_NEEDED:
            raise RigPausedError(f"{safety}: {PERSON_NEEDED[safety]}; clear it at the cell, then go on with --resume")
        if safety == "PROTECTIVE_STOP":
            self._unlock(dashboard, cause)
        elif safety in BROKEN:
            if not self._rig.recovery.restart_safety:
                raise RigPausedError(f"safety {safety}: look at the controller's log, then restart its safety system")
            self._log.note("safety restarted", safety=safety)
            dashboard.ask("close safety popup")
            dashboard.ask("restart safety")
            self._until(lambda: dashboard.safety() in ("NORMAL", "REDUCED"), POWER_S, "the safety system")

    def _unlock(self, dashboard: Dashboard, cause: str) -> None:
        config = self._rig.recovery
        self._count(self._stops, 600.0, config.protective_stops_per_10_min, "protective stops within 10 minutes", cause)
        self._log.note("protective stop", cause=cause)
        self._sleep(config.unlock_wait_s)
        dashboard.ask("close safety popup")

        def unlocked() -> bool:
            dashboard.ask("unlock protective stop")
            return dashboard.safety() in ("NORMAL", "REDUCED")

        self._until(unlocked, UNLOCK_S, "the protective stop to be unlocked")

    def _powered(self, dashboard: Dashboard) -> None:
        mode = dashboard.mode()
        if mode == "RUNNING":
            return
        if not self._rig.recovery.power_on:
            raise RigPausedError(f"the arm is in mode {mode}: switch it on at the controller")
        self._log.note("arm switched on", mode=mode)
        dashboard.ask("power on")
        self._until(lambda: dashboard.mode() in ("IDLE", "RUNNING"), POWER_S, "the arm's power")
        dashboard.ask("brake release")
        self._until(lambda: dashboard.mode() == "RUNNING", POWER_S, "the brakes")

    def _until(self, true: Callable[[], bool], seconds: float, what: str) -> None:
        until = self._clock() + seconds
        while not true():
            if self._clock() > until:
                raise RigPausedError(f"waited {seconds:g} s for {what}")
            self._sleep(POLL_S)

    def _count(self, times: deque[float], window_s: float, most: int, what: str, cause: str) -> None:
        now_s = self._clock()
        times.append(now_s)
        while times[0] < now_s - window_s:
            times.popleft()
        if len(times) > most:
            raise RigPausedError(f"more than {most} {what}; last: {cause}")
