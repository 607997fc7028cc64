"""The emulated controller: one control period after the other, from registers to joints and back to readings.

Time. ``clock_s`` is the robot's own time and advances by one period with every :meth:`Controller.tick`; who calls how
often decides how fast it runs (``clock.py``). Everything here is in robot time.
"""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import UnreachableError
from handsight.collection.sim.kinematics import JOINT_LIMITS_RAD, flange_pose
from handsight.collection.ur10.emulator.forces import ForceSensor, Payload
from handsight.collection.ur10.emulator.generation import Generation
from handsight.collection.ur10.emulator.machine import Machine, RobotMode, Runtime
from handsight.collection.ur10.emulator.motion import Motion
from handsight.collection.ur10.emulator.poses import FLANGE_TO_TIP, matrix_of, tcp_pose, vector_of
from handsight.collection.ur10.emulator.program import Program
from handsight.collection.ur10.emulator.readings import reading
from handsight.collection.ur10.emulator.travel import Travel
from handsight.collection.ur10.emulator.variables import REGISTERS
from handsight.collection.ur10.emulator.world import World

COLLISION_N = 150.0
"""Force at the tool at which the safety system stops the arm; the default limit of a UR10."""
TRACKING_LIMIT_RAD = 0.12
"""A joint this far from where it is sent: something holds the arm."""
STOP_DECELERATION_RAD_S2 = 12.0
SERIAL = "2016350000"


