"""The emulated D435: frames over TCP, asked for one by one.

A RealSense cannot be emulated on the bus. What stands for the cable is this protocol; the driver's child feeds what it
gets into a ``software_device``, so that everything behind the device, syncer, alignment and filters, is the real one.
``collection/ur10/emulated_device.py`` is the plain client.

The protocol. The server listens on the camera's own loopback address, port 8435. Every message to the client is a
header, a 4-byte big-endian length and so many bytes of UTF-8 JSON, followed by the raw bytes that the header announces.
Every message to the server is one line of JSON.

1. On connection the server sends ``{"kind": "device", "name", "serial", "firmware", "usb", "width", "height", "fps",
   "depth_scale_m", "fx", "fy", "cx", "cy"}``: colour and depth share these intrinsics, without distortion, and one
   origin (the extrinsics are the identity). Pixel (0, 0) has its centre at (0, 0), as librealsense has it.
2. ``{"do": "frame"}`` is answered with the next picture not sent on this connection yet, at most ``fps`` of them per
   second of the robot's clock: ``{"kind": "frame", "number", "timestamp_ms", "color_bytes", "depth_bytes"}``, then
   colour (height x width x 3, u8, RGB), then depth (height x width, u16, little-endian, units of ``depth_scale_m``,
   0 without an answer). Nothing comes while the camera drops out: give up by a time of your own, and connect anew.
   ``timestamp_ms`` counts from the epoch at which the emulator started, by the robot's clock.
3. ``{"do": "hardware_reset"}`` is answered with ``{"kind": "ok"}``; then the camera is gone for two seconds.

Faults. Each is cured by one step of a recovery ladder and what is above it: ``restart`` (a new connection), ``reset``
(a hardware reset) or ``power-cycle`` (the control port's ``camera-power-cycle``, as the operator's command would do).
``dropout`` sends nothing, ``frozen`` the same pixels with new numbers, ``stale`` the same number and time as well,
``black`` zeros, ``no-depth`` zeros for depth, ``unplugged`` refuses connections.
"""

from __future__ import annotations

import asyncio
import json
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.collection.depth_noise import DepthNoise
from handsight.collection.sim.camera import render
from handsight.collection.ur10.emulator.board import Board
from handsight.collection.ur10.emulator.controller import Controller
from handsight.collection.ur10.emulator.network import Network
from handsight.collection.ur10.emulator.physics import PhysicalWorld
from handsight.collection.ur10.emulator.poses import FLANGE_TO_TIP, tcp_pose
from handsight.servoing.camera import HandCamera

PORT = 8435
RESET_S = 2.0
NOISE_LEVELS = 1.2
"""Standard deviation of the colour noise: no two pictures of a camera are equal."""
CURES = ("restart", "reset", "power-cycle")
KINDS = ("dropout", "frozen", "stale", "black", "no-depth", "unplugged")


