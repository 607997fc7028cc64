"""``handsight view dataset``: attempts as cards in the Rerun viewer."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from handsight.cli.choosing import DrawnModel, Like, Reverse, Sort, Suspect, check_likeness, choice_faults
from handsight.cli.dataset.author import author_named
from handsight.cli.errors import CommandError
from handsight.cli.opening import check_out_file, checked_address, open_version
from handsight.cli.options import MOST_ATTEMPTS, Author, Dataset, Filter, Ids, Json, Where
from handsight.cli.output import bold, console, print_json
from handsight.cli.view.showing import Notebook, Port, Web
from handsight.datasets.errors import counted
from handsight.training.run_folder import check_finished_run

if TYPE_CHECKING:
    # Icechunk, PyTorch and Rerun take seconds; nothing is imported where there is no dataset.
    from handsight.datasets.reading.reader import GraspDataset
    from handsight.viz.browser.browser import Browser

MEGABYTE = 1_000_000
MOST_MEGABYTES = 1_000_000


def dataset_command(
    dataset: Dataset,
    attempts: Ids = None,
    *,
    where: Where = "",
    filter: Filter = "",
    suspect: Suspect = False,
    like: Like = "",
    sort: Sort = "",
    reverse: Reverse = False,
    limit: Annotated[
        int, typer.Option("--limit", "-n", min=0, max=MOST_ATTEMPTS, help="At most so many; 0 shows all.")
    ] = 0,
    model: DrawnModel = None,
    web: Web = False,
    notebook: Notebook = False,
    port: Port = 0,
    picture: Annotated[
        Path | None,
        typer.Option(
            "--picture", metavar="FILE.png", help="Draw the first cards into a file instead, without a screen."
        ),
    ] = None,
    cache_mb: Annotated[
        int,
        typer.Option("--cache-mb", min=1, max=MOST_MEGABYTES, help="How much thumbnails and recordings take on disk."),
    ] = 1000,
    author: Author = "",
    as_json: Json = False,
) -> None:
    """Browse attempts as cards in the Rerun viewer; a click on a card opens the attempt.

    The flag on a card excludes the attempt or takes it back in, and in the table beside the cards the label can be
    edited: both are decisions like those of 'dataset exclude' and 'dataset relabel', and 'dataset undo' reverts them.
    """
    checked_address(dataset)
    faults = choice_faults(attempts, where, filter, sort=sort, suspect=suspect, like=like)
    if len(ways := [name for name, given in _ways(picture, web=web, notebook=notebook).items() if given]) > 1:
        faults.append(f"{' and '.join(ways)} are given, expected one of them")
    if faults:
        raise CommandError("; ".join(faults))
    check_likeness(like, model)
    if model is not None:
        check_finished_run(model)
    if picture is not None:
        check_out_file(picture, ".png")
    elif not (web or notebook):
        from handsight.viz.browser.display import check_display

        check_display()
    opened = open_version(dataset)
    from handsight.cli.wiring.browsing import chosen_attempts, open_browser

    chosen = chosen_attempts(
        opened,
        attempts,
        where=where,
        filter=filter,
        suspect=suspect,
        like=like,
        model=model,
        sort=sort,
        reverse=reverse,
        limit=limit,
    )
    with open_browser(
        opened, chosen, name=dataset, model=model, author=author_named(author), limit_bytes=cache_mb * MEGABYTE
    ) as browser:
        if picture is not None:
            _draw(picture, browser, opened, len(chosen.ids), as_json=as_json)
        else:
            _serve(
                browser, opened, len(chosen.ids), page=web or notebook, notebook=notebook, port=port, as_json=as_json
            )


def _ways(picture: Path | None, *, web: bool, notebook: bool) -> dict[str, bool]:
    """The ways to look beside a window, and which of them are asked for."""
    return {"--picture": picture is not None, "--web": web, "--notebook": notebook}


def _draw(path: Path, browser: Browser, dataset: GraspDataset, count: int, *, as_json: bool) -> None:
    from handsight.viz.recordings.screenshot import save_address_picture

    save_address_picture(browser.address, path)
    _refuse_blank(browser)
    if as_json:
        print_json({"picture": path, "attempts": count, "snapshot": dataset.snapshot_id, "bytes": browser.bytes_kept})
    else:
        console.print(bold(path), f": the first cards of {counted(count, 'attempt')}")


def _refuse_blank(browser: Browser) -> None:
    """Say what was wrong where none of the recordings asked for could be made."""
    failures = browser.failures()
    if failures and not browser.bytes_kept:
        attempt, reason = failures[0]
        raise CommandError(f"no attempt could be shown; of the first, {attempt}: {reason}")


def _serve(
    browser: Browser,
    dataset: GraspDataset,
    count: int,
    *,
    page: bool,
    notebook: bool,
    port: int,
    as_json: bool,
) -> None:
    from handsight.cli.wiring.browsing import watch
    from handsight.viz.browser.notebook import cell_lines
    from handsight.viz.browser.viewer import native_viewer, web_viewer

    with web_viewer(browser.address, port=port) if page else native_viewer(browser.address) as viewer:
        cell = cell_lines(viewer.page) if notebook else ""
        if as_json:
            told = {"attempts": count, "snapshot": dataset.snapshot_id, "address": browser.address, "page": viewer.page}
            print_json({**told, "viewer_port": viewer.port, **({"cell": cell} if notebook else {})})
        else:
            console.print(f"{counted(count, 'attempt')} of ", bold(dataset.repository.path), f"@{dataset.ref}")
            if notebook:
                console.print("in a cell of a notebook on this machine; Ctrl-C ends it here:")
                console.print(cell)
            else:
                console.print("open ", bold(viewer.page or browser.address), "; Ctrl-C ends it")
        watch(browser, viewer.process, quiet=as_json)
