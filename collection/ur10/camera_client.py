"""``pyrealsense2`` as the camera's child has it: a device, a recording, or an emulated device, behind one path.

Frames of all three come from librealsense's own frame sets and are aligned, thresholded and inpainted alike (section
V-C of the paper inpaints and thresholds). What differs is what hands out the frame sets: a pipeline on a device, a
pipeline on a ``.db3`` file, or a software device that is fed from a socket, because an emulated camera cannot appear
on the bus.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.collection.errors import DeviceError, DeviceLostError
from handsight.collection.ur10.emulated_device import EmulatedCamera, EmulatedFrame
from handsight.collection.ur10.rig import CameraConfig

INPAINT_RADIUS_PX = 3
MOST_FEEDS = 10
SYNCER_MS = 30
WARM_UP_FRAMES = 5
"""Pictures until the exposure has settled."""
RESET_WAIT_S = 15.0
RESET_POLL_S = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraDescription:
    """What the camera says it is."""

    name: str
    serial: str
    firmware: str
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    depth_scale_m: float


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


class Source(Protocol):
    """Hands out librealsense frame sets."""

    def wait(self, timeout_s: float) -> Any:
        """The next frame set with colour and depth.

        Raises:
            DeviceLostError: None came.
        """

    taken: tuple[int, float]
    """Number and time [ms] of the last frame set, by the camera's own count."""

    def description(self) -> CameraDescription:
        """What it is."""

    def reset(self) -> None:
        """Have the device restart."""

    def stop(self) -> None:
        """Stop it."""


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


def filled_depth(
    raw: NDArray[np.uint16], scale_m: float, nearest_m: float, farthest_m: float
) -> tuple[NDArray[np.uint16], float]:
    """Depth with what is out of range taken out and holes inpainted, shape (H, W), and the share that was measured.

    Args:
        raw: As measured, 0 where nothing was. Shape (H, W).
        scale_m: Metres per unit.
        nearest_m: Nearer is noise.
        farthest_m: Farther is noise.
    """
    depth = raw.copy()
    depth[(depth < nearest_m / scale_m) | (depth > farthest_m / scale_m)] = 0
    holes = (depth == 0).astype(np.uint8)
    valid = 1.0 - float(holes.mean())
    if valid in (0.0, 1.0):
        return depth, valid
    filled = cv2.inpaint(depth, holes, INPAINT_RADIUS_PX, cv2.INPAINT_TELEA)
    return np.asarray(filled, dtype=np.uint16), valid


class PipelineSource:
    """A device on the bus, or a recording of one."""

    def __init__(self, rs: Any, config: CameraConfig) -> None:
        """Start the stream.

        Raises:
            DeviceError: There is no such device or file, or it does not stream that.
        """
        self._rs, self._recorded = rs, config.kind == "recording"
        self.taken = (0, 0.0)
        setup = rs.config()
        if self._recorded:
            rs.config.enable_device_from_file(setup, config.file, repeat_playback=False)
        else:
            self._refuse_several(config)
            if config.serial:
                setup.enable_device(config.serial)
            setup.enable_stream(rs.stream.color, config.width, config.height, rs.format.rgb8, config.fps)
            setup.enable_stream(rs.stream.depth, config.width, config.height, rs.format.z16, config.fps)
        self._pipeline = rs.pipeline()
        try:
            self._profile = self._pipeline.start(setup)
        except RuntimeError as error:
            raise DeviceLostError(f"the stream does not start: {error}") from error
        self._device = self._profile.get_device()
        if self._recorded:
            self._device.as_playback().set_real_time(False)
        else:
            self._settle(config)

    def _refuse_several(self, config: CameraConfig) -> None:
        devices = self._rs.context().query_devices()
        if len(devices) == 0:
            raise DeviceLostError("no RealSense camera is connected: look at its cable")
        if len(devices) > 1 and not config.serial:
            raise DeviceError("several RealSense cameras are connected: name one by camera.serial in rig.toml")

    def _settle(self, config: CameraConfig) -> None:
        rs = self._rs
        if config.exposure_us:
            sensor = self._device.first_color_sensor()
            sensor.set_option(rs.option.enable_auto_exposure, 0)
            sensor.set_option(rs.option.exposure, config.exposure_us)
            sensor.set_option(rs.option.enable_auto_white_balance, 0)
        for _ in range(WARM_UP_FRAMES):
            self.wait(config.timeout_s)

    def wait(self, timeout_s: float) -> Any:
        """See :class:`Source`; what has queued up is from before, and dropped."""
        if not self._recorded:
            while self._pipeline.poll_for_frames():
                pass
        good, frames = self._pipeline.try_wait_for_frames(round(1e3 * timeout_s))
        if not good:
            raise DeviceLostError("the recording has ended" if self._recorded else f"no frame within {timeout_s:g} s")
        colour = frames.get_color_frame()
        self.taken = (int(colour.get_frame_number()), float(colour.get_timestamp())) if colour else (0, 0.0)
        return frames

    def description(self) -> CameraDescription:
        """See :class:`Source`."""
        info, device = self._rs.camera_info, self._device
        profile = self._profile.get_stream(self._rs.stream.color).as_video_stream_profile()
        scale_m = device.first_depth_sensor().get_depth_scale()
        return _described(profile.get_intrinsics(), scale_m, lambda name: _info(device, getattr(info, name)))

    def reset(self) -> None:
        """See :class:`Source`."""
        if not self._recorded:
            self._device.hardware_reset()

    def stop(self) -> None:
        """See :class:`Source`."""
        try:
            self._pipeline.stop()
        except RuntimeError:
            return  # It had stopped.


