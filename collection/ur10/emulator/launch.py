"""Starting an emulated rig in this process, and ending it."""

from __future__ import annotations

import asyncio
import ctypes
import os
import signal
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from handsight.collection.sim.config import SimConfig
from handsight.collection.ur10.emulator.board import Board
from handsight.collection.ur10.emulator.control import Control
from handsight.collection.ur10.emulator.errors import EmulatorError
from handsight.collection.ur10.emulator.faults import Fault
from handsight.collection.ur10.emulator.physics import PhysicalWorld
from handsight.collection.ur10.emulator.rig import EmulatedRig, RigSettings, serve_until
from handsight.collection.ur10.emulator.world import BareWorld, World

_PR_SET_PDEATHSIG = 1
SLOWEST, FASTEST = 0.01, 1000.0
"""Factors of the clock."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Launch:
    """Everything that a rig is started with."""

    rig: RigSettings
    world: SimConfig | None = None
    """Objects and their physics; None for bare protocols."""
    empty: bool = False
    """Nothing lies on the table; the objects of the world come by ``{"do": "refill", "exchange": true}``."""
    board: Board | None = None
    """A calibration target on the table."""
    control_port: int | None = None
    faults: tuple[Fault, ...] = ()


def run(launch: Launch, announce: Callable[[Mapping[str, object]], None]) -> None:
    """Serve a rig until this process is told to end, by SIGTERM or SIGINT, or by the control port.

    Args:
        launch: What is started.
        announce: Told once everything listens.

    Raises:
        EmulatorError: An address or a port cannot be had, or a board is laid where no camera sees it.
        CollectionError: The world cannot be made.
    """
    world: World = (
        BareWorld(0.085 if launch.rig.rg2 is None else 0.14)
        if launch.world is None
        else PhysicalWorld(launch.world, launch.rig.seed)
    )
    if launch.empty and isinstance(world, PhysicalWorld):
        world.clear()
    asyncio.run(_serve(launch, world, announce))


async def _serve(launch: Launch, world: World, announce: Callable[[Mapping[str, object]], None]) -> None:
    stopped = asyncio.Event()
    rig = EmulatedRig(launch.rig, world)
    if launch.board is not None:
        if rig.camera is None:
            raise EmulatorError("a board is laid and there is no camera, expected one that sees it")
        rig.camera.board = launch.board
    control = None
    if launch.control_port is not None:
        control = Control(rig, launch.rig.robot, launch.control_port, stopped.set)
    try:
        await rig.open()
        if control is not None:
            await control.network.open()
    except OSError as error:
        rig.close()
        raise EmulatorError(
            f"the emulated rig cannot listen on {launch.rig.robot}: {error}; is another one running there?"
        ) from error
    for fault in launch.faults:
        rig.faults.arm(fault)
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stopped.set)
    announce(_ready(launch))
    try:
        await serve_until(rig, stopped)
    finally:
        if control is not None:
            control.network.close()


def _ready(launch: Launch) -> dict[str, object]:
    camera = launch.rig.camera
    return {
        "ready": True,
        "pid": os.getpid(),
        "robot": launch.rig.robot,
        "generation": launch.rig.generation.name,
        "camera": None if camera is None else f"{camera.address}:{camera.port}",
        "control": launch.control_port,
        "objects": None if launch.world is None else launch.world.objects,
    }


def end_with_parent() -> None:
    """Have the kernel end this process when the one that started it is gone, even killed."""
    parent = os.getppid()
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != parent:
            raise SystemExit(0)
