"""How ``handsight view`` shows a recording: in a window, served to a browser of this machine, or drawn into a file."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from handsight.cli.errors import CommandError
from handsight.cli.opening import check_out_file
from handsight.cli.output import bold, console, print_json

Web = Annotated[bool, typer.Option("--web", help="Serve a page to a web browser on this machine.")]
Notebook = Annotated[
    bool,
    typer.Option("--notebook", help="As --web, and print the lines that show the page in a notebook of this machine."),
]
Port = Annotated[int, typer.Option("--port", min=0, max=65535, help="Port of the page with --web; 0 for any free one.")]
Picture = Annotated[
    Path | None,
    typer.Option("--picture", metavar="FILE.png", help="Draw it into a file instead, without a screen."),
]


def check_way_to_look(*, web: bool, picture: Path | None) -> None:
    """Refuse what cannot be shown, before there is anything to show.

    Raises:
        CommandError: Two ways are asked for, or the file cannot be written.
        ViewerError: There is no display for a window.
    """
    if web and picture is not None:
        raise CommandError("--web and --picture are two ways to look, expected one of them")
    if picture is not None:
        check_out_file(picture, ".png")
    elif not web:
        from handsight.viz.browser.display import check_display

        check_display("pass --web to look with a web browser, or --picture FILE.png to have it drawn")


def show_recording(
    recording: Path,
    told: dict[str, object],
    *,
    timeline: str,
    web: bool,
    port: int,
    picture: Path | None,
    step: int = 0,
    as_json: bool,
) -> None:
    """Show a recording until its window is closed, or until Ctrl-C.

    Args:
        recording: The file.
        told: What there is to say of it with ``--json``.
        timeline: On which ``step`` counts.
        web: Whether a page is served, at ``port`` or any free one.
        port: Of the page.
        picture: Where it is drawn instead; None to show it.
        step: Of the picture.
        as_json: Whether a JSON value is printed instead of text.

    Raises:
        ViewerError: The viewer did not start.
        ScreenshotError: It gave no picture.
    """
    if picture is not None:
        from handsight.viz.recordings.screenshot import save_screenshots

        save_screenshots(recording, {step: picture}, timeline=timeline)
        if as_json:
            print_json({**told, "picture": picture})
        else:
            console.print(bold(picture), f": the viewer at {step}")
        return
    from handsight.viz.browser.viewer import native_viewer, web_viewer

    address = str(recording.resolve())
    with web_viewer(address, port=port) if web else native_viewer(address) as viewer:
        if as_json:
            print_json({**told, "page": viewer.page, "viewer_port": viewer.port})
        else:
            console.print("open ", bold(viewer.page or "the viewer's window"), "; close it or press Ctrl-C to end")
        with suppress(KeyboardInterrupt):
            viewer.process.wait()
