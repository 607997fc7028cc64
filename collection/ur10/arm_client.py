"""``ur_rtde`` as the arm's child has it: moves that are bounded, watched and given up in time.

Every move is asynchronous, ends at a target that was checked before, and is watched until it ends: safety status,
program state, and a clock that must go on.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handsight.collection.errors import DeviceError, DeviceLostError, RobotStoppedError
from handsight.collection.ur10.arm_state import ArmState
from handsight.collection.ur10.contact import ContactWatch, Touch
from handsight.collection.ur10.rig import RobotConfig

VARIABLES = (
    "timestamp",
    "actual_q",
    "actual_TCP_pose",
    "actual_TCP_speed",
    "actual_TCP_force",
    "joint_temperatures",
    "runtime_state",
    "robot_mode",
    "safety_status_bits",
)
FREQUENCY_HZ = {"cb3": 125.0, "e-series": 500.0}
POLL_S = 0.0005
ARRIVED_M, ARRIVED_RAD = 0.002, 0.01
STILL_M_S = 0.002
LEAST_LOOKS = 100
"""Before that no move is given up: a busy machine, or a fast emulator, lets seconds of the robot's time pass unseen."""
CONNECT_TRIES = 3
PLAYING = 2
JOINT_LIMITS_RAD = np.deg2rad([355.0, 355.0, 175.0, 355.0, 355.0, 355.0])


@dataclass(frozen=True, slots=True)
class OpenArm:
    """Opens the client in the child."""

    config: RobotConfig

    def __call__(self) -> ArmClient:
        """Connect, and say what the arm carries."""
        return ArmClient(self.config)


