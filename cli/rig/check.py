"""``handsight rig check``: each device alone, and with ``--move`` the whole cycle above the table."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from handsight.cli.opening import check_rig_file
from handsight.cli.options import Json, RigFile
from handsight.cli.output import bold, console, print_json
from handsight.cli.tables import Column, print_table

if TYPE_CHECKING:
    from handsight.collection.ur10.checking import Finding


def check_command(
    rig: RigFile,
    move: Annotated[
        bool,
        typer.Option("--move", help="Then run one slow attempt that stays above the table, and record it."),
    ] = False,
    as_json: Json = False,
) -> None:
    """Look at controller, arm, gripper, camera and calibration, each alone; nothing moves without --move.

    The attempt of --move goes through every phase at a quarter of the speed and ends its descent 0.1 m above the table;
    it is kept in the dataset rig_check beside the rig's file.
    """
    check_rig_file(rig)
    from handsight.cli.wiring.rigs import dry_run, opened_rig
    from handsight.collection.ur10.checking import check_rig

    config = opened_rig(rig)
    findings = check_rig(config, rig.resolve().parent)
    sound = all(finding.ok for finding in findings if finding.device != "alarm")
    attempt = dry_run(config, rig.resolve().parent / "rig_check") if move and sound else None
    ok = sound and (attempt is None or not attempt["failure"])
    if as_json:
        print_json({"ok": ok, "findings": findings, "attempt": attempt})
    else:
        _print(findings, attempt, move=move)
    if not ok:
        raise typer.Exit(1)


def _print(findings: list[Finding], attempt: dict[str, Any] | None, *, move: bool) -> None:
    rows = [(one.device, one.what, "ok" if one.ok else "FAULT", one.found) for one in findings]
    print_table(("device", "what", "", Column(heading="found", prose="wrap")), rows)
    if attempt is not None:
        took = f"{attempt['robot_s']:.1f} s of robot time"
        console.print(bold("dry run"), f": {attempt['outcome']} after {took} {attempt['failure']}")
    elif move:
        console.print("nothing was moved: first mend what is at fault")
