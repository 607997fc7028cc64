"""A RealSense recording, a real ``.db3``, of what the emulated camera sees.

    python -m handsight.collection.ur10.emulator.recording 127.0.0.3 table.db3 --frames 60

It is written by ``pyrealsense2``'s own recorder, so that a pipeline plays it back like one of a camera.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from handsight.collection.ur10.emulated_device import EmulatedCamera, EmulatedFrame
from handsight.collection.ur10.emulator.camera import PORT

FRAME_LIMIT_S = 10.0
BAD_INPUT = 2


def record(camera: EmulatedCamera, path: Path, frames: int) -> None:
    """Record so many pictures of a connected camera into a new file.

    Raises:
        ImportError: ``pyrealsense2`` is not there, or libusb is missing.
        OSError: The camera is gone, or sends nothing.
        RuntimeError: The recorder cannot write there.
    """
    import pyrealsense2 as rs  # An extra, and slow to import.

    device = rs.software_device()
    described = camera.description
    device.register_info(rs.camera_info.name, described["name"])
    device.register_info(rs.camera_info.serial_number, described["serial"])
    device.register_info(rs.camera_info.firmware_version, described["firmware"])
    sensors, profiles = _streams(rs, device, described)
    recorder = rs.recorder(str(path), device)
    # What is opened and started are the recorder's sensors; what is fed are the device's.
    recorded = {sensor.get_info(rs.camera_info.name): sensor for sensor in recorder.query_sensors()}
    syncer = rs.syncer(frames + 1)
    for name, sensor in recorded.items():
        sensor.open(profiles[name])
        sensor.start(syncer)
    for number in range(frames):
        _feed(rs, sensors, profiles, camera.frame(FRAME_LIMIT_S), number, described)
        syncer.try_wait_for_frames(100)
    for sensor in recorded.values():
        sensor.stop()
        sensor.close()


def _streams(rs: Any, device: Any, described: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Add depth and colour to a software device; their sensors and profiles by name."""
    sensors, profiles = {}, {}
    kinds = (("depth", rs.stream.depth, 2, rs.format.z16), ("color", rs.stream.color, 3, rs.format.rgb8))
    for index, (name, kind, bytes_per_pixel, layout) in enumerate(kinds):
        sensor = sensors[name] = device.add_sensor(name)
        stream, intrinsics = rs.video_stream(), rs.intrinsics()
        intrinsics.width, intrinsics.height = described["width"], described["height"]
        intrinsics.fx, intrinsics.fy = described["fx"], described["fy"]
        intrinsics.ppx, intrinsics.ppy = described["cx"], described["cy"]
        stream.type, stream.uid, stream.fps = kind, index, int(described["fps"])
        stream.width, stream.height = described["width"], described["height"]
        stream.bpp, stream.fmt = bytes_per_pixel, layout
        stream.intrinsics = intrinsics
        if name == "depth":
            sensor.add_read_only_option(rs.option.depth_units, described["depth_scale_m"])
        profiles[name] = sensor.add_video_stream(stream).as_video_stream_profile()
    same = rs.extrinsics()
    same.rotation, same.translation = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0]
    profiles["depth"].register_extrinsics_to(profiles["color"], same)
    device.create_matcher(rs.matchers.default)
    return sensors, profiles


def _feed(rs: Any, sensors: Any, profiles: Any, frame: EmulatedFrame, number: int, described: Any) -> None:
    for name, pixels, bytes_per_pixel in (("depth", frame.depth, 2), ("color", frame.rgb, 3)):
        made = rs.software_video_frame()
        made.pixels = np.ascontiguousarray(pixels)
        made.stride, made.bpp = pixels.shape[1] * bytes_per_pixel, bytes_per_pixel
        # Evenly, whatever was missed: a recording is played back at the pace of its times.
        made.timestamp, made.domain = 1e3 * number / float(described["fps"]), rs.timestamp_domain.hardware_clock
        made.frame_number, made.profile = number, profiles[name]
        if name == "depth":
            made.depth_units = described["depth_scale_m"]
        sensors[name].on_video_frame(made)


def main(arguments: Sequence[str] | None = None) -> int:
    """Record what an emulated camera sees."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("address", help="of the emulated camera")
    parser.add_argument("out", type=Path, help="file to write, ending in .db3")
    parser.add_argument("--port", type=int, default=PORT)
    parser.add_argument("--frames", type=int, default=60)
    options = parser.parse_args(arguments)
    if options.out.suffix != ".db3" or options.frames < 1:
        sys.stderr.write(f"{options.out} and --frames {options.frames}, expected a .db3 file and at least one frame\n")
        return BAD_INPUT
    try:
        with EmulatedCamera(options.address, options.port) as camera:
            record(camera, options.out, options.frames)
    except (OSError, ImportError, RuntimeError) as error:
        sys.stderr.write(f"{options.out} was not written: {error}\n")
        return BAD_INPUT
    return 0


if __name__ == "__main__":
    sys.exit(main())
