"""A rig with its calibration, from which its station is opened."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from handsight.collection.ur10.calibration import Calibration, check_calibration, load_calibration
from handsight.collection.ur10.reach import check_reach
from handsight.collection.ur10.rig import RigConfig
from handsight.collection.ur10.station import Ur10Station
from handsight.datasets.records import StationSpec


@dataclass(frozen=True, slots=True, kw_only=True)
class Ur10StationFactory:
    """Opens the station of a rig; there is one arm, so one station at a time."""

    rig: RigConfig
    calibration: Calibration
    data_folder: Path | None = None
    """Where the data go; its disk is watched."""

    @classmethod
    def of(cls, rig: RigConfig, *, data_folder: Path | None = None) -> Ur10StationFactory:
        """The station of a rig with its calibration.

        Raises:
            RigSettingsError: The calibration is missing, damaged, or of another camera or workspace.
        """
        calibration = load_calibration(rig.calibration)
        check_calibration(calibration, rig.calibration, rig.camera.serial)
        if calibration.reach is not None:
            check_reach(calibration.reach, rig.workspace)
        return cls(rig=measured(rig, calibration), calibration=calibration, data_folder=data_folder)

    @property
    def spec(self) -> StationSpec:
        """The spec of every station it opens."""
        camera = check_calibration(self.calibration, self.rig.calibration, self.rig.camera.serial)
        return StationSpec(
            source="ur10",
            camera=camera.camera,
            depth_scale_m=camera.depth_scale_m,
            gripper_stroke_m=self.rig.gripper.stroke_m,
            closed_width_m=self.rig.gripper.closed_width_m,
            pregrasp_height_m=self.rig.workspace.pregrasp_height_m,
            serials={"camera": camera.serial, "robot": camera.robot, "gripper": self.rig.gripper.model},
        )

    @property
    def objects_per_scene(self) -> int:
        """Nobody knows what lies on the table."""
        return 0

    @property
    def pushable(self) -> bool:
        """Nobody stands at the table."""
        return False

    def settings(self) -> dict[str, object]:
        """Rig and calibration, as JSON values."""
        return {"rig": self.rig.to_json(), "calibration": self.calibration.to_json()}

    def __call__(self) -> Ur10Station:
        """Connect to everything.

        Raises:
            DeviceError: A device is missing.
            RigSettingsError: Another camera is mounted than was calibrated.
        """
        return Ur10Station(self.rig, self.calibration, self.spec, data_folder=self.data_folder)


def measured(rig: RigConfig, calibration: Calibration) -> RigConfig:
    """A rig with what was measured in the place of what its file has."""
    if calibration.table is not None:
        rig = replace(rig, workspace=replace(rig.workspace, table_height_m=calibration.table.height_m))
    if calibration.jaws is not None:
        jaws = calibration.jaws
        rig = replace(rig, gripper=replace(rig.gripper, open_count=jaws.open_count, closed_count=jaws.closed_count))
    if calibration.payload is not None:
        weighed = calibration.payload
        robot = replace(rig.robot, payload_kg=weighed.mass_kg, centre_of_mass_m=weighed.centre_of_mass_m)
        rig = replace(rig, robot=robot)
    return rig
