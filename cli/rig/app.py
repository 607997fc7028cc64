"""``handsight rig``: its commands, one file for each of them."""

from __future__ import annotations

from handsight.cli.lazy import LazyCommand, LazyGroup, lazy_app

COMMANDS = (
    LazyCommand(
        "check",
        "rig.check:check_command",
        "Look at each device, and try the cycle above the table.",
        ("handsight rig check --rig rig.toml", "handsight rig check --rig rig.toml --move --json"),
        kept="nothing was changed; an arm under way ends at its target",
    ),
    LazyCommand("calibrate", "rig.calibrate:calibrate_app", "Measure camera, table and jaws."),
    LazyCommand(
        "home",
        "rig.home:home_command",
        "Lift the tool and go to the overhead pose.",
        ("handsight rig home --rig rig.toml",),
        kept="the arm ends at the target of the move under way",
    ),
    LazyCommand(
        "emulate",
        "rig.emulate:emulate_command",
        "Stand in for the rig's devices, on loopback addresses.",
        (
            "handsight rig emulate --rig rig.toml",
            "handsight rig emulate --rig rig.toml --speed 10 --objects household-test --control 7000",
            "handsight rig emulate --rig rig.toml --fault protective-stop@descend --fault gripper-fault:code=14@close",
        ),
        kept="nothing was kept; the rig that it stood for is gone",
    ),
)


class RigGroup(LazyGroup):
    """Everything behind ``handsight rig``."""

    table = COMMANDS


rig_app = lazy_app(RigGroup, help="A UR10 rig: check, calibrate, home it, or emulate it.")
