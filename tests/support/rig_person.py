"""What a person at the emulated rig does, and what one who looks on would see."""

from __future__ import annotations

from collections.abc import Sequence

from tests.support.emulated_rig import RunningRig

from handsight.collection.ur10.dashboard import Dashboard
from handsight.collection.ur10.rig import WorkspaceConfig

SLACK_M = 0.005
POWER_CYCLE = """
import json, socket, sys, time
with socket.create_connection((sys.argv[1], int(sys.argv[2])), timeout=10) as c:
    c.sendall(json.dumps({"do": "camera-power-cycle"}).encode() + b"\\n")
    c.makefile().readline()
time.sleep(1)
"""
"""Program that switches the camera's port off and on, by the addresses of the rig and of its control port."""


def repair(rig: RunningRig) -> None:
    """What a person does at the cell: after that everything can go on."""
    rig.do("clear")
    rig.do("release")
    with Dashboard(rig.robot) as dashboard:
        if dashboard.safety() in ("FAULT", "VIOLATION"):
            dashboard.ask("restart safety")
    # What fell off the table, and what a fault of before has left in the jaws.
    rig.do("refill")


def stayed_inside(area: WorkspaceConfig, travelled_m: Sequence[Sequence[float]]) -> bool:
    """Whether the fingertips never left the workspace and its margin, nor touched the table."""
    beside_m = area.margin_m + SLACK_M
    least = (area.x_min_m - beside_m, area.y_min_m - beside_m, 0.0)
    most = (area.x_max_m + beside_m, area.y_max_m + beside_m, area.overhead_height_m + beside_m)
    low, high = travelled_m
    return all(a <= b for a, b in zip((*least, *high), (*low, *most), strict=True))
