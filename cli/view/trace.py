"""``handsight view trace``: a recorded servo run in the Rerun viewer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from handsight.cli.errors import CommandError
from handsight.cli.options import Json
from handsight.cli.view.showing import Picture, Port, Web, check_way_to_look, show_recording


def trace_command(
    recording: Annotated[
        Path, typer.Argument(metavar="FILE.rrd", help="As 'handsight servo' and 'handsight demo' write it.")
    ],
    web: Web = False,
    port: Port = 0,
    picture: Picture = None,
    step: Annotated[int, typer.Option("--step", min=0, max=10_000, help="Servo step of the picture.")] = 0,
    as_json: Json = False,
) -> None:
    """Look at a servo run step by step: what was seen, scored and chosen, and what came of it."""
    if not recording.is_file():
        raise CommandError(f"there is no recording at {str(recording)!r}, expected an .rrd file of 'handsight servo'")
    check_way_to_look(web=web, picture=picture)
    from handsight.viz.recordings.layouts import TIMELINE
    from handsight.viz.recordings.recorded_file import read_recorded_file
    from handsight.viz.recordings.servo_trace import KIND

    found = read_recorded_file(recording, kind=KIND, what="a servo trace")
    told: dict[str, object] = {"recording": recording, "name": found.name}
    show_recording(recording, told, timeline=TIMELINE, web=web, port=port, picture=picture, step=step, as_json=as_json)
