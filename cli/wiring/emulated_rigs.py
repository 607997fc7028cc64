"""The emulated rig that a rig's file and options describe."""

from __future__ import annotations

import ipaddress
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from handsight.cli.errors import CommandError
from handsight.cli.wiring.stations import sim_station
from handsight.collection.depth_noise import DepthNoise
from handsight.collection.errors import CollectionError
from handsight.collection.sim.config import D435_COLOUR_FOV_Y_RAD, D435_ON_GRIPPER, SimConfig
from handsight.collection.sim.grippers import GRIPPERS
from handsight.collection.ur10.emulator.board import Board
from handsight.collection.ur10.emulator.camera import CameraSettings
from handsight.collection.ur10.emulator.faults import Fault
from handsight.collection.ur10.emulator.forces import Payload
from handsight.collection.ur10.emulator.generation import GENERATIONS
from handsight.collection.ur10.emulator.launch import Launch
from handsight.collection.ur10.emulator.rg2 import PORT as RG2_PORT
from handsight.collection.ur10.emulator.rig import RigSettings
from handsight.collection.ur10.rig import RigConfig
from handsight.collection.ur10.rig_file import load_rig
from handsight.servoing.camera import Intrinsics


def emulated_rig(
    path: Path,
    *,
    objects: str,
    per_scene: int | None,
    empty: bool,
    board: bool,
    speed: float,
    seed: int,
    faults: Sequence[str],
    faults_per_hour: float,
    depth_noise_px: float,
    control_port: int | None,
) -> Launch:
    """What ``rig emulate`` starts.

    Raises:
        RigSettingsError: The file describes no usable rig.
        CommandError: It describes none that can be emulated, or a fault does not exist; all faults are named.
        ObjectSetError: Unknown object set.
    """
    rig = load_rig(path)
    wrong = _not_emulated(rig)
    if empty and per_scene is not None:
        wrong.append(f"--empty and --objects-per-scene {per_scene} were both given, expected one of them")
    if board and rig.camera.kind != "emulated":
        wrong.append(f"--board was given and camera.kind is {rig.camera.kind!r}, expected 'emulated': nobody sees it")
    parsed = []
    for text in faults:
        try:
            parsed.append(Fault.parse(text))
        except CollectionError as error:
            wrong.append(str(error))
    if wrong:
        raise CommandError("; ".join(wrong))
    rg2 = rig.gripper.kind == "rg2"
    # The RG2 opens wider than the smaller of the simulator's grippers.
    world = sim_station(
        objects, gripper="2f-140" if rg2 else rig.gripper.model, shakes=0, per_scene=per_scene, vary=()
    ).config
    settings = RigSettings(
        robot=rig.robot.address,
        generation=GENERATIONS[rig.robot.generation],
        speed=speed,
        seed=seed,
        rg2=(rig.gripper.address, rig.gripper.port or RG2_PORT) if rg2 else None,
        faults_per_hour=faults_per_hour,
        true_payload=Payload(rig.robot.payload_kg, rig.robot.centre_of_mass_m),
        camera=_camera(rig, depth_noise_px, seed),
    )
    return Launch(
        rig=settings,
        world=_over(world, rig),
        empty=empty,
        board=_board(rig) if board else None,
        control_port=control_port,
        faults=tuple(parsed),
    )


def _not_emulated(rig: RigConfig) -> list[str]:
    """What the file asks for that no emulator here has."""
    wrong = []
    named = {"robot.address": rig.robot.address, "gripper.address": rig.gripper.address}
    if rig.camera.kind == "emulated":
        named["camera.address"] = rig.camera.address
    for key, address in named.items():
        if not _is_loopback(address):
            wrong.append(f"{key} is {address!r}, expected a loopback address 127.0.0.N for an emulated rig")
    if rig.gripper.kind == "robotiq" and rig.gripper.address != rig.robot.address:
        wrong.append(
            f"gripper.address is {rig.gripper.address!r}, expected the robot's {rig.robot.address}: the URCap listens "
            "there"
        )
    if rig.gripper.kind == "robotiq" and rig.gripper.model not in GRIPPERS:
        wrong.append(f"gripper.model is {rig.gripper.model!r}, expected one of: {', '.join(GRIPPERS)}")
    return wrong


def _is_loopback(address: str) -> bool:
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return False


def _over(config: SimConfig, rig: RigConfig) -> SimConfig:
    """The world with its objects where the rig grasps."""
    return replace(config, workspace=rig.workspace.area)


def _board(rig: RigConfig) -> Board:
    """The board of the file, where ``rig calibrate camera`` looks for it."""
    x_m, y_m = rig.workspace.centre_m
    return Board(**asdict(rig.board), x_m=x_m, y_m=y_m)


def _camera(rig: RigConfig, depth_noise_px: float, seed: int) -> CameraSettings | None:
    if rig.camera.kind != "emulated":
        return None
    intrinsics = Intrinsics.from_vertical_fov(
        width=rig.camera.width, height=rig.camera.height, fov_y_rad=D435_COLOUR_FOV_Y_RAD
    )
    settings = CameraSettings(
        address=rig.camera.address,
        port=rig.camera.port,
        mount=replace(D435_ON_GRIPPER, intrinsics=intrinsics),
        fps=float(rig.camera.fps),
        depth_noise=DepthNoise(subpixel_px=depth_noise_px, seed=seed) if depth_noise_px > 0 else None,
    )
    return replace(settings, serial=rig.camera.serial) if rig.camera.serial else settings
