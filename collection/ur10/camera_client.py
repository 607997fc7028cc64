"""``pyrealsense2`` as the camera's child has it: a device, a recording, or an emulated device, behind one path.

Frames of all three come from librealsense's own frame sets and are aligned, thresholded and inpainted alike (section
V-C of the paper inpaints and thresholds). What differs is the :class:`~.camera_source.Source` that hands out the frame
sets: a pipeline on a device, a pipeline on a ``.db3`` file, or a software device that is fed from a socket.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import DeviceError, DeviceLostError
from handsight.collection.ur10.camera_source import CameraDescription, Source
from handsight.collection.ur10.depth_filling import filled_depth
from handsight.collection.ur10.emulated_source import EmulatedSource
from handsight.collection.ur10.pipeline_source import PipelineSource
from handsight.collection.ur10.rig import CameraConfig

RESET_WAIT_S = 15.0
RESET_POLL_S = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """One aligned picture."""

    number: int
    timestamp_ms: float
    rgb: NDArray[np.uint8]
    """Shape (H, W, 3)."""
    depth: NDArray[np.uint16]
    """Thresholded and inpainted, in units of the depth scale. Shape (H, W)."""
    valid: float
    """Share of the depth that was measured, before holes were filled."""


@dataclass(frozen=True, slots=True)
class OpenCamera:
    """Opens the client in the child."""

    config: CameraConfig

    def __call__(self) -> CameraClient:
        """Start the camera."""
        return CameraClient(self.config)


class CameraClient:
    """The camera; lives in the child alone."""

    def __init__(self, config: CameraConfig) -> None:
        """Start it.

        Raises:
            DeviceError: It is not there, or another one is.
        """
        self._config = config
        self._rs = _realsense()
        self._align = self._rs.align(self._rs.stream.color)
        self._source: Source = self._opened()

    def _opened(self) -> Source:
        source: Source
        if self._config.kind == "emulated":
            source = EmulatedSource(self._rs, self._config)
        else:
            source = PipelineSource(self._rs, self._config)
        found = source.description().serial
        if self._config.serial and found != self._config.serial:
            source.stop()
            raise DeviceError(f"the camera has serial number {found}, and rig.toml names {self._config.serial}")
        return source

    def description(self) -> CameraDescription:
        """What the camera says it is."""
        return self._source.description()

    def picture(self, timeout_s: float) -> Picture:
        """A picture taken after the call.

        Raises:
            DeviceLostError: None came in time.
        """
        frames = self._align.process(self._source.wait(timeout_s))
        colour, depth = frames.get_color_frame(), frames.get_depth_frame()
        if not colour or not depth:
            raise DeviceLostError("a frame set without colour or depth")
        rgb = np.asanyarray(colour.get_data()).copy()
        raw = np.asanyarray(depth.get_data()).copy()
        scale_m = self._source.description().depth_scale_m
        filled, valid = filled_depth(raw, scale_m, self._config.nearest_m, self._config.farthest_m)
        return Picture(
            number=self._source.taken[0],
            timestamp_ms=self._source.taken[1],
            rgb=rgb,
            depth=filled,
            valid=valid,
        )

    def restart(self) -> None:
        """Stop the stream and start it anew."""
        self._source.stop()
        self._source = self._opened()

    def hardware_reset(self) -> None:
        """Have the device restart, wait until it is back, and start the stream.

        Raises:
            DeviceError: It does not come back.
        """
        self._source.reset()
        self._source.stop()
        until = time.monotonic() + RESET_WAIT_S
        while True:
            try:
                self._source = self._opened()
                return
            except DeviceError:
                if time.monotonic() > until:
                    raise
                time.sleep(RESET_POLL_S)

    def close(self) -> None:
        """Stop the stream."""
        self._source.stop()


def _realsense() -> Any:
    """The library, or what to install.

    Raises:
        DeviceError: It does not import.
    """
    try:
        import pyrealsense2
    except ImportError as error:
        raise DeviceError(
            f"pyrealsense2 cannot be imported ({error}): install handsight[ur10], and the system's libusb-1.0-0"
        ) from error
    return pyrealsense2
