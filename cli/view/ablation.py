"""``handsight view ablation``: the page of a sweep, with figure 7."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from handsight.cli.errors import CommandError
from handsight.cli.opening import check_out_file
from handsight.cli.options import Json
from handsight.cli.output import bold, console, print_json

SUFFIXES = (".html", ".htm")


def ablation_command(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a sweep.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE.html", help="The page to write; unless given, report.html in the folder."),
    ] = None,
    show: Annotated[
        bool, typer.Option("--open/--no-open", help="Open the page in the web browser of this machine.")
    ] = True,
    as_json: Json = False,
) -> None:
    """Write the page of a sweep and open it: figure 7, its numbers, differences trial by trial, the worst objects."""
    _check_sweep(folder)
    page = folder / "report.html" if out is None else out
    check_out_file(page, *SUFFIXES)
    from handsight.cli.wiring.reports import ReportSettings, report_on  # seconds; what is not there is refused before
    from handsight.viz.report.html import write_report

    size = write_report(report_on(str(folder), ReportSettings(replays=0), out=page), page)
    # A machine without a browser, or without a screen, has the page all the same.
    opened = show and webbrowser.open(page.absolute().as_uri())
    if as_json:
        print_json({"report": page, "bytes": size, "opened": opened})
    elif opened:
        console.print(bold(page), ": opened in the web browser")
    else:
        console.print(bold(page), ": to be opened in any web browser")


def _check_sweep(folder: Path) -> None:
    if not (folder / "plan.json").is_file():
        what = "holds no sweep" if folder.is_dir() else "is no folder"
        raise CommandError(
            f"{folder} {what} (plan.json is missing), expected the folder of one: see 'handsight ablate --help'"
        )
