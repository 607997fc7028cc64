"""``handsight rig home``: out of wherever the arm stands, to the overhead pose."""

from __future__ import annotations

from handsight.cli.opening import check_rig_file
from handsight.cli.options import Json, RigFile
from handsight.cli.output import bold, console, print_json


def home_command(rig: RigFile, as_json: Json = False) -> None:
    """Lift the tool straight up, slowly, then go to the overhead pose; a protective stop is cleared on the way.

    An emergency or safeguard stop is not: clear it at the cell.
    """
    check_rig_file(rig)
    from handsight.cli.wiring.rigs import go_home, opened_rig

    pose = go_home(opened_rig(rig))
    if as_json:
        print_json({"pose_base_tool": pose})
    else:
        x_m, y_m, z_m = (round(float(value), 3) + 0.0 for value in pose[:3, 3])  # Without a minus before zero.
        console.print(bold("home"), f": the fingertips are at ({x_m:.3f}, {y_m:.3f}, {z_m:.3f}) m over the table")
