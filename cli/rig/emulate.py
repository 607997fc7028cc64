"""``handsight rig emulate``: the devices that rig.toml names, emulated until Ctrl-C."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import typer

from handsight.cli.opening import check_rig_file
from handsight.cli.options import TRAINING_OBJECTS, Json, Objects, PerScene, RigFile, Seed
from handsight.cli.output import bold, console, print_json


def emulate_command(
    rig: RigFile,
    objects: Objects = TRAINING_OBJECTS,
    per_scene: PerScene = None,
    empty: Annotated[
        bool, typer.Option("--empty", help="Nothing lies on the table: for calibrating table and jaws.")
    ] = False,
    board: Annotated[
        bool,
        typer.Option("--board", help="The calibration board of the rig's file lies in the middle of the workspace."),
    ] = False,
    speed: Annotated[
        float,
        typer.Option(
            min=0.01,
            max=1000,
            help="How many times faster than real time at most; contact that a client watches is shown in real time.",
        ),
    ] = 1.0,
    seed: Seed = 0,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[:KEY=VALUE][@WHEN]",
            help="What goes wrong, and when: slip@lift, freeze:s=5@z<0.1, ...; may be given several times.",
        ),
    ] = None,
    faults_per_hour: Annotated[
        float, typer.Option(min=0, max=3600, help="Faults at random, in an hour of the robot's clock.")
    ] = 0.0,
    depth_noise: Annotated[
        float, typer.Option(min=0.0, max=2.0, help="Noise of the disparity that depth is made of [px].")
    ] = 0.08,
    control: Annotated[
        int | None,
        typer.Option(min=1, max=65535, metavar="PORT", help="Port of the robot's address for faults and refills."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Stand in for the rig's devices: controller, gripper and camera over the simulator's physics.

    Whether a grasp holds is decided by physics. It runs until Ctrl-C; real client libraries connect to it as to a rig.
    """
    check_rig_file(rig)
    from handsight.cli.wiring.emulated_rigs import emulated_rig
    from handsight.collection.ur10.emulator.launch import run

    launch = emulated_rig(
        rig,
        objects=objects,
        per_scene=per_scene,
        empty=empty,
        board=board,
        speed=speed,
        seed=seed,
        faults=fault or (),
        faults_per_hour=faults_per_hour,
        depth_noise_px=depth_noise,
        control_port=control,
    )

    def announce(ready: Mapping[str, object]) -> None:
        if as_json:
            print_json(ready)
            return
        camera = f", camera on {ready['camera']}" if ready["camera"] else ""
        port = f", control port {control}" if control else ""
        console.print(bold(f"UR10 {ready['generation']}"), f" on {ready['robot']}{camera}{port}; Ctrl-C ends it")

    run(launch, announce)