class ArmClient:
    """One connection to the controller; lives in the child alone."""

    def __init__(self, config: RobotConfig) -> None:
        """Connect, upload the control script, and set tool and payload.

        Raises:
            DeviceError: The controller refuses, or does not answer.
        """
        self._config = config
        self._hz = FREQUENCY_HZ[config.generation]
        self._receive = self._tried(self._open_receive)
        self._seen = (-1.0, time.monotonic())
        self._control: Any = None
        self.still_at_it: Callable[[], None] = lambda: None
        """Called with every reading, so that a hanging call of the library is told from a long move."""

    def _open_receive(self) -> Any:
        from rtde_receive import RTDEReceiveInterface

        return RTDEReceiveInterface(self._config.address, self._hz, list(VARIABLES))

    def _open_control(self) -> Any:
        from rtde_control import RTDEControlInterface

        flags = RTDEControlInterface.FLAG_UPLOAD_SCRIPT
        if self._config.upper_registers:
            flags |= RTDEControlInterface.FLAG_UPPER_RANGE_REGISTERS
        return RTDEControlInterface(self._config.address, self._hz, flags)

    def _tried(self, connect: Callable[[], Any]) -> Any:
        for left in reversed(range(CONNECT_TRIES)):
            try:
                return connect()
            except (RuntimeError, OSError) as error:
                if not left or "IN_USE" in str(error).upper() or "in use" in str(error):
                    raise DeviceError(f"cannot connect to {self._config.address}: {error}") from error
        raise AssertionError

    def take_control(self) -> None:
        """Upload the control script and set tool and payload; only then can the arm be moved.

        Raises:
            DeviceError: Local control, registers in use, or a controller that is not ready.
        """
        if self._control is None:
            self._control = self._tried(self._open_control)
        elif not self._control.isProgramRunning() and not self._control.reuploadScript():
            raise DeviceError("the control script could not be uploaded again")
        config = self._config
        self._must(self._control.setTcp([0.0, 0.0, config.tcp_length_m, 0.0, 0.0, 0.0]), "setTcp")
        self._must(self._control.setPayload(config.payload_kg, list(config.centre_of_mass_m)), "setPayload")

    def state(self) -> ArmState:
        """The newest data, which must be new.

        Raises:
            DeviceLostError: Nothing new came for ``stale_s``.
        """
        timestamp_s = self._timestamp_s()
        r = self._receive
        speed = r.getActualTCPSpeed()
        force = r.getActualTCPForce()
        return ArmState(
            timestamp_s=timestamp_s,
            joints_rad=tuple(r.getActualQ()),
            tcp_pose=tuple(r.getActualTCPPose()),
            speed_m_s=float(np.linalg.norm(speed[:3])),
            force_n=(force[0], force[1], force[2]),
            torque_nm=(force[3], force[4], force[5]),
            temperatures_c=tuple(r.getJointTemperatures()),
            runtime=int(r.getRuntimeState()),
            mode=int(r.getRobotMode()),
            safety_bits=int(r.getSafetyStatusBits()),
        )

    def fresh_state(self) -> ArmState:
        """As :meth:`state`, and surely sent after the call.

        Raises:
            DeviceLostError: Nothing new came for ``stale_s``.
        """
        first_s = self._timestamp_s()
        while self._timestamp_s() == first_s:
            time.sleep(POLL_S)
        return self.state()

    def _timestamp_s(self) -> float:
        self.still_at_it()
        timestamp_s, now_s = float(self._receive.getTimestamp()), time.monotonic()
        if timestamp_s != self._seen[0]:
            self._seen = (timestamp_s, now_s)
        elif now_s - self._seen[1] > self._config.stale_s:
            raise DeviceLostError(f"no new data for {now_s - self._seen[1]:.2f} s: the connection is gone")
        return timestamp_s

    def inside_limits(self, pose: Sequence[float]) -> bool:
        """Whether the controller's own safety planes and joint limits allow a pose.

        Raises:
            RobotStoppedError: The arm is stopped.
        """
        inside = bool(self._ready().isPoseWithinSafetyLimits(list(pose)))
        if not inside:
            # An arm that is stopped answers no to everything.
            self._refuse_stopped(self.fresh_state())
        return inside

    def move_line(self, pose: Sequence[float], speed_m_s: float, acceleration_m_s2: float) -> ArmState:
        """Go there in a straight line and stand; returns where the arm then is.

        Raises:
            RobotStoppedError: The controller stopped the arm, or the joints came to their limits.
            DeviceError: It did not arrive.
        """
        self._start_line(pose, speed_m_s, acceleration_m_s2)
        state = self._watch(self._deadline_s(pose, speed_m_s))
        return self._arrived(state, pose)

    def descend(
        self,
        pose: Sequence[float],
        speed_m_s: float,
        acceleration_m_s2: float,
        threshold_n: float,
        samples: int,
        baseline_s: float,
        stop_acceleration_m_s2: float,
    ) -> Touch:
        """Go slowly down to a pose, or until the force has been over the threshold for so many readings in a row.

        Raises:
            RobotStoppedError: The controller stopped the arm.
            DeviceError: It arrived nowhere.
        """
        watch = ContactWatch(self.baseline_n(baseline_s), threshold_n, samples)
        self._start_line(pose, speed_m_s, acceleration_m_s2)
        state = self._watch(self._deadline_s(pose, speed_m_s), until=watch.seen)
        if not watch.contact:
            return watch.touch(self._arrived(state, pose))
        self._ready().stopL(stop_acceleration_m_s2)
        return watch.touch(self.standstill())

    def baseline_n(self, seconds: float) -> float:
        """Median vertical force over so much of the robot's time, at standstill [N]."""
        first = self.standstill()
        forces = [first.force_n[2]]
        state = first
        while state.timestamp_s - first.timestamp_s < seconds:
            state = self.fresh_state()
            forces.append(state.force_n[2])
        return float(np.median(forces))

    def standstill(self) -> ArmState:
        """Wait until the arm stands.

        Raises:
            DeviceError: It still moves after five seconds of its time.
        """
        state = self.fresh_state()
        until_s = state.timestamp_s + 5.0
        still = seen = 0
        while still < 3:
            self._refuse_stopped(state)
            seen += 1
            if state.timestamp_s > until_s and seen > LEAST_LOOKS:
                raise DeviceError("the arm does not come to rest")
            still = still + 1 if state.speed_m_s < STILL_M_S else 0
            state = self.fresh_state()
        return state

    def stop(self, acceleration_m_s2: float) -> None:
        """Brake, wherever the arm is."""
        if self._control is not None:
            self._control.stopL(acceleration_m_s2)

    def close(self) -> None:
        """Stop the script; the connections end with the process."""
        if self._control is not None:
            self._control.stopScript()
        self._receive.disconnect()

    def _start_line(self, pose: Sequence[float], speed_m_s: float, acceleration_m_s2: float) -> None:
        control = self._ready()
        self._refuse_stopped(self.fresh_state())
        if len(pose) != 6 or not np.isfinite(np.asarray(pose, dtype=np.float64)).all():
            raise DeviceError(f"pose {pose!r} is not six finite numbers")
        self._must(control.moveL(list(pose), speed_m_s, acceleration_m_s2, True), "moveL")

    def _watch(self, seconds: float, until: Callable[[ArmState], bool] | None = None) -> ArmState:
        """Watch an asynchronous move until it ends, ``until`` is true, or so much of the robot's time is over."""
        control = self._ready()
        state = self.fresh_state()
        begun_s = state.timestamp_s
        recent: deque[bool] = deque(maxlen=3)
        seen = 0
        while True:
            self._refuse_stopped(state)
            seen += 1
            if until is not None and until(state):
                return state
            if bool(np.any(np.abs(state.joints_rad) > JOINT_LIMITS_RAD)):
                control.stopL(2.0)
                raise RobotStoppedError("a joint came to its limit: unwind the arm by way of 'rig home'")
            recent.append(control.getAsyncOperationProgress() < 0)
            if all(recent) and len(recent) == recent.maxlen and state.speed_m_s < STILL_M_S:
                return state
            if state.timestamp_s - begun_s > seconds and seen > LEAST_LOOKS:
                control.stopL(2.0)
                raise DeviceError(f"a move took longer than {seconds:.1f} s of the robot's time")
            state = self.fresh_state()

    def _arrived(self, state: ArmState, pose: Sequence[float]) -> ArmState:
        state = self.standstill()
        off_m = float(np.linalg.norm(np.subtract(state.tcp_pose[:3], pose[:3])))
        if off_m > ARRIVED_M:
            raise DeviceError(f"the arm stands {1e3 * off_m:.1f} mm from where it was sent")
        return state

    def _deadline_s(self, pose: Sequence[float], speed_m_s: float) -> float:
        path_m = float(np.linalg.norm(np.subtract(self.state().tcp_pose[:3], pose[:3])))
        return 8.0 + 2.0 * path_m / speed_m_s

    def _refuse_stopped(self, state: ArmState) -> None:
        if state.stopped_by:
            raise RobotStoppedError(state.stopped_by)
        if self._control is not None and state.runtime != PLAYING:
            raise RobotStoppedError(f"the control script does not run any more (runtime state {state.runtime})")

    def _ready(self) -> Any:
        if self._control is None:
            raise DeviceError("the arm is only watched: nobody took control of it")
        return self._control

    def _must(self, good: object, what: str) -> None:
        if not good:
            state = self.state()
            if state.stopped_by:
                raise RobotStoppedError(f"{what} was refused: {state.stopped_by}")
            raise DeviceError(f"the controller did not carry out {what}")
