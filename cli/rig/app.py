"""``handsight rig``: its commands, one file for each of them."""

from __future__ import annotations

from handsight.cli.lazy import LazyCommand, LazyGroup, lazy_app

COMMANDS = (
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
