"""``python -m handsight.collection.ur10.emulator``: an emulated rig in a process of its own.

It prints one line of JSON once everything listens, and ends on SIGTERM, on SIGINT, or with the process that started
it.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence

from handsight.collection.depth_noise import DepthNoise
from handsight.collection.errors import CollectionError
from handsight.collection.sim.config import D435_ON_GRIPPER, SimConfig
from handsight.collection.station import Workspace
from handsight.collection.ur10.emulator.board import Board
from handsight.collection.ur10.emulator.camera import PORT as CAMERA_PORT
from handsight.collection.ur10.emulator.camera import CameraSettings, MountedCamera
from handsight.collection.ur10.emulator.errors import EmulatorError
from handsight.collection.ur10.emulator.faults import Fault
from handsight.collection.ur10.emulator.forces import Payload
from handsight.collection.ur10.emulator.generation import E_SERIES, GENERATIONS
from handsight.collection.ur10.emulator.launch import FASTEST, SLOWEST, Launch, end_with_parent, run
from handsight.collection.ur10.emulator.rg2 import PORT as RG2_PORT
from handsight.collection.ur10.emulator.rig import RigSettings

BAD_INPUT = 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Run until told to end."""
    end_with_parent()
    try:
        run(launch_of(_parser().parse_args(arguments)), _announce)
    except CollectionError as error:
        sys.stderr.write(f"{error}\n")
        return BAD_INPUT
    return 0


def _announce(ready: Mapping[str, object]) -> None:
    sys.stdout.write(json.dumps(ready) + "\n")
    sys.stdout.flush()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m handsight.collection.ur10.emulator", description=__doc__)
    parser.add_argument("--robot", default="127.0.0.2", help="loopback address of controller and gripper")
    parser.add_argument("--generation", choices=sorted(GENERATIONS), default=E_SERIES.name)
    parser.add_argument("--camera", metavar="ADDRESS[:PORT]", help="loopback address of the camera")
    parser.add_argument("--control", type=int, metavar="PORT", help="port of the robot's address for faults")
    parser.add_argument("--objects", metavar="SET", help="object set; without one there is nothing but protocols")
    parser.add_argument("--objects-per-scene", type=int, default=5)
    parser.add_argument("--empty", action="store_true", help="nothing lies on the table at first")
    parser.add_argument("--board", action="store_true", help="a ChArUco board lies on the table")
    parser.add_argument("--gripper", default="2f-85")
    parser.add_argument("--rg2", metavar="ADDRESS[:PORT]", help="an OnRobot RG2 there, in place of the Robotiq")
    parser.add_argument("--workspace", metavar="X0,X1,Y0,Y1", help="where objects are dropped [m]")
    parser.add_argument("--mount", metavar="X,Y,Z,RX,RY,RZ", help="camera in the tool frame [m, rad]")
    parser.add_argument("--depth-noise", type=float, default=0.0, metavar="PX", help="of the disparity; 0 for none")
    parser.add_argument("--payload", type=float, default=1.3, metavar="KG", help="what really hangs on the flange")
    parser.add_argument("--payload-centre", metavar="X,Y,Z", help="its centre of mass in the flange frame [m]")
    parser.add_argument("--speed", type=float, default=1.0, help="robot time per wall time, at most")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--faults-per-hour", type=float, default=0.0, help="at random, of robot time")
    parser.add_argument("--fault", action="append", default=[], help="NAME[:KEY=VALUE,...][@WHEN]")
    return parser


def launch_of(options: argparse.Namespace) -> Launch:
    """What the options say.

    Raises:
        CollectionError: They make no sense; all faults are named at once.
    """
    wrong: list[str] = []
    faults = []
    for text in options.fault:
        try:
            faults.append(Fault.parse(text))
        except EmulatorError as error:
            wrong.append(str(error))
    area = _numbers("--workspace", options.workspace, 4, wrong)
    mount = _numbers("--mount", options.mount, 6, wrong)
    centre = _numbers("--payload-centre", options.payload_centre, 3, wrong) or Payload().centre_m
    if options.camera is not None and options.objects is None:
        wrong.append("--camera is given without --objects, expected a world that it sees")
    if not SLOWEST <= options.speed <= FASTEST:
        wrong.append(f"--speed is {options.speed}, expected {SLOWEST:g} to {FASTEST:g}")
    if not 0 <= options.faults_per_hour <= 3600:
        wrong.append(f"--faults-per-hour is {options.faults_per_hour}, expected 0 to 3600")
    if wrong:
        raise EmulatorError("; ".join(wrong))
    rig = RigSettings(
        robot=options.robot,
        generation=GENERATIONS[options.generation],
        speed=options.speed,
        seed=options.seed,
        rg2=None if options.rg2 is None else _place(options.rg2, RG2_PORT),
        faults_per_hour=options.faults_per_hour,
        true_payload=Payload(options.payload, centre),
        camera=_camera(options, mount),
    )
    return Launch(
        rig=rig,
        world=_world(options, area),
        empty=options.empty,
        board=Board() if options.board else None,
        control_port=options.control,
        faults=tuple(faults),
    )


def _numbers(name: str, text: str | None, count: int, wrong: list[str]) -> tuple[float, ...] | None:
    if text is None:
        return None
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count:
        wrong.append(f"{name} is {text!r}, expected {count} numbers with commas between them")
        return None
    return values


def _place(text: str, port: int) -> tuple[str, int]:
    """Address and port of a device; the port is that of its kind unless given."""
    address, _, given = text.partition(":")
    if given and not given.isdigit():
        raise EmulatorError(f"{text} has no port behind its colon, expected a number")
    return address, int(given) if given else port


def _world(options: argparse.Namespace, area: tuple[float, ...] | None) -> SimConfig | None:
    if options.objects is None:
        return None
    workspace = SimConfig().workspace
    if area is not None:
        workspace = Workspace(x_min_m=area[0], x_max_m=area[1], y_min_m=area[2], y_max_m=area[3])
    return SimConfig(
        objects=options.objects,
        objects_per_scene=options.objects_per_scene,
        # The RG2 opens wider than the smaller of the simulator's grippers.
        gripper=options.gripper if options.rg2 is None else "2f-140",
        workspace=workspace,
    )


def _camera(options: argparse.Namespace, mount: tuple[float, ...] | None) -> CameraSettings | None:
    if options.camera is None:
        return None
    address, port = _place(options.camera, CAMERA_PORT)
    camera = D435_ON_GRIPPER
    if mount is not None:
        camera = MountedCamera(
            intrinsics=camera.intrinsics,
            x_tool_camera_m=mount[0],
            y_tool_camera_m=mount[1],
            z_tool_camera_m=mount[2],
            turn_rad=(mount[3], mount[4], mount[5]),
        )
    noise = None
    if options.depth_noise > 0:
        noise = DepthNoise(subpixel_px=options.depth_noise, seed=options.seed)
    return CameraSettings(address=address, port=port, mount=camera, depth_noise=noise)


if __name__ == "__main__":
    sys.exit(main())
