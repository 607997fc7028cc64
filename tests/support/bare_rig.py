"""An emulated rig whose time a test lets pass: no objects, nothing listens, commands by register."""

from __future__ import annotations

from handsight.collection.ur10.emulator.generation import Generation
from handsight.collection.ur10.emulator.gripper import Gripper
from handsight.collection.ur10.emulator.rig import EmulatedRig, RigSettings
from handsight.collection.ur10.emulator.world import BareWorld

SCRIPT = "def rtde_control():\n  global reg_offset_int = # int register offset\n0\nend\n"
TCP = (0.0, 0.0, 0.16, 0.0, 0.0, 0.0)
READY, DONE = 1, 2


def bare_rig(generation: Generation) -> EmulatedRig:
    """No objects, nothing listens."""
    return EmulatedRig(RigSettings(robot="127.0.0.2", generation=generation), BareWorld())


def let_pass(rig: EmulatedRig, seconds: float) -> None:
    """Let robot time pass."""
    for _ in range(round(seconds / rig.robot.period_s)):
        rig.tick(0.0)


def start(rig: EmulatedRig) -> None:
    rig.robot.upload(SCRIPT)
    rig.tick(0.0)
    call(rig, 29, TCP)


def call(rig: EmulatedRig, command: int, doubles: tuple[float, ...] = (), ints: tuple[int, ...] = ()) -> None:
    """Send a command, wait until it is done, and clear it; as the client does."""
    send(rig, command, doubles, ints)
    for _ in range(round(30 / rig.robot.period_s)):
        if rig.robot.ints_out[0] == DONE or rig.robot.program is None:
            break
        rig.tick(0.0)
    clear(rig)


def send(rig: EmulatedRig, command: int, doubles: tuple[float, ...] = (), ints: tuple[int, ...] = ()) -> None:
    rig.robot.doubles_in[: len(doubles)] = list(doubles)
    rig.robot.ints_in[1 : 1 + len(ints)] = list(ints)
    rig.robot.ints_in[0] = command
    rig.tick(0.0)


def clear(rig: EmulatedRig) -> None:
    rig.robot.ints_in[0] = 0
    rig.tick(0.0)


def lowered(rig: EmulatedRig, by_m: float) -> tuple[float, ...]:
    pose = rig.robot.pose
    pose[2] -= by_m
    return tuple(float(value) for value in pose)


def robotiq(rig: EmulatedRig) -> Gripper:
    """The rig's gripper, which is one behind the URCap."""
    assert isinstance(rig.gripper, Gripper)
    return rig.gripper
