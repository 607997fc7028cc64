"""Commands of the control script that set or ask for something, by their numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from handsight.collection.errors import UnreachableError
from handsight.collection.sim.kinematics import flange_pose
from handsight.collection.ur10.emulator.poses import joints_of, matrix_of, tcp_pose, vector_of

if TYPE_CHECKING:
    from handsight.collection.ur10.emulator.program import Program


def zero_force(program: Program) -> None:
    """8."""
    program.robot.sensor.zero()


def set_payload(program: Program) -> None:
    """17 and 65."""
    program.robot.payload_kg = program.double(0)
    cog_m = tuple(program.double(index) for index in (1, 2, 3))
    if any(cog_m):
        program.robot.payload_cog_m = cog_m


def set_tcp(program: Program) -> None:
    """29."""
    program.robot.set_tcp(program.six())


def stop_protectively(program: Program) -> None:
    """31."""
    program.robot.protective_stop("protective_stop() was called by the program")


def set_watchdog(program: Program) -> None:
    """35: the program stops when the command register is written less often."""
    program.robot.feed()
    program.robot.watchdog_hz = program.double(0)


def pose_in_limits(program: Program) -> None:
    """36."""
    try:
        inside = program.robot.within_limits(program.inverse_of(program.six()))
    except UnreachableError:
        inside = False
    program.out(1, int(inside))


def joints_in_limits(program: Program) -> None:
    """37."""
    program.out(1, int(program.robot.within_limits(program.six())))


def pose_trans(program: Program) -> None:
    """39."""
    program.out_six(vector_of(matrix_of(program.six()) @ matrix_of(program.six(6))))


def tcp_offset(program: Program) -> None:
    """40."""
    program.out_six(vector_of(program.robot.tcp_offset))


def forward_default(program: Program) -> None:
    """43, and 28, the target's pose."""
    program.out_six(vector_of(tcp_pose(program.robot.target_rad, program.robot.tcp_offset)))


def forward(program: Program) -> None:
    """44."""
    program.out_six(vector_of(tcp_pose(program.six(), matrix_of(program.six(6)))))


def inverse(program: Program) -> None:
    """46."""
    program.out_six(program.inverse_of(program.six()))


def inverse_near(program: Program) -> None:
    """30."""
    program.out_six(joints_of(matrix_of(program.six()), program.robot.tcp_offset, program.six(6)))


def has_inverse(program: Program) -> None:
    """60 and 61."""
    try:
        program.inverse_of(program.six())
        program.out(1, 1)
    except UnreachableError:
        program.out(1, 0)


def is_steady(program: Program) -> None:
    """47."""
    program.out(1, int(program.robot.steady))


def step_time(program: Program) -> None:
    """26."""
    program.robot.doubles_out[program.offset] = program.robot.period_s


def flange(program: Program) -> None:
    """58."""
    program.out_six(vector_of(flange_pose(program.robot.world.joints_rad)))


def joints_now(program: Program) -> None:
    """27: the history is one entry long."""
    program.out_six(program.robot.world.joints_rad)


QUERY_COMMANDS: dict[int, Callable[[Program], None]] = {
    8: zero_force,
    17: set_payload,
    26: step_time,
    27: joints_now,
    28: forward_default,
    29: set_tcp,
    30: inverse_near,
    31: stop_protectively,
    35: set_watchdog,
    36: pose_in_limits,
    37: joints_in_limits,
    39: pose_trans,
    40: tcp_offset,
    43: forward_default,
    44: forward,
    46: inverse,
    47: is_steady,
    58: flange,
    60: has_inverse,
    61: has_inverse,
    65: set_payload,
}