class EmulatedSource:
    """A software device that is fed with what an emulated camera sends."""

    def __init__(self, rs: Any, config: CameraConfig) -> None:
        """Connect, and build the device after what the camera says it is.

        Raises:
            DeviceLostError: Nobody answers.
        """
        self._rs, self._config = rs, config
        try:
            self._cable = EmulatedCamera(config.address, config.port)
        except (OSError, ValueError) as error:
            raise DeviceLostError(f"emulated camera {config.address}:{config.port}: {error}") from error
        d = self._cable.description
        self._intrinsics = _intrinsics(rs, d)
        self._device = rs.software_device()
        self._sensors = {}
        self._profiles = {}
        kinds = (("depth", rs.stream.depth, 2, rs.format.z16), ("color", rs.stream.color, 3, rs.format.rgb8))
        for index, (name, kind, bpp, layout) in enumerate(kinds):
            sensor = self._device.add_sensor(name)
            stream = rs.video_stream()
            stream.type, stream.uid, stream.width, stream.height = kind, index, d["width"], d["height"]
            stream.fps, stream.bpp, stream.fmt, stream.intrinsics = int(d["fps"]), bpp, layout, self._intrinsics
            self._profiles[name] = sensor.add_video_stream(stream).as_video_stream_profile()
            self._sensors[name] = sensor
        self._sensors["depth"].add_read_only_option(rs.option.depth_units, d["depth_scale_m"])
        same = rs.extrinsics()
        same.rotation, same.translation = [1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0], [0.0, 0, 0]
        self._profiles["depth"].register_extrinsics_to(self._profiles["color"], same)
        self._device.create_matcher(rs.matchers.default)
        self._syncer = rs.syncer(30)
        for name, sensor in self._sensors.items():
            sensor.open(self._profiles[name])
            sensor.start(self._syncer)
        self._fed = 1
        self.taken = (0, 0.0)

    def wait(self, timeout_s: float) -> Any:
        """See :class:`Source`.

        The syncer pairs what comes evenly and gives colour and depth apart where there were gaps. So pictures are fed
        with numbers and times of their own, and one that came out apart is fed again. A set counts once its number is
        one under which this picture was fed: what is older shows what was there before.
        """
        try:
            frame = self._cable.frame(timeout_s)
        except (OSError, ValueError, KeyError) as error:
            reason = str(error) or type(error).__name__
            raise DeviceLostError(f"no frame within {timeout_s:g} s: {reason}") from error
        first = self._fed
        for _ in range(MOST_FEEDS):
            self._feed(frame)
            while True:
                good, frames = self._syncer.try_wait_for_frames(SYNCER_MS)
                if not good:
                    break
                colour, depth = frames.get_color_frame(), frames.get_depth_frame()
                if colour and depth and min(colour.get_frame_number(), depth.get_frame_number()) >= first:
                    self.taken = (frame.number, frame.timestamp_ms)
                    return frames
        raise DeviceLostError(f"no complete frame set for frame {frame.number}")

    def _feed(self, frame: EmulatedFrame) -> None:
        rs = self._rs
        for name, pixels, bpp in (("depth", frame.depth, 2), ("color", frame.rgb, 3)):
            made = rs.software_video_frame()
            made.pixels = np.ascontiguousarray(pixels)
            made.stride, made.bpp = pixels.shape[1] * bpp, bpp
            made.timestamp = 1e3 * self._fed / float(self._cable.description["fps"])
            made.domain = rs.timestamp_domain.hardware_clock
            made.frame_number, made.profile = self._fed, self._profiles[name].as_video_stream_profile()
            if name == "depth":
                made.depth_units = self._cable.description["depth_scale_m"]
            self._sensors[name].on_video_frame(made)
        self._fed += 1

    def description(self) -> CameraDescription:
        """See :class:`Source`."""
        d = self._cable.description
        known = {"name": d["name"], "serial_number": d["serial"], "firmware_version": d["firmware"]}
        return _described(self._intrinsics, float(d["depth_scale_m"]), lambda name: str(known[name]))

    def reset(self) -> None:
        """See :class:`Source`."""
        try:
            self._cable.hardware_reset()
        except (OSError, ValueError) as error:
            raise DeviceLostError(f"the emulated camera does not answer: {error}") from error

    def stop(self) -> None:
        """See :class:`Source`."""
        self._cable.close()
        for sensor in self._sensors.values():
            sensor.stop()
            sensor.close()


def _intrinsics(rs: Any, d: Any) -> Any:
    made = rs.intrinsics()
    made.width, made.height, made.fx, made.fy, made.ppx, made.ppy = (
        d[name] for name in ("width", "height", "fx", "fy", "cx", "cy")
    )
    made.model, made.coeffs = rs.distortion.none, [0.0] * 5
    return made


def _described(intrinsics: Any, scale_m: float, said: Any) -> CameraDescription:
    return CameraDescription(
        name=said("name"),
        serial=said("serial_number"),
        firmware=said("firmware_version"),
        width=int(intrinsics.width),
        height=int(intrinsics.height),
        # Kept as floats of 32 bits there: 0.001 comes back as 0.0010000000475.
        fx=round(float(intrinsics.fx), 5),
        fy=round(float(intrinsics.fy), 5),
        cx=round(float(intrinsics.ppx), 5),
        cy=round(float(intrinsics.ppy), 5),
        depth_scale_m=round(scale_m, 9),
    )


def _info(device: Any, name: Any) -> str:
    return str(device.get_info(name)) if device.supports(name) else ""


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
