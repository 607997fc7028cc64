"""``handsight rig calibrate``: measure one thing of the rig, and keep it with its id, date and residuals."""

from __future__ import annotations

from pathlib import Path

from handsight.cli.lazy import LazyCommand, LazyGroup, lazy_app
from handsight.cli.opening import check_rig_file
from handsight.cli.options import Json, RigFile
from handsight.cli.output import bold, console, print_json


class CalibrateGroup(LazyGroup):
    """Everything behind ``handsight rig calibrate``."""

    table = (
        LazyCommand(
            "camera",
            "rig.calibrate:camera_command",
            "Where the camera sits, from views of a board.",
            ("handsight rig calibrate camera --rig rig.toml",),
            kept="the calibration before",
        ),
        LazyCommand(
            "table",
            "rig.calibrate:table_command",
            "Where the table is, by touching it.",
            ("handsight rig calibrate table --rig rig.toml",),
            kept="the calibration before",
        ),
        LazyCommand(
            "gripper",
            "rig.calibrate:gripper_command",
            "Where the jaws are open and closed.",
            ("handsight rig calibrate gripper --rig rig.toml",),
            kept="the calibration before",
        ),
        LazyCommand(
            "payload",
            "rig.calibrate:payload_command",
            "What hangs on the flange, by weighing it.",
            ("handsight rig calibrate payload --rig rig.toml",),
            kept="the calibration before",
        ),
        LazyCommand(
            "reach",
            "rig.calibrate:reach_command",
            "Which part of the workspace is reached.",
            ("handsight rig calibrate reach --rig rig.toml",),
            kept="the calibration before",
        ),
    )


calibrate_app = lazy_app(CalibrateGroup, help="Measure camera, table, jaws, payload and reach of the rig.")


def camera_command(rig: RigFile, as_json: Json = False) -> None:
    """Look at a ChArUco board from 14 sides, and solve for where the camera sits on the tool.

    Lay the board that [board] of rig.toml describes flat in the middle of the workspace, and take everything else away.
    """
    _calibrate(rig, "camera", as_json=as_json)


def table_command(rig: RigFile, as_json: Json = False) -> None:
    """Touch the table at five points with the closed jaws, slowly, and lay a plane through them.

    Clear the table first.
    """
    _calibrate(rig, "table", as_json=as_json)


def gripper_command(rig: RigFile, as_json: Json = False) -> None:
    """Open and close the empty jaws three times, and keep what they read. Take everything out of them first."""
    _calibrate(rig, "gripper", as_json=as_json)


def payload_command(rig: RigFile, as_json: Json = False) -> None:
    """Hold the empty tool still at seven tilts, and weigh what hangs on the flange: mass and centre of mass.

    Of an e-Series arm, which has a sensor; what a CB3 carries goes onto a scale and into rig.toml.
    """
    _calibrate(rig, "payload", as_json=as_json)


def reach_command(rig: RigFile, as_json: Json = False) -> None:
    """Ask arm and controller, cell by cell of 20 mm, which part of the workspace they allow. Nothing moves.

    Grasps are then drawn uniformly from that part.
    """
    _calibrate(rig, "reach", as_json=as_json)


def _calibrate(rig: Path, part: str, *, as_json: bool) -> None:
    check_rig_file(rig)
    from handsight.cli.wiring.rigs import calibrate, opened_rig

    config = opened_rig(rig)
    calibration = calibrate(config, part)
    values = calibration.to_json()
    if as_json:
        print_json(values)
        return
    measured = values["jaws" if part == "gripper" else part]
    console.print(bold(part), f": calibration {values['id']} in {config.calibration}")
    for name, value in measured.items():
        console.print(f"  {name} {value}")