@dataclass(frozen=True, slots=True, kw_only=True)
class MountedCamera(HandCamera):
    """A camera that is not quite parallel to the tool, as clamps have it."""

    turn_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Rotation vector of the camera in the tool frame."""

    def pose_base_camera(self, pose_base_tool: NDArray[np.float64]) -> NDArray[np.float64]:
        """Camera frame in the base frame. Both shapes (4, 4)."""
        pose_tool_camera = np.eye(4)
        pose_tool_camera[:3, :3] = cv2.Rodrigues(np.asarray(self.turn_rad, dtype=np.float64))[0]
        pose_tool_camera[:3, 3] = self.x_tool_camera_m, self.y_tool_camera_m, self.z_tool_camera_m
        pose: NDArray[np.float64] = pose_base_tool @ pose_tool_camera
        return pose


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSettings:
    """What the emulated camera is."""

    address: str
    port: int = PORT
    mount: HandCamera
    depth_scale_m: float = 0.001
    fps: float = 30.0
    serial: str = "934222071234"
    firmware: str = "5.16.0.1"
    depth_noise: DepthNoise | None = None
    """How wrong the depth is; None for a perfect sensor."""


class Camera:
    """The camera of one rig."""

    def __init__(self, settings: CameraSettings, world: PhysicalWorld, robot: Controller, *, seed: int = 0) -> None:
        """Serve once its network opens."""
        self.settings = settings
        self.network = Network(settings.address)
        self.board: Board | None = None
        """A calibration target on the table."""
        self._world = world
        self._robot = robot
        self._started_ms = 1e3 * time.time()
        self._rng = np.random.default_rng([seed, PORT])
        k = settings.mount.intrinsics
        # Rolled by a chance offset, one picture of noise gives as many as are needed.
        self._noise = np.rint(NOISE_LEVELS * self._rng.standard_normal((k.height, k.width, 3))).astype(np.int16)
        self._drawn: tuple[int, bool, NDArray[np.uint8], NDArray[np.uint16]] | None = None
        self._looks = 0
        self._fault: tuple[str, str] | None = None
        self._kept: tuple[dict[str, Any], bytes, bytes] | None = None
        self.asked = 0
        """Frames that were asked for."""
        self.network.serve(settings.port, self._connected)

    # Faults.

    def break_down(self, kind: str, cure: str = "restart") -> None:
        """Fail in some way, until the cure.

        Raises:
            ValueError: There is no such fault or cure.
        """
        if kind not in KINDS or cure not in CURES:
            raise ValueError(
                f"camera fault {kind!r} with cure {cure!r}, expected one of {', '.join(KINDS)} and one of "
                f"{', '.join(CURES)}"
            )
        self._fault = (kind, cure)
        if kind == "unplugged":
            self._fault = (kind, "power-cycle")
            self.network.close()

    async def repair(self, by: str) -> None:
        """What a step of the recovery ladder does."""
        if self._fault is None or CURES.index(by) < CURES.index(self._fault[1]):
            return
        unplugged = self._fault[0] == "unplugged"
        self._fault = self._kept = None
        if unplugged:
            await self.network.open()

    async def power_cycle(self) -> None:
        """The USB port is switched off and on: a command of the operator's, by way of the control port."""
        await self.repair("power-cycle")
        self.network.close()
        await asyncio.sleep(RESET_S)
        await self.network.open()

    # Pictures.

    def _picture(self) -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
        """Colour and depth now; what did not change is not drawn again."""
        key = self._world.steps
        if self._drawn is None or self._drawn[0] != key or self._drawn[1] != (self.board is not None):
            rgb, depth = self._draw()
            self._drawn = (key, self.board is not None, rgb, depth)
        _, _, rgb, depth = self._drawn
        rows, columns = (int(self._rng.integers(size)) for size in rgb.shape[:2])
        noisy = rgb + np.roll(self._noise, (rows, columns), axis=(0, 1))
        return np.clip(noisy, 0, 255).astype(np.uint8), depth

    def _draw(self) -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
        noise = self.settings.depth_noise
        pose_base_tool = tcp_pose(self._world.joints_rad, FLANGE_TO_TIP)
        self._looks += 1
        rgb, depth = render(
            self._world.bullet,
            self._world.table,
            self.settings.mount,
            pose_base_tool,
            depth_scale_m=self.settings.depth_scale_m,
            renderer=self._world.renderer,
            sense=None if noise is None else partial(noise.measured, look=self._looks),
        )
        if self.board is not None:
            pose_base_camera = self.settings.mount.pose_base_camera(pose_base_tool)
            self.board.lay(rgb, depth, self.settings.mount.intrinsics, pose_base_camera, self.settings.depth_scale_m)
        return rgb, depth

    # The protocol.

    def _description(self) -> dict[str, Any]:
        k = self.settings.mount.intrinsics
        return {
            "kind": "device",
            "name": "Intel RealSense D435",
            "serial": self.settings.serial,
            "firmware": self.settings.firmware,
            "usb": "3.2",
            "width": k.width,
            "height": k.height,
            "fps": self.settings.fps,
            "depth_scale_m": self.settings.depth_scale_m,
            "fx": k.fx,
            "fy": k.fy,
            "cx": k.cx,
            "cy": k.cy,
        }

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await self.repair("restart")
        writer.write(_message(self._description()))
        sent = -1
        while line := await reader.readline():
            await self.network.thawed()
            request = json.loads(line)
            if request.get("do") == "hardware_reset":
                await self.repair("reset")
                # Whoever hears that it is done must not find it still there.
                self.network.shut()
                writer.write(_message({"kind": "ok"}))
                await writer.drain()
                self.network.keep(self.network.vanish(RESET_S))
                return
            if request.get("do") == "frame":
                self.asked += 1
                sent = await self._send_frame(writer, sent)

    async def _send_frame(self, writer: asyncio.StreamWriter, sent: int) -> int:
        """Send the next frame when there is one; returns its number."""
        await self._until(lambda: self._number() > sent and not self._is("dropout"))
        await self.network.thawed()
        header, colour, depth = self._frame()
        writer.write(_message(header) + colour + depth)
        await writer.drain()
        return int(header["number"]) if not self._is("stale") else sent

    def _frame(self) -> tuple[dict[str, Any], bytes, bytes]:
        number = self._number()
        if self._kept is None or not (self._is("frozen") or self._is("stale")):
            rgb, depth = self._picture()
            if self._is("black"):
                rgb, depth = np.zeros_like(rgb), np.zeros_like(depth)
            if self._is("no-depth"):
                depth = np.zeros_like(depth)
            colour_bytes, depth_bytes = rgb.tobytes(), depth.astype("<u2").tobytes()
            header = {"kind": "frame", "color_bytes": len(colour_bytes), "depth_bytes": len(depth_bytes)}
            self._kept = ({**header, **self._stamp(number)}, colour_bytes, depth_bytes)
        header, colour_bytes, depth_bytes = self._kept
        return (header if self._is("stale") else {**header, **self._stamp(number)}), colour_bytes, depth_bytes

    def _stamp(self, number: int) -> dict[str, Any]:
        return {"number": number, "timestamp_ms": self._started_ms + 1e3 * number / self.settings.fps}

    def _number(self) -> int:
        return int(self._robot.clock_s * self.settings.fps)

    def _is(self, kind: str) -> bool:
        return self._fault is not None and self._fault[0] == kind

    async def _until(self, holds: Callable[[], bool]) -> None:
        while not holds():
            await asyncio.sleep(0.002)


def _message(header: dict[str, Any]) -> bytes:
    text = json.dumps(header).encode()
    return struct.pack(">I", len(text)) + text
