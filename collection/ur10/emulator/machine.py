"""What state the emulated controller is in: power, safety, program; and who may change what."""

from __future__ import annotations

from enum import IntEnum


class RobotMode(IntEnum):
    """``robot_mode``; the names are the dashboard's."""

    NO_CONTROLLER = -1
    DISCONNECTED = 0
    CONFIRM_SAFETY = 1
    BOOTING = 2
    POWER_OFF = 3
    POWER_ON = 4
    IDLE = 5
    BACKDRIVE = 6
    RUNNING = 7


class SafetyMode(IntEnum):
    """``safety_mode``; the names are the dashboard's."""

    NORMAL = 1
    REDUCED = 2
    PROTECTIVE_STOP = 3
    RECOVERY = 4
    SAFEGUARD_STOP = 5
    SYSTEM_EMERGENCY_STOP = 6
    ROBOT_EMERGENCY_STOP = 7
    VIOLATION = 8
    FAULT = 9


class Runtime(IntEnum):
    """``runtime_state`` of the program."""

    STOPPING = 0
    STOPPED = 1
    PLAYING = 2
    PAUSING = 3
    PAUSED = 4
    RESUMING = 5


EMERGENCIES = (SafetyMode.SYSTEM_EMERGENCY_STOP, SafetyMode.ROBOT_EMERGENCY_STOP)
UNLOCK_AFTER_S = 5.0
"""A protective stop cannot be unlocked earlier [s of robot time]."""
POWER_UP_S = 1.0
"""From ``power on`` to idle; some ten seconds on a real arm, of which nobody learns anything."""
RELEASE_S = 1.0

_STOPPED_BITS = {
    SafetyMode.NORMAL: 0b1,
    SafetyMode.REDUCED: 0b11,
    SafetyMode.PROTECTIVE_STOP: 1 << 2 | 1 << 10,
    SafetyMode.RECOVERY: 1 << 3,
    SafetyMode.SAFEGUARD_STOP: 1 << 4 | 1 << 10,
    SafetyMode.SYSTEM_EMERGENCY_STOP: 1 << 5 | 1 << 7 | 1 << 10,
    SafetyMode.ROBOT_EMERGENCY_STOP: 1 << 6 | 1 << 7 | 1 << 10,
    SafetyMode.VIOLATION: 1 << 8 | 1 << 10,
    SafetyMode.FAULT: 1 << 9 | 1 << 10,
}


class Machine:
    """Robot mode, safety mode and runtime state, with the changes that each allows."""

    def __init__(self) -> None:
        """A robot that is up and in remote control, with no program."""
        self.mode = RobotMode.RUNNING
        self.safety = SafetyMode.NORMAL
        self.runtime = Runtime.STOPPED
        self.remote = True
        self.popup = ""
        self._next: tuple[float, RobotMode] | None = None
        self._protected_s = 0.0

    @property
    def may_move(self) -> bool:
        """Whether the arm is powered and nothing holds it."""
        return self.mode is RobotMode.RUNNING and self.safety in (SafetyMode.NORMAL, SafetyMode.REDUCED)

    @property
    def safety_bits(self) -> int:
        """``safety_status_bits``."""
        return _STOPPED_BITS[self.safety]

    @property
    def status_bits(self) -> int:
        """``robot_status_bits``: power is on, a program runs."""
        powered = self.mode in (RobotMode.POWER_ON, RobotMode.IDLE, RobotMode.BACKDRIVE, RobotMode.RUNNING)
        return int(powered) | (self.runtime is Runtime.PLAYING) << 1

    def advance(self, now_s: float) -> None:
        """Finish what takes time: powering up, releasing brakes."""
        if self._next is not None and now_s >= self._next[0]:
            self.mode, self._next = self._next[1], None

    def protective_stop(self, now_s: float, cause: str) -> None:
        """Stop because something is wrong; a person, or a dashboard client, unlocks it."""
        if self.safety in (SafetyMode.NORMAL, SafetyMode.REDUCED):
            self.safety, self._protected_s, self.popup = SafetyMode.PROTECTIVE_STOP, now_s, cause
            self.runtime = Runtime.STOPPED

    def emergency_stop(self, *, system: bool = False) -> None:
        """The red button: power off, whatever else."""
        self.safety = SafetyMode.SYSTEM_EMERGENCY_STOP if system else SafetyMode.ROBOT_EMERGENCY_STOP
        self.mode, self._next, self.runtime = RobotMode.POWER_OFF, None, Runtime.STOPPED

    def safeguard_stop(self) -> None:
        """Somebody is in the cell: the program pauses."""
        if self.safety in (SafetyMode.NORMAL, SafetyMode.REDUCED):
            self.safety = SafetyMode.SAFEGUARD_STOP
            if self.runtime is Runtime.PLAYING:
                self.runtime = Runtime.PAUSED

    def fault(self, *, violation: bool = False) -> None:
        """The safety system itself has failed, or a limit of it was passed."""
        self.safety = SafetyMode.VIOLATION if violation else SafetyMode.FAULT
        self.mode, self._next, self.runtime = RobotMode.POWER_OFF, None, Runtime.STOPPED

    def release(self) -> None:
        """What a person does at the cell: turns the button back, leaves through the gate. The power stays off."""
        if self.safety in (*EMERGENCIES, SafetyMode.SAFEGUARD_STOP):
            self.safety = SafetyMode.NORMAL

    def unlock(self, now_s: float) -> bool:
        """Leave a protective stop; False where there is none, or too early."""
        if self.safety is not SafetyMode.PROTECTIVE_STOP or now_s - self._protected_s < UNLOCK_AFTER_S:
            return False
        self.safety, self.popup = SafetyMode.NORMAL, ""
        return True

    def too_early(self, now_s: float) -> bool:
        """Whether a protective stop cannot be unlocked yet."""
        return self.safety is SafetyMode.PROTECTIVE_STOP and now_s - self._protected_s < UNLOCK_AFTER_S

    def power_on(self, now_s: float) -> None:
        """Ends in idle, brakes on."""
        if self.mode is RobotMode.POWER_OFF and self.safety not in (*EMERGENCIES, SafetyMode.FAULT):
            self.mode, self._next = RobotMode.POWER_ON, (now_s + POWER_UP_S, RobotMode.IDLE)

    def power_off(self) -> None:
        """Brakes on, nothing runs."""
        self.mode, self._next, self.runtime = RobotMode.POWER_OFF, None, Runtime.STOPPED

    def release_brakes(self, now_s: float) -> None:
        """Ends in running; powers on first where that is missing."""
        if self.safety in (*EMERGENCIES, SafetyMode.FAULT):
            return
        if self.mode in (RobotMode.POWER_OFF, RobotMode.POWER_ON, RobotMode.IDLE):
            wait_s = RELEASE_S if self.mode is RobotMode.IDLE else POWER_UP_S + RELEASE_S
            self._next = (now_s + wait_s, RobotMode.RUNNING)
            self.mode = RobotMode.IDLE if self.mode is RobotMode.IDLE else RobotMode.POWER_ON

    def restart_safety(self) -> None:
        """Start the safety system anew: out of a fault or violation, with the power off."""
        if self.safety in (SafetyMode.FAULT, SafetyMode.VIOLATION):
            self.safety = SafetyMode.NORMAL
        self.power_off()
