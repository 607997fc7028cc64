"""The program that ``ur_rtde`` uploads, mimicked: the loop that takes commands from registers, not its URScript.

What the loop does with each command is what the uploaded text says, its oddities included: stopping synchronously is
``stopj`` until an asynchronous stop was asked for once, and bodies that are empty in the text for a CB3 are done at
once.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import UnreachableError
from handsight.collection.sim.kinematics import flange_pose
from handsight.collection.ur10.emulator.motion import Motion, Path, Servo, Velocity, joint_path, line_path
from handsight.collection.ur10.emulator.poses import joints_of, matrix_of, tcp_pose, vector_of

if TYPE_CHECKING:
    from handsight.collection.ur10.emulator.controller import Controller

READY, DONE = 1, 2
STOP_SCRIPT = 255
REALTIME = frozenset({6, 9, 10, 11, 24, 25, 26, 27, 38, 58, 66, 67, 68, 69, 70, 71})
EMPTY_ON_CB3 = frozenset({25, 26, 27, 28, 51, 52, 53, 54, 56, 62, 65})
"""Commands whose bodies are stripped from the text that a CB3 gets."""
CONTACT_N = 15.0
"""Change of force that ``tool_contact`` takes for a contact."""
BACKWARD_DECELERATION = 3.0

Steps = Generator[None, None, None]


class Program:
    """One upload of the control script."""

    def __init__(self, controller: Controller, script: str) -> None:
        """Start the loop; registers are those that the script's header names."""
        self._robot = controller
        self._offset = _register_offset(script)
        self._is_control = "rtde_control" in script
        self._executing = False
        self._command: Steps | None = None
        self._watched: Motion | None = None
        self._writes = self._operation = 0
        self._stop_type_line = False
        if self._is_control:
            self._finish_async()
            self._out(0, READY)

    @property
    def blocked(self) -> bool:
        """Whether a command is under way that the loop waits for."""
        return self._command is not None

    # The loop.

    def tick(self) -> None:
        """One turn of the loop."""
        if not self._is_control:
            return
        self._watch_async()
        if self._command is not None:
            self._resume()
            return
        command = self._robot.ints_in[self._offset]
        if command in REALTIME:
            self._run_at_once(command)
            self._out(0, READY)
        elif command == 0:
            self._executing = False
            self._out(0, READY)
        elif not self._executing:
            self._executing = True
            if command == STOP_SCRIPT:
                self._robot.stop_program()
                return
            self._start(command)

    def _resume(self) -> None:
        try:
            if self._command is not None:
                next(self._command)
                return
            self._out(0, DONE)
        except StopIteration:
            self._command = None
            self._out(0, DONE)
        except UnreachableError as error:
            self._command = None
            self._robot.protective_stop(str(error))

    def _start(self, command: int) -> None:
        try:
            self._command = self._begin(command)
        except UnreachableError as error:
            self._robot.protective_stop(str(error))
        else:
            self._resume()

    def _run_at_once(self, command: int) -> None:
        try:
            self._begin(command)
        except UnreachableError as error:
            self._robot.protective_stop(str(error))

    def _begin(self, command: int) -> Steps | None:
        """Start a command; what takes time is returned, what does not is done."""
        if not self._robot.generation.force_sensor and command in EMPTY_ON_CB3:
            return None
        handler = _COMMANDS.get(command)
        return handler(self) if handler is not None else None

    # Registers.

    def _six(self, start: int = 0) -> NDArray[np.float64]:
        values = np.array(self._robot.doubles_in[self._offset + start : self._offset + start + 6])
        if not np.isfinite(values).all():
            raise UnreachableError("program", f"registers hold {values.tolist()}, expected finite numbers")
        return values

    def _double(self, index: int) -> float:
        return self._robot.doubles_in[self._offset + index]

    def _int(self, index: int) -> int:
        return self._robot.ints_in[self._offset + index]

    def _out(self, index: int, value: int) -> None:
        self._robot.ints_out[self._offset + index] = value

    def _out_six(self, values: NDArray[np.float64]) -> None:
        self._robot.doubles_out[self._offset : self._offset + 6] = [float(value) for value in values]

    # Asynchronous operations and their status register.

    def _write_async(self, value: int) -> None:
        self._writes = (self._writes + 1) % 128
        if value == 0:
            self._operation = (self._operation + 1) % 128
        running = (min(value, 32767) + 32768) if value >= 0 else 0
        self._out(2, self._writes << 16 | self._operation << 24 | running)

    def _start_async(self, motion: Motion) -> None:
        self._robot.motion = self._watched = motion
        self._write_async(0)

    def _finish_async(self) -> None:
        self._watched = None
        self._write_async(-1)

    def _watch_async(self) -> None:
        if self._watched is not None and (self._watched.finished or self._robot.motion is not self._watched):
            self._finish_async()

    def _stop_async_move(self) -> None:
        if self._watched is not None:
            self._finish_async()

    # Motions.

    def _until_finished(self, motion: Motion) -> Steps:
        self._robot.motion = motion
        yield
        while not motion.finished and self._robot.motion is motion:
            yield

    def _move(self, path: Path) -> Steps:
        self._stop_async_move()
        if self._int(1) == 1:
            self._start_async(path)
        else:
            yield from self._until_finished(path)

    def _joint_path(self, goal_rad: NDArray[np.float64]) -> Path:
        robot = self._robot
        return joint_path(
            robot.target_rad,
            goal_rad,
            speed=self._double(6),
            acceleration=self._double(7),
            tcp_offset=robot.tcp_offset,
        )

    def _line_path(self, goal: NDArray[np.float64]) -> Path:
        robot = self._robot
        return line_path(
            robot.target_rad,
            goal,
            speed=self._double(6),
            acceleration=self._double(7),
            tcp_offset=robot.tcp_offset,
        )

    def _inverse(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        return joints_of(matrix_of(pose), self._robot.tcp_offset, self._robot.target_rad)

    def move_j(self) -> Steps:
        """1: joints."""
        yield from self._move(self._joint_path(self._six()))

    def move_j_ik(self) -> Steps:
        """2: a pose, through joint space."""
        yield from self._move(self._joint_path(self._inverse(self._six())))

    def move_l(self) -> Steps:
        """3: a pose, in a straight line."""
        yield from self._move(self._line_path(matrix_of(self._six())))

    def move_l_fk(self) -> Steps:
        """4: the pose of these joints, in a straight line."""
        yield from self._move(self._line_path(tcp_pose(self._six(), self._robot.tcp_offset)))

    def _brake(self, deceleration: float, *, joints: bool) -> Steps:
        motion = self._robot.motion
        if motion is not None:
            motion.brake(deceleration, joints=joints)
            yield
            while self._robot.motion is motion and not motion.finished:
                yield

    def _stop(self) -> Steps:
        """33 and 34, as the script has them: which of the two a synchronous stop is depends on the last other one."""
        asynchronous = self._int(1) == 1
        deceleration = self._double(0)
        self._stop_async_move()
        if asynchronous:
            self._stop_type_line = True
            if self._robot.motion is not None:
                self._robot.motion.brake(deceleration, joints=False)
                self._start_async(self._robot.motion)
        else:
            yield from self._brake(deceleration, joints=not self._stop_type_line)

    def _speed(self, *, joints: bool) -> None:
        motion = self._robot.motion
        if not isinstance(motion, Velocity):
            motion = Velocity(self._robot.target_rad, self._robot.tcp_offset, joints=joints)
            self._robot.motion = motion
        motion.aim(self._six(), self._double(6))

    def speed_j(self) -> None:
        """9."""
        self._speed(joints=True)

    def speed_l(self) -> None:
        """10: goes on until it is stopped, whatever time it was given."""
        self._speed(joints=False)

    def _servo(self, goal_rad: NDArray[np.float64]) -> None:
        if not isinstance(self._robot.motion, Servo):
            self._robot.motion = Servo(self._robot.target_rad)
        self._robot.motion.aim(goal_rad)

    def servo_j(self) -> None:
        """11."""
        self._servo(self._six())

    def servo_l(self) -> None:
        """24."""
        self._servo(self._inverse(self._six()))

    def speed_stop(self) -> Steps:
        """15 and 16."""
        yield from self._brake(self._double(0), joints=False)

    def move_until_contact(self) -> Steps:
        """51: a velocity until the force changes, then back to where it began to."""
        robot = self._robot
        motion = Velocity(robot.target_rad, robot.tcp_offset, joints=False)
        motion.aim(self._six(), self._double(12))
        robot.motion = motion
        before_n = np.array(robot.sensor.wrench[:3])
        yield
        while robot.motion is motion:
            if float(np.linalg.norm(np.array(robot.sensor.wrench[:3]) - before_n)) > CONTACT_N:
                seen_rad = robot.world.joints_rad.copy()
                yield from self._brake(BACKWARD_DECELERATION, joints=False)
                back = joint_path(robot.target_rad, seen_rad, speed=0.5, acceleration=1.0, tcp_offset=robot.tcp_offset)
                yield from self._until_finished(back)
                return
            yield

    # Settings and questions.

    def zero_force(self) -> None:
        """8."""
        self._robot.sensor.zero()

    def set_payload(self) -> None:
        """17 and 65."""
        self._robot.payload_kg = self._double(0)
        cog_m = tuple(self._double(index) for index in (1, 2, 3))
        if any(cog_m):
            self._robot.payload_cog_m = cog_m

    def set_tcp(self) -> None:
        """29."""
        self._robot.set_tcp(self._six())

    def stop_protectively(self) -> None:
        """31."""
        self._robot.protective_stop("protective_stop() was called by the program")

    def set_watchdog(self) -> None:
        """35: the program stops when the command register is written less often."""
        self._robot.feed()
        self._robot.watchdog_hz = self._double(0)

    def pose_in_limits(self) -> None:
        """36."""
        try:
            inside = self._robot.within_limits(self._inverse(self._six()))
        except UnreachableError:
            inside = False
        self._out(1, int(inside))

    def joints_in_limits(self) -> None:
        """37."""
        self._out(1, int(self._robot.within_limits(self._six())))

    def pose_trans(self) -> None:
        """39."""
        self._out_six(vector_of(matrix_of(self._six()) @ matrix_of(self._six(6))))

    def tcp_offset(self) -> None:
        """40."""
        self._out_six(vector_of(self._robot.tcp_offset))

    def forward_default(self) -> None:
        """43, and 28, the target's pose."""
        self._out_six(vector_of(tcp_pose(self._robot.target_rad, self._robot.tcp_offset)))

    def forward(self) -> None:
        """44."""
        self._out_six(vector_of(tcp_pose(self._six(), matrix_of(self._six(6)))))

    def inverse(self) -> None:
        """46."""
        self._out_six(self._inverse(self._six()))

    def inverse_near(self) -> None:
        """30."""
        self._out_six(joints_of(matrix_of(self._six()), self._robot.tcp_offset, self._six(6)))

    def has_inverse(self) -> None:
        """60 and 61."""
        try:
            self._inverse(self._six())
            self._out(1, 1)
        except UnreachableError:
            self._out(1, 0)

    def is_steady(self) -> None:
        """47."""
        self._out(1, int(self._robot.steady))

    def step_time(self) -> None:
        """26."""
        self._robot.doubles_out[self._offset] = self._robot.period_s

    def flange(self) -> None:
        """58."""
        self._out_six(vector_of(flange_pose(self._robot.world.joints_rad)))

    def joints_now(self) -> None:
        """27: the history is one entry long."""
        self._out_six(self._robot.world.joints_rad)


def _register_offset(script: str) -> int:
    """First register that the script uses: 0, or 24 of ``FLAG_UPPER_RANGE_REGISTERS``."""
    found = re.search(r"reg_offset_int\s*=[^\n0-9]*\n?\s*(\d+)", script)
    return int(found[1]) if found else 0


_COMMANDS: dict[int, Callable[[Program], Steps | None]] = {
    1: Program.move_j,
    2: Program.move_j_ik,
    3: Program.move_l,
    4: Program.move_l_fk,
    8: Program.zero_force,
    9: Program.speed_j,
    10: Program.speed_l,
    11: Program.servo_j,
    15: Program.speed_stop,
    16: Program.speed_stop,
    17: Program.set_payload,
    24: Program.servo_l,
    26: Program.step_time,
    27: Program.joints_now,
    28: Program.forward_default,
    29: Program.set_tcp,
    30: Program.inverse_near,
    31: Program.stop_protectively,
    33: Program._stop,
    34: Program._stop,
    35: Program.set_watchdog,
    36: Program.pose_in_limits,
    37: Program.joints_in_limits,
    39: Program.pose_trans,
    40: Program.tcp_offset,
    43: Program.forward_default,
    44: Program.forward,
    46: Program.inverse,
    47: Program.is_steady,
    51: Program.move_until_contact,
    58: Program.flange,
    60: Program.has_inverse,
    61: Program.has_inverse,
    65: Program.set_payload,
}
