"""Wires rig files to what is done with a rig; the one place that knows the UR10."""

from __future__ import annotations

import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import typer
from numpy.typing import NDArray

from handsight.cli.interrupts import INTERRUPTED
from handsight.cli.output import progress_bar
from handsight.collection.collector import CollectSettings
from handsight.collection.errors import RigPausedError
from handsight.collection.ur10.arm import Arm
from handsight.collection.ur10.calibrating import calibrate_camera, calibrate_jaws, calibrate_table
from handsight.collection.ur10.calibration import (
    Calibration,
    ReachCalibration,
    load_calibration,
    save_calibration,
    with_part,
)
from handsight.collection.ur10.camera import Camera
from handsight.collection.ur10.dashboard import Dashboard
from handsight.collection.ur10.gripper import gripper_for
from handsight.collection.ur10.logs import OperatorLog
from handsight.collection.ur10.payload import calibrate_payload
from handsight.collection.ur10.reach import calibrate_reach, cells
from handsight.collection.ur10.recovery import Recovery
from handsight.collection.ur10.rig import RigConfig
from handsight.collection.ur10.rig_file import load_rig
from handsight.collection.ur10.session import RigReport, collect_on_rig
from handsight.collection.ur10.station_factory import Ur10StationFactory, measured
from handsight.datasets.records import GraspAttempt
from handsight.datasets.store.repository import GraspRepository
from handsight.servoing.planar import PlanarPose

DRY_RUN_SHARE = 0.25
DRY_RUN_CLEARANCE_M = 0.1


def opened_rig(path: Path) -> RigConfig:
    """The rig of a file, checked.

    Raises:
        RigSettingsError: The file describes no usable rig.
    """
    return load_rig(path)


def rig_station(path: Path, dataset: str | Path) -> Ur10StationFactory:
    """The station of a rig's file, its calibration checked before anything moves.

    Raises:
        RigSettingsError: File or calibration are unusable.
    """
    return Ur10StationFactory.of(load_rig(path), data_folder=None if "://" in str(dataset) else Path(dataset).resolve())


def dry_run(rig: RigConfig, dataset: Path) -> dict[str, Any]:
    """One slow attempt that stays above the table, recorded in ``dataset``.

    Raises:
        RigSettingsError: The rig is not calibrated.
        RigPausedError, DeviceError: A device fails.
    """
    area, motion = rig.workspace, rig.motion
    slow = replace(
        rig,
        workspace=replace(
            area, clearance_m=DRY_RUN_CLEARANCE_M, drop_height_m=max(area.drop_height_m, DRY_RUN_CLEARANCE_M)
        ),
        motion=replace(
            motion,
            speed_m_s=DRY_RUN_SHARE * motion.speed_m_s,
            lift_speed_m_s=DRY_RUN_SHARE * motion.lift_speed_m_s,
            shake_speed_m_s=DRY_RUN_SHARE * motion.shake_speed_m_s,
        ),
        guards=replace(rig.guards, empty_looks=0),
    )
    seen: list[GraspAttempt] = []
    report = collect_on_rig(
        GraspRepository.open_or_create(dataset),
        Ur10StationFactory.of(slow, data_folder=dataset),
        CollectSettings(attempts=1),
        on_attempt=lambda attempt, _: seen.append(attempt),
    )
    if report.paused:
        raise RigPausedError(report.paused)
    (attempt,) = seen
    return {
        "outcome": attempt.outcome.name.lower(),
        "failure": attempt.failure,
        "robot_s": float(attempt.phase_s.sum()),
        "contact_force_n": attempt.contact_force_n,
        "dataset": str(dataset),
    }


def go_home(rig: RigConfig) -> NDArray[np.float64]:
    """Recover from whatever it is, lift, and go to the overhead pose; returns the pose there, shape (4, 4).

    Raises:
        RigPausedError: A person has to come.
        DeviceError: A device fails.
    """
    rig = measured(rig, load_calibration(rig.calibration))
    log = OperatorLog(rig.operator_log)
    log.note("home")
    gripper = gripper_for(rig.gripper)
    with closing(Arm(rig, table_height_m=rig.workspace.table_height_m)) as arm:
        try:
            Recovery(rig, arm, gripper, log).recover("home was asked for")
        finally:
            gripper.disconnect()
        area = rig.workspace
        arm.lift_straight(area.pregrasp_height_m, speed_m_s=rig.recovery.retreat_speed_m_s)
        x_m, y_m = area.centre_m
        home = PlanarPose(x_m=x_m, y_m=y_m, angle_rad=0.0).pose_base_tool(area.overhead_height_m)
        return arm.move_to(home, speed_m_s=DRY_RUN_SHARE * rig.motion.speed_m_s)


def calibrate(rig: RigConfig, part: str) -> Calibration:
    """Measure one part of a rig, keep it in the rig's calibration file, and return all of it.

    Args:
        rig: As its file has it.
        part: ``camera``, ``table``, ``gripper``, ``payload`` or ``reach``.

    Raises:
        RigSettingsError: What was measured disagrees with itself.
        RigPausedError, DeviceError: A device fails.
    """
    calibration = load_calibration(rig.calibration)
    rig = measured(rig, calibration)
    gripper = gripper_for(rig.gripper)
    try:
        if part == "gripper":
            gripper.connect()
            calibration = with_part(calibration, jaws=calibrate_jaws(gripper, rig))
        elif part == "reach":
            calibration = with_part(calibration, reach=_reach(rig))
        else:
            go_home(rig)
            with closing(Arm(rig, table_height_m=rig.workspace.table_height_m)) as arm:
                arm.take_control()
                if part == "payload":
                    calibration = with_part(calibration, payload=calibrate_payload(arm))
                elif part == "table":
                    gripper.connect()
                    calibration = with_part(calibration, table=calibrate_table(arm, gripper))
                else:
                    with closing(Camera(rig.camera)) as camera:
                        found = calibrate_camera(arm, camera, robot_serial=_serial(rig))
                    calibration = with_part(calibration, camera=found)
    finally:
        gripper.disconnect()
    save_calibration(rig.calibration, calibration)
    OperatorLog(rig.operator_log).note("calibrated", part=part, id=calibration.id)
    return calibration


def _reach(rig: RigConfig) -> ReachCalibration:
    with closing(Arm(rig, table_height_m=rig.workspace.table_height_m)) as arm:
        arm.take_control()
        with progress_bar("reach", cells(rig.workspace)) as bar:
            return calibrate_reach(arm, on_cell=bar.advance)


def _serial(rig: RigConfig) -> str:
    with Dashboard(rig.robot.address, rig.robot.dashboard_port) as dashboard:
        answer = dashboard.ask("get serial number")
    return answer if answer.isdigit() else ""


def collect_with_rig(
    dataset: str | Path, factory: Ur10StationFactory, settings: CollectSettings, *, resume: bool
) -> RigReport:
    """Collect behind a progress bar.

    Raises:
        DeviceError: A device is missing from the start.
        Exit: Ctrl-C; every attempt that was told of is committed.
    """
    repository = GraspRepository.open_or_create(dataset)
    new = successes = 0
    with progress_bar("collect", settings.attempts) as bar:

        def show(attempt: GraspAttempt, held: int) -> None:
            nonlocal new, successes
            new += 1
            successes += attempt.success
            bar.reached(held, f"{successes / new:.0%} successful")

        try:
            return collect_on_rig(repository, factory, settings, resume=resume, on_attempt=show)
        except KeyboardInterrupt:
            sys.stderr.write("interrupted: every attempt that was told of is committed; go on with --resume\n")
            raise typer.Exit(INTERRUPTED) from None
