"""Rig files and calibrations for an emulated rig that a test runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tests.support.emulated_rig import RunningRig

from handsight.collection.sim.config import D435_ON_GRIPPER
from handsight.collection.ur10.calibration import Calibration, CameraCalibration, save_calibration
from handsight.collection.ur10.rig_file import load_rig
from handsight.collection.ur10.station_factory import Ur10StationFactory

SERIAL = "934222071234"
"""Of the emulated camera."""

RIG = """
[robot]
address = "{robot}"
generation = "{generation}"
payload_kg = 1.3
centre_of_mass_m = [0.0, 0.0, 0.06]
tcp_length_m = 0.16
stale_s = 2.0
[camera]
kind = "emulated"
address = "{camera}"
serial = "934222071234"
timeout_s = 3.0
{power_cycle}
[gripper]
kind = "robotiq"
address = "{robot}"
model = "2f-85"
stroke_m = 0.085
closed_width_m = 0.0012
open_count = 0
closed_count = 228
timeout_s = 5.0
[workspace]
x_min_m = 0.5
x_max_m = 0.8
y_min_m = -0.15
y_max_m = 0.15
[guards]
disk_free_gb = 0.0
empty_looks = 0
[recovery]
unlock_wait_s = 0.7
protective_stops_per_10_min = 20
recoveries_per_hour = 200
"""


def write_rig_file(folder: Path, *, robot: str, camera: str, generation: str, power_cycle: Sequence[str] = ()) -> Path:
    """The file of a rig in ``folder``, with the true calibration of the emulated camera beside it."""
    words = ", ".join(f'"{word}"' for word in power_cycle)
    path = folder / "rig.toml"
    path.write_text(
        RIG.format(
            robot=robot, camera=camera, generation=generation, power_cycle=f"power_cycle = [{words}]" if words else ""
        ),
        encoding="utf-8",
    )
    save_calibration(folder / "calibration.json", true_calibration())
    return path


def true_calibration(serial: str = SERIAL) -> Calibration:
    """Where the emulated camera is unless it is mounted otherwise."""
    mount = D435_ON_GRIPPER
    return Calibration(
        camera=CameraCalibration(
            date="2026-01-01T00:00:00+00:00",
            serial=serial,
            intrinsics=mount.intrinsics,
            depth_scale_m=0.001,
            translation_m=(mount.x_tool_camera_m, mount.y_tool_camera_m, mount.z_tool_camera_m),
            rotation_rad=(0.0, 0.0, 0.0),
            residual_m=0.0,
            residual_rad=0.0,
            views=14,
            robot="2016350000",
        )
    )


def station_factory(folder: Path, rig: RunningRig, *, power_cycle: Sequence[str] = ()) -> Ur10StationFactory:
    """The station of an emulated rig that runs."""
    path = write_rig_file(
        folder, robot=rig.robot, camera=rig.camera, generation=rig.generation, power_cycle=power_cycle
    )
    return Ur10StationFactory.of(load_rig(path))
