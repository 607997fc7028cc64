"""Frame sets of an emulated camera, by a software device: an emulated camera cannot appear on the bus."""

from __future__ import annotations

from typing import Any

import numpy as np

from handsight.collection.errors import DeviceLostError
from handsight.collection.ur10.camera_source import CameraDescription, described
from handsight.collection.ur10.emulated_device import EmulatedCamera, EmulatedFrame
from handsight.collection.ur10.rig import CameraConfig

MOST_FEEDS = 10
SYNCER_MS = 30


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
        """See :class:`~.camera_source.Source`.

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
        """See :class:`~.camera_source.Source`."""
        d = self._cable.description
        known = {"name": d["name"], "serial_number": d["serial"], "firmware_version": d["firmware"]}
        return described(self._intrinsics, float(d["depth_scale_m"]), lambda name: str(known[name]))

    def reset(self) -> None:
        """See :class:`~.camera_source.Source`."""
        try:
            self._cable.hardware_reset()
        except (OSError, ValueError) as error:
            raise DeviceLostError(f"the emulated camera does not answer: {error}") from error

    def stop(self) -> None:
        """See :class:`~.camera_source.Source`."""
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
