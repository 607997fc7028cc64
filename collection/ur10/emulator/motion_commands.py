"""Commands of the control script that move the arm, by their numbers.

Stopping synchronously is ``stopj`` until an asynchronous stop was asked for once, as in the script.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from handsight.collection.ur10.emulator.motion import Motion, Path, Servo, Velocity, joint_path, line_path
from handsight.collection.ur10.emulator.poses import matrix_of, tcp_pose

if TYPE_CHECKING:
    from handsight.collection.ur10.emulator.program import Program, Steps

CONTACT_N = 15.0
"""Change of force that ``tool_contact`` takes for a contact."""
BACKWARD_DECELERATION = 3.0


def _until_finished(program: Program, motion: Motion) -> Steps:
    program.robot.motion = motion
    yield
    while not motion.finished and program.robot.motion is motion:
        yield


def _move(program: Program, path: Path) -> Steps:
    program.stop_async_move()
    if program.int_(1) == 1:
        program.start_async(path)
    else:
        yield from _until_finished(program, path)


def _joint_path(program: Program, goal_rad: NDArray[np.float64]) -> Path:
    return joint_path(program.robot.target_rad, goal_rad, **_pace(program))


def _line_path(program: Program, goal: NDArray[np.float64]) -> Path:
    return line_path(program.robot.target_rad, goal, **_pace(program))


def _pace(program: Program) -> dict[str, Any]:
    """How fast a path is gone, and by which point of the tool."""
    return {"speed": program.double(6), "acceleration": program.double(7), "tcp_offset": program.robot.tcp_offset}


def move_j(program: Program) -> Steps:
    """1: joints."""
    yield from _move(program, _joint_path(program, program.six()))


def move_j_ik(program: Program) -> Steps:
    """2: a pose, through joint space."""
    yield from _move(program, _joint_path(program, program.inverse_of(program.six())))


def move_l(program: Program) -> Steps:
    """3: a pose, in a straight line."""
    yield from _move(program, _line_path(program, matrix_of(program.six())))


def move_l_fk(program: Program) -> Steps:
    """4: the pose of these joints, in a straight line."""
    yield from _move(program, _line_path(program, tcp_pose(program.six(), program.robot.tcp_offset)))


def _brake(program: Program, deceleration: float, *, joints: bool) -> Steps:
    motion = program.robot.motion
    if motion is not None:
        motion.brake(deceleration, joints=joints)
        yield
        while program.robot.motion is motion and not motion.finished:
            yield


def stop(program: Program) -> Steps:
    """33 and 34, as the script has them: which of the two a synchronous stop is depends on the last other one."""
    asynchronous = program.int_(1) == 1
    deceleration = program.double(0)
    program.stop_async_move()
    if asynchronous:
        program.stop_type_line = True
        if program.robot.motion is not None:
            program.robot.motion.brake(deceleration, joints=False)
            program.start_async(program.robot.motion)
    else:
        yield from _brake(program, deceleration, joints=not program.stop_type_line)


def _speed(program: Program, *, joints: bool) -> None:
    motion = program.robot.motion
    if not isinstance(motion, Velocity):
        motion = Velocity(program.robot.target_rad, program.robot.tcp_offset, joints=joints)
        program.robot.motion = motion
    motion.aim(program.six(), program.double(6))


def speed_j(program: Program) -> None:
    """9."""
    _speed(program, joints=True)


def speed_l(program: Program) -> None:
    """10: goes on until it is stopped, whatever time it was given."""
    _speed(program, joints=False)


def _servo(program: Program, goal_rad: NDArray[np.float64]) -> None:
    if not isinstance(program.robot.motion, Servo):
        program.robot.motion = Servo(program.robot.target_rad)
    program.robot.motion.aim(goal_rad)


def servo_j(program: Program) -> None:
    """11."""
    _servo(program, program.six())


def servo_l(program: Program) -> None:
    """24."""
    _servo(program, program.inverse_of(program.six()))


def speed_stop(program: Program) -> Steps:
    """15 and 16."""
    yield from _brake(program, program.double(0), joints=False)


def move_until_contact(program: Program) -> Steps:
    """51: a velocity until the force changes, then back to where it began to."""
    robot = program.robot
    motion = Velocity(robot.target_rad, robot.tcp_offset, joints=False)
    motion.aim(program.six(), program.double(12))
    robot.motion = motion
    before_n = np.array(robot.sensor.wrench[:3])
    yield
    while robot.motion is motion:
        if float(np.linalg.norm(np.array(robot.sensor.wrench[:3]) - before_n)) > CONTACT_N:
            seen_rad = robot.world.joints_rad.copy()
            yield from _brake(program, BACKWARD_DECELERATION, joints=False)
            back = joint_path(robot.target_rad, seen_rad, speed=0.5, acceleration=1.0, tcp_offset=robot.tcp_offset)
            yield from _until_finished(program, back)
            return
        yield


MOTION_COMMANDS: dict[int, Callable[[Program], Steps | None]] = {
    1: move_j,
    2: move_j_ik,
    3: move_l,
    4: move_l_fk,
    9: speed_j,
    10: speed_l,
    11: servo_j,
    15: speed_stop,
    16: speed_stop,
    24: servo_l,
    33: stop,
    34: stop,
    51: move_until_contact,
}
