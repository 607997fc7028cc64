"""``handsight report``: one HTML file that tells of a dataset, a run, a sweep, or a folder with all of these."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from handsight.cli.completion import complete_version
from handsight.cli.errors import CommandError
from handsight.cli.opening import check_out_file, checked_address
from handsight.cli.options import Json
from handsight.cli.output import bold, console, print_json
from handsight.datasets.address import looks_like_dataset
from handsight.training.run_folder import RUN_RECORD

MOST_REPLAYS = 12
SUFFIXES = (".html", ".htm")


def report_command(
    what: Annotated[
        str,
        typer.Argument(
            metavar="DIR|DATASET|RUN",
            help="A folder as 'handsight demo' leaves it, a dataset as PATH[@REF], a run, or the folder of a sweep.",
            autocompletion=complete_version,
        ),
    ],
    out: Annotated[Path, typer.Option("--out", metavar="FILE.html", help="The page to write.")] = Path("report.html"),
    replays: Annotated[
        int,
        typer.Option(
            "--replays",
            min=0,
            max=MOST_REPLAYS,
            help="Failed trials that are simulated again for their pictures; 0 for none.",
        ),
    ] = 6,
    as_json: Json = False,
) -> None:
    """Write one HTML page that tells everything about a dataset, a run, a sweep, or a folder with all of these.

    The page holds its pictures, fetches nothing, and names the command behind every figure. What is unchanged gives the
    same page, byte by byte.
    """
    check_out_file(out, *SUFFIXES)
    _check_subject(what)
    from handsight.cli.wiring.reports import ReportSettings, report_on  # seconds; what is not there is refused before
    from handsight.viz.report.html import sections_of, write_report

    report = report_on(what, ReportSettings(replays=replays), out=out)
    size = write_report(report, out)
    titles = [section.title for section in report.sections]
    if as_json:
        print_json({"report": out, "bytes": size, "sections": [one.title for one in sections_of(report)]})
        return
    console.print(bold(out), f": {', '.join(titles)}; {size / 1e6:.1f} MB, to be opened in any web browser")


def _check_subject(what: str) -> None:
    """Refuse what is neither a folder nor the address of a dataset, before anything is imported.

    Raises:
        CommandError: A file is there.
        DatasetError: Nothing is there, or no dataset where one has to be.
    """
    folder = Path(what)
    if folder.is_file():
        raise CommandError(f"{what} is a file, expected a folder, a dataset or a run to report on")
    if folder.is_dir() and (not looks_like_dataset(folder) or (folder / RUN_RECORD).is_file()):
        return
    checked_address(what)
