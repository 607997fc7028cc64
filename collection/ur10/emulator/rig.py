"""One emulated rig: its devices, what they act on, and the loop that moves time on."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass

import numpy as np

from handsight.collection.ur10.emulator.clock import TOUCHING_N, Clock
from handsight.collection.ur10.emulator.controller import Controller
from handsight.collection.ur10.emulator.dashboard import Dashboard
from handsight.collection.ur10.emulator.generation import Generation
from handsight.collection.ur10.emulator.gripper import Gripper
from handsight.collection.ur10.emulator.network import Network
from handsight.collection.ur10.emulator.rtde import RtdeServer
from handsight.collection.ur10.emulator.script_port import ScriptPort
from handsight.collection.ur10.emulator.world import World


@dataclass(frozen=True, slots=True, kw_only=True)
class RigSettings:
    """What a rig is made of."""

    robot: str
    """Loopback address of the controller, 127.0.0.N."""
    generation: Generation
    speed: float = 1.0
    """How many times faster than the wall's the robot's clock may run."""
    seed: int = 0
    true_payload_kg: float = 1.3


class EmulatedRig:
    """Controller and gripper on one address."""

    def __init__(self, settings: RigSettings, world: World) -> None:
        """Everything is at rest and nothing listens yet."""
        self.settings = settings
        self.world = world
        self.network = Network(settings.robot)
        self.robot = Controller(
            settings.generation, world, seed=settings.seed, true_payload_kg=settings.true_payload_kg
        )
        self.dashboard = Dashboard(self.robot, self.network)
        self.rtde = RtdeServer(self.robot, self.network)
        self.scripts = ScriptPort(self.robot, self.network)
        self.gripper = Gripper(self.robot, world, self.network)
        self.clock = Clock(settings.speed)

    async def open(self) -> None:
        """Listen.

        Raises:
            OSError: An address or port cannot be had.
        """
        await self.network.open()

    async def run(self) -> None:
        """Let time pass, for ever."""
        await self.clock.run(self._tick, self.robot.period_s, self._attentive, self._take_factor)

    def _tick(self, now_s: float) -> None:
        self.robot.tick()
        self.gripper.tick(self.robot.period_s)
        self.rtde.stream(now_s)

    def _attentive(self) -> bool:
        if not self.robot.interruptible:
            return False
        return float(np.abs(self.world.contact_n).max()) > TOUCHING_N

    def _take_factor(self, factor: float) -> None:
        self.robot.clock_factor = max(factor, 1.0)

    def close(self) -> None:
        """Stop listening."""
        self.network.close()


async def serve_until(rig: EmulatedRig, stopped: asyncio.Event) -> None:
    """Run a rig that listens until it is told to stop."""
    running = asyncio.create_task(rig.run())
    stopping = asyncio.create_task(stopped.wait())
    done, _ = await asyncio.wait((running, stopping), return_when=asyncio.FIRST_COMPLETED)
    stopping.cancel()
    running.cancel()
    rig.close()
    if running in done:
        running.result()  # Raises what ended it.