class Controller:
    """State of the robot, and what a period does to it."""

    def __init__(
        self, generation: Generation, world: World, *, seed: int = 0, true_payload: Payload | None = None
    ) -> None:
        """A robot that is running, standing where ``world`` has it.

        ``clock_s`` counts on when the controller starts anew; the ``timestamp`` that clients read begins at zero.

        Args:
            generation: Which controller.
            world: What the arm acts on.
            seed: Of the noise.
            true_payload: What really hangs on the flange; the controller is told by ``setPayload``.
        """
        self.generation = generation
        self.world = world
        self.machine = Machine()
        self.period_s = 1.0 / generation.control_hz
        self.clock_s = 0.0
        self.tcp_offset = np.eye(4)
        self.payload_kg = 0.0
        self.payload_cog_m: tuple[float, ...] = (0.0, 0.0, 0.0)
        rng = np.random.default_rng([seed, 30004])
        self.sensor = ForceSensor(generation, rng, true_payload=true_payload or Payload())
        self.inputs: dict[str, Any] = {}
        self.ints_in = [0] * REGISTERS
        self.doubles_in = [0.0] * REGISTERS
        self.ints_out = [0] * REGISTERS
        self.doubles_out = [0.0] * REGISTERS
        self.events: list[tuple[float, str]] = []
        """Protective stops so far: when by the robot's clock, and why."""
        self.program: Program | None = None
        self.motion: Motion | None = None
        self.target_rad: NDArray[np.float64] = world.joints_rad.copy()
        self.travel = Travel(self.target_rad)
        """Where the fingertips have ever been."""
        self.overheated_joint: int | None = None
        self.watchdog_hz = 0.0
        self.clock_factor = 1.0
        self._booted_s = 0.0
        self._fed_s = 0.0
        self._collision_seen = False
        self.speed_rad_s = np.zeros(6)
        self._observed_s = 0.0
        self.tool_speed = np.zeros(6)
        self._pose = tcp_pose(self.target_rad, self.tcp_offset)
        self._pose_vector = vector_of(self._pose)
        self.heat_c = np.zeros(6)
        self._last_rad = self.target_rad

    # What clients do.

    def upload(self, script: str) -> None:
        """A script arrives on port 30003; it replaces the program that runs. Refused where nothing may run."""
        locked = self.generation.remote_control and not self.machine.remote
        if locked or not self.machine.may_move:
            return
        self.stop_program()
        self.ints_out[:] = [0] * REGISTERS
        self.program = Program(self, script)
        self.machine.runtime = Runtime.PLAYING

    def stop_program(self) -> None:
        """End the program; the arm brakes."""
        self.program = None
        self.watchdog_hz = 0.0
        if self.machine.runtime is not Runtime.STOPPED:
            self.machine.runtime = Runtime.STOPPED
        if self.motion is not None:
            self.motion.brake(STOP_DECELERATION_RAD_S2, joints=True)

    def reboot(self) -> None:
        """Start anew: without power or program, with the installation's TCP and payload, and a clock at zero."""
        self.stop_program()
        self.motion = None
        self.target_rad = self.world.joints_rad.copy()
        self.machine.power_off()
        self.set_tcp(np.zeros(6))
        self.payload_kg, self.payload_cog_m = 0.0, (0.0, 0.0, 0.0)
        self._booted_s = self.clock_s

    def feed(self) -> None:
        """The watched register was written."""
        self._fed_s = self.clock_s

    def protective_stop(self, cause: str) -> None:
        """Stop, for a reason that the popup tells."""
        self.events.append((self.clock_s, cause))
        self.machine.protective_stop(self.clock_s, cause)
        self.stop_program()

    # One control period.

    def tick(self) -> None:
        """One period."""
        self.clock_s += self.period_s
        self.machine.advance(self.clock_s)
        self._check_watchdog()
        if self.machine.may_move and self.program is not None and self.machine.runtime is Runtime.PLAYING:
            self.program.tick()
        self._move()
        self.sensor.feel(self.period_s, self.world.contact_n)
        self._guard()

    def _check_watchdog(self) -> None:
        # Clients write in their own time, which a fast clock of the robot must not count against them.
        if self.watchdog_hz > 0 and self.clock_s - self._fed_s > self.clock_factor / self.watchdog_hz:
            self.stop_program()

    def _move(self) -> None:
        if self._held:
            self.motion = None if self.machine.mode is not RobotMode.RUNNING else self.motion
        elif self.motion is not None:
            try:
                self.target_rad = self.motion.advance(self.period_s)
            except UnreachableError as error:
                self.motion = None
                self.protective_stop(str(error))
            else:
                if self.motion.finished:
                    self.motion = None
        if (np.abs(self.target_rad) > JOINT_LIMITS_RAD).any():
            self.motion = None
            self.target_rad = np.clip(self.target_rad, -JOINT_LIMITS_RAD, JOINT_LIMITS_RAD)
            self.protective_stop("C158: a joint is at its limit")
        self.world.advance(self.period_s, self.target_rad)
        if self.motion is not None:
            self.travel.see(self.period_s, self.world.joints_rad)

    def observe(self) -> None:
        """Take the readings that clients are sent; once for several periods where time runs fast."""
        seconds = self.clock_s - self._observed_s
        if seconds <= 0:
            return
        self._observed_s = self.clock_s
        joints_rad = self.world.joints_rad
        before_rad_s = self.speed_rad_s
        self.speed_rad_s = (joints_rad - self._last_rad) / seconds
        self._last_rad = joints_rad
        acceleration_rad_s2 = float(np.abs(self.speed_rad_s - before_rad_s).max()) / seconds
        self.heat_c += seconds * (0.02 * np.abs(self.speed_rad_s) - 0.001 * self.heat_c)
        self.tool_speed = np.zeros(6)
        if self.speed_rad_s.any():
            before_m = self._pose[:3, 3]
            self._pose = tcp_pose(joints_rad, self.tcp_offset)
            self._pose_vector = vector_of(self._pose)
            self.tool_speed[:3] = (self._pose[:3, 3] - before_m) / seconds
        self.sensor.read(
            seconds,
            joints_rad=joints_rad,
            acceleration_rad_s2=acceleration_rad_s2,
            pose_base_tool=self._pose,
            tool_m=self.tcp_offset[:3, 3],
            told=Payload(self.payload_kg, self.payload_cog_m),
        )

    def _guard(self) -> None:
        if not self.machine.may_move:
            return
        pressing_n = self.sensor.pressing_n
        # After a stop the arm may leave what it ran into, however hard it still presses on it.
        self._collision_seen = self._collision_seen and pressing_n > 0.8 * COLLISION_N
        if pressing_n > COLLISION_N and not self._collision_seen:
            self._collision_seen = True
            self.protective_stop("C153: a collision was detected at the tool")
        elif float(np.abs(self.world.joints_rad - self.target_rad).max()) > TRACKING_LIMIT_RAD:
            self.protective_stop("C157: the position deviates from the path")
            self.motion, self.target_rad = None, self.world.joints_rad.copy()

    @property
    def _held(self) -> bool:
        """Whether the arm stands, whatever motion is under way."""
        return self.machine.runtime is Runtime.PAUSED or self.machine.mode is not RobotMode.RUNNING

    # What can be read.

    @property
    def moving(self) -> bool:
        """Whether the arm is sent somewhere."""
        return self.motion is not None and not self._held

    @property
    def pose(self) -> NDArray[np.float64]:
        """Measured pose of the TCP, x y z rx ry rz. Shape (6,)."""
        return self._pose_vector

    @property
    def tip_z_m(self) -> float:
        """Height of the fingertips above the table, whatever TCP is set [m]."""
        return float(tcp_pose(self.world.joints_rad, FLANGE_TO_TIP)[2, 3])

    @property
    def tool_speed_m_s(self) -> tuple[float, float, float]:
        """Measured speed of the TCP along the base's axes [m/s]."""
        x, y, z = (float(value) for value in self.tool_speed[:3])
        return x, y, z

    @property
    def steady(self) -> bool:
        """Whether the arm stands."""
        return self.motion is None and float(np.abs(self.speed_rad_s).max()) < 1e-3

    @property
    def interruptible(self) -> bool:
        """Whether a motion runs that its client watches and stops: all but those whose end it waits for."""
        return self.motion is not None and self.program is not None and not self.program.blocked

    def within_limits(self, joints_rad: NDArray[np.float64]) -> bool:
        """What the safety configuration allows: joint limits, and nothing below the table's plane."""
        above = float((flange_pose(joints_rad) @ FLANGE_TO_TIP)[2, 3]) > -0.005
        return bool((np.abs(joints_rad) <= JOINT_LIMITS_RAD).all()) and above

    def set_tcp(self, pose: NDArray[np.float64]) -> None:
        """Where the TCP is in the flange's frame, x y z rx ry rz."""
        self.tcp_offset = matrix_of(pose)
        self._pose = tcp_pose(self.world.joints_rad, self.tcp_offset)
        self._pose_vector = vector_of(self._pose)

    def read(self, name: str) -> Any:
        """The value of an output variable."""
        return reading(self, name)

    @property
    def uptime_s(self) -> float:
        """Since it started anew [s]."""
        return self.clock_s - self._booted_s

    @property
    def kinematics_checksum(self) -> int:
        """Of the calibration that this arm left the factory with."""
        return zlib.crc32(SERIAL.encode())
