"""Frame sets of a RealSense camera on the bus, or of a recording of one, by librealsense's pipeline."""

from __future__ import annotations

from typing import Any

from handsight.collection.errors import DeviceError, DeviceLostError
from handsight.collection.ur10.camera_source import CameraDescription, described
from handsight.collection.ur10.rig import CameraConfig

WARM_UP_FRAMES = 5
"""Pictures until the exposure has settled."""


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
        """See :class:`~.camera_source.Source`; what has queued up is from before, and dropped."""
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
        """See :class:`~.camera_source.Source`."""
        info, device = self._rs.camera_info, self._device
        profile = self._profile.get_stream(self._rs.stream.color).as_video_stream_profile()
        scale_m = device.first_depth_sensor().get_depth_scale()
        return described(profile.get_intrinsics(), scale_m, lambda name: _info(device, getattr(info, name)))

    def reset(self) -> None:
        """See :class:`~.camera_source.Source`."""
        if not self._recorded:
            self._device.hardware_reset()

    def stop(self) -> None:
        """See :class:`~.camera_source.Source`."""
        try:
            self._pipeline.stop()
        except RuntimeError:
            return  # It had stopped.


def _info(device: Any, name: Any) -> str:
    return str(device.get_info(name)) if device.supports(name) else ""
