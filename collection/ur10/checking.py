"""Looking at each device of a rig alone. Nothing here moves the arm or the jaws."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from handsight.collection.errors import CollectionError, DeviceError, RigSettingsError
from handsight.collection.ur10.arm import Arm
from handsight.collection.ur10.arm_client import FREQUENCY_HZ
from handsight.collection.ur10.calibration import ReachCalibration, check_calibration, load_calibration
from handsight.collection.ur10.camera import Camera
from handsight.collection.ur10.dashboard import Dashboard
from handsight.collection.ur10.gripper import gripper_for
from handsight.collection.ur10.guards import disk_fault, temperature_fault
from handsight.collection.ur10.kinematics import kinematics_id
from handsight.collection.ur10.reach import check_reach
from handsight.collection.ur10.rig import RigConfig

SAMPLES = 25
VERSIONS = {"cb3": "3.", "e-series": "5."}


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """What one look at one device found."""

    device: str
    what: str
    ok: bool
    found: str


def check_rig(rig: RigConfig, folder: Path) -> list[Finding]:
    """Look at everything, whatever is wrong with the rest.

    Args:
        rig: What to look at.
        folder: Whose disk is watched.
    """
    findings: list[Finding] = []
    looks: tuple[tuple[str, Callable[[RigConfig], Iterator[Finding]]], ...] = (
        ("controller", _controller),
        ("arm", _arm),
        ("gripper", _gripper),
        ("camera", _camera),
        ("calibration", _calibration),
    )
    for device, look in looks:
        try:
            findings.extend(look(rig))
        except CollectionError as error:
            findings.append(Finding(device=device, what="answers", ok=False, found=str(error)))
    fault = disk_fault(rig.guards, folder)
    findings.append(Finding(device="disk", what="space", ok=not fault, found=fault or "enough"))
    told = bool(rig.alarm.command or rig.alarm.webhook)
    findings.append(
        Finding(device="alarm", what="somebody is told", ok=told, found="yes" if told else "no [alarm] in rig.toml")
    )
    return findings


def _controller(rig: RigConfig) -> Iterator[Finding]:
    robot = rig.robot
    with Dashboard(robot.address, robot.dashboard_port) as dashboard:
        version = dashboard.ask("PolyscopeVersion")
        known = version.removeprefix("URSoftware ").startswith(VERSIONS[robot.generation])
        yield Finding(device="controller", what="generation", ok=known, found=version)
        safety = dashboard.safety()
        yield Finding(device="controller", what="safety", ok=safety in ("NORMAL", "REDUCED"), found=safety)
        mode = dashboard.mode()
        yield Finding(device="controller", what="mode", ok=mode == "RUNNING", found=mode)
        remote = dashboard.remote()
        found = {True: "remote", False: "local: switch it to remote", None: "no such mode"}[remote]
        yield Finding(device="controller", what="control", ok=remote is not False, found=found)
    try:
        identity = kinematics_id(robot.address, robot.primary_port) or "not told"
    except DeviceError as error:
        identity = f"not told: {error}"
    # A controller that keeps it to itself can be worked with.
    yield Finding(device="controller", what="kinematic calibration", ok=True, found=identity)


def _arm(rig: RigConfig) -> Iterator[Finding]:
    with closing(Arm(rig, table_height_m=rig.workspace.table_height_m)) as arm:
        states = [arm.state() for _ in range(SAMPLES)]
        stopped = states[-1].stopped_by
        yield Finding(device="arm", what="state", ok=not stopped, found=stopped or "may move")
        gaps = sorted(b.timestamp_s - a.timestamp_s for a, b in pairwise(states))
        found = f"every {1e3 * gaps[len(gaps) // 2]:.0f} ms, asked for {1e3 / FREQUENCY_HZ[rig.robot.generation]:.0f}"
        yield Finding(device="arm", what="data", ok=gaps[0] > 0, found=found)
        hot = temperature_fault(rig.guards, states[-1].temperatures_c)
        warmest = f"at most {max(states[-1].temperatures_c):.0f} degrees"
        yield Finding(device="arm", what="temperature", ok=not hot, found=hot or warmest)
        x_m, y_m, z_m = (round(value, 3) + 0.0 for value in states[-1].tcp_pose[:3])  # Without a minus before zero.
        yield Finding(device="arm", what="pose", ok=True, found=f"({x_m:.3f}, {y_m:.3f}, {z_m:.3f}) m")


def _gripper(rig: RigConfig) -> Iterator[Finding]:
    gripper = gripper_for(rig.gripper)
    try:
        raw = gripper.probe()
    finally:
        gripper.disconnect()
    found = " ".join(f"{name} {value}" for name, value in raw.items())
    yield Finding(device="gripper", what="registers", ok=True, found=found)


def _camera(rig: RigConfig) -> Iterator[Finding]:
    with closing(Camera(rig.camera)) as camera:
        description = camera.description()
        yield Finding(
            device="camera",
            what="device",
            ok=True,
            found=f"{description.name} {description.serial}, firmware {description.firmware or 'unknown'}",
        )
        first, second = camera.picture(), camera.picture()
        yield Finding(
            device="camera",
            what="pictures",
            ok=True,
            found=f"{second.rgb.shape[1]}x{second.rgb.shape[0]}, {second.valid:.0%} of the depth valid, frames "
            f"{first.number} and {second.number}",
        )


def _calibration(rig: RigConfig) -> Iterator[Finding]:
    calibration = load_calibration(rig.calibration)
    for part, measured in (("table", calibration.table), ("gripper", calibration.jaws)):
        found = f"of {measured.date}" if measured else f"not yet: 'rig calibrate {part}'"
        yield Finding(device="calibration", what=part, ok=measured is not None, found=found)
    if calibration.payload is not None:
        weighed = calibration.payload
        found = f"{weighed.mass_kg:.2f} kg of {weighed.date}"
        yield Finding(device="calibration", what="payload", ok=True, found=found)
    if calibration.reach is not None:
        yield from _reach(calibration.reach, rig)
    try:
        camera = check_calibration(calibration, rig.calibration, rig.camera.serial)
    except RigSettingsError as error:
        yield Finding(device="calibration", what="camera", ok=False, found=str(error))
        return
    yield Finding(
        device="calibration",
        what="camera",
        ok=True,
        found=f"of {camera.date}, residual {1e3 * camera.residual_m:.2f} mm, {1e3 * camera.residual_rad:.1f} mrad",
    )


def _reach(reach: ReachCalibration, rig: RigConfig) -> Iterator[Finding]:
    try:
        check_reach(reach, rig.workspace)
    except RigSettingsError as error:
        yield Finding(device="calibration", what="reach", ok=False, found=str(error))
        return
    found = f"{reach.share:.0%} of the workspace, {reach.date}"
    yield Finding(device="calibration", what="reach", ok=True, found=found)
