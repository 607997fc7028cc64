"""One emulated rig: its devices, what they act on, and the loop that moves time on."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field

import numpy as np

from handsight.collection.ur10.emulator.camera import Camera, CameraSettings
from handsight.collection.ur10.emulator.chaos import Chaos
from handsight.collection.ur10.emulator.clock import CARRIED_N, TOUCHING_N, Clock
from handsight.collection.ur10.emulator.controller import Controller
from handsight.collection.ur10.emulator.dashboard import Dashboard
from handsight.collection.ur10.emulator.faults import Faults
from handsight.collection.ur10.emulator.forces import Payload
from handsight.collection.ur10.emulator.generation import Generation
from handsight.collection.ur10.emulator.gripper import Gripper
from handsight.collection.ur10.emulator.network import Network
from handsight.collection.ur10.emulator.physics import PhysicalWorld
from handsight.collection.ur10.emulator.rg2 import Rg2
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
    true_payload: Payload = field(default_factory=Payload)
    rg2: tuple[str, int] | None = None
    """Address and port of an OnRobot RG2, which then takes the place of the Robotiq."""
    faults_per_hour: float = 0.0
    """Faults at random, in an hour of robot time."""
    camera: CameraSettings | None = None
    """The camera, where there is one; it needs a world with objects."""


class EmulatedRig:
    """Controller and gripper on one address, the camera on another."""

    def __init__(self, settings: RigSettings, world: World) -> None:
        """Everything is at rest and nothing listens yet."""
        self.settings = settings
        self.world = world
        self.network = Network(settings.robot)
        self.robot: Controller = Controller(
            settings.generation, world, seed=settings.seed, true_payload=settings.true_payload
        )
        self.dashboard = Dashboard(self.robot, self.network)
        self.rtde = RtdeServer(self.robot, self.network)
        self.scripts = ScriptPort(self.robot, self.network)
        # The Compute Box has an address of its own; what cuts off the robot leaves it alone.
        self._box = Network(settings.rg2[0]) if settings.rg2 is not None else None
        self.gripper: Gripper | Rg2
        if self._box is not None and settings.rg2 is not None:
            self.gripper = Rg2(world, self._box, settings.rg2[1])
        else:
            self.gripper = Gripper(self.robot, world, self.network)
        self.clock = Clock(settings.speed)
        self.camera: Camera | None = None
        if settings.camera is not None and isinstance(world, PhysicalWorld):
            self.camera = Camera(settings.camera, world, self.robot, seed=settings.seed)
        self.faults = Faults(self)
        self._chaos: Chaos | None = None
        if settings.faults_per_hour > 0:
            self._chaos = Chaos(settings.faults_per_hour, settings.seed, self.faults.arm)

    async def open(self) -> None:
        """Listen.

        Raises:
            OSError: An address or port cannot be had.
        """
        await self.network.open()
        if self._box is not None:
            await self._box.open()
        if self.camera is not None:
            await self.camera.network.open()

    async def run(self) -> None:
        """Let time pass, for ever."""
        await self.clock.run(self.step, self.show, self.robot.period_s, self.attentive, self._take_factor)

    def step(self) -> None:
        """One control period of everything."""
        self.robot.tick()
        self.gripper.tick(self.robot.period_s)

    def show(self, now_s: float) -> None:
        """Take readings, let faults happen and tell clients, at this time of the wall's clock."""
        self.robot.observe()
        if self._chaos is not None:
            self._chaos.tick(self.robot.clock_s)
        self.faults.tick()
        self.rtde.stream(now_s)

    def tick(self, now_s: float) -> None:
        """One control period, and the readings of it."""
        self.step()
        self.show(now_s)

    def attentive(self) -> bool:
        """Whether something happens that a client must see in real time."""
        if not self.robot.interruptible:
            return False
        # What closed jaws carry weighs on the arm all the time.
        limit_n = CARRIED_N if self.gripper.closed else TOUCHING_N
        return float(np.abs(self.world.contact_n).max()) > limit_n

    def _take_factor(self, factor: float) -> None:
        self.robot.clock_factor = max(factor, 1.0)

    def close(self) -> None:
        """Stop listening."""
        self.network.close()
        if self._box is not None:
            self._box.close()
        if self.camera is not None:
            self.camera.network.close()


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
