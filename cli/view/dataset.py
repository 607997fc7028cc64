"""``handsight view dataset``: attempts as cards in the Rerun viewer."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from handsight.cli.completion import complete_attempt
from handsight.cli.dataset.author import author_named
from handsight.cli.errors import CommandError
from handsight.cli.opening import check_out_file, checked_address, open_version
from handsight.cli.options import MOST_ATTEMPTS, Author, Dataset, Filter, Ids, Json, Where
from handsight.cli.output import bold, console, print_json
from handsight.datasets.errors import counted
from handsight.training.run_folder import check_finished_run

if TYPE_CHECKING:
    # Icechunk, PyTorch and Rerun take seconds; nothing is imported where there is no dataset.
    from handsight.datasets.reading.reader import GraspDataset
    from handsight.viz.browser.browser import Browser

MEGABYTE = 1_000_000
MOST_MEGABYTES = 1_000_000
Port = Annotated[int, typer.Option("--port", min=0, max=65535, help="Port of the page with --web; 0 for any free one.")]


def dataset_command(
    dataset: Dataset,
    attempts: Ids = None,
    *,
    where: Where = "",
    filter: Filter = "",
    suspect: Annotated[
        bool, typer.Option("--suspect", help="Likely label issues first, as of 'dataset suspect', which takes minutes.")
    ] = False,
    like: Annotated[
        str,
        typer.Option(
            "--like",
            metavar="ATTEMPT",
            help="Those that look most like this one first.",
            autocompletion=complete_attempt,
        ),
    ] = "",
    sort: Annotated[str, typer.Option("--sort", metavar="COLUMN", help="Column to order by, smallest first.")] = "",
    reverse: Annotated[
        bool, typer.Option("--reverse", help="The largest first or, without --sort, the newest.")
    ] = False,
    limit: Annotated[
        int, typer.Option("--limit", "-n", min=0, max=MOST_ATTEMPTS, help="At most so many; 0 shows all.")
    ] = 0,
    model: Annotated[
        Path | None, typer.Option("--model", metavar="RUN", help="Draw what this network expects into attempts.")
    ] = None,
    web: Annotated[bool, typer.Option("--web", help="Serve a page to a web browser on this machine.")] = False,
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
    _check_options(attempts, where, filter, sort=sort, suspect=suspect, like=like, picture=picture, web=web)
    if like and model is None:
        raise CommandError("--like is given without a network that sees the likeness: add --model RUN")
    if model is not None:
        check_finished_run(model)
    if picture is not None:
        check_out_file(picture, ".png")
    elif not web:
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
            _serve(browser, opened, len(chosen.ids), web=web, port=port, as_json=as_json)


def _check_options(
    attempts: list[str] | None,
    where: str,
    filter: str,
    *,
    sort: str,
    suspect: bool,
    like: str,
    picture: Path | None,
    web: bool,
) -> None:
    faults = []
    if attempts and (where or filter or suspect or like or sort):
        faults.append("attempts are named and --where, --filter, --sort, --suspect or --like given, expected either")
    if suspect + bool(like) + bool(sort) > 1:
        faults.append("more than one of --suspect, --like and --sort is given, expected one order at most")
    if picture is not None and web:
        faults.append("--picture and --web are given, expected one of them")
    if faults:
        raise CommandError("; ".join(faults))


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


def _serve(browser: Browser, dataset: GraspDataset, count: int, *, web: bool, port: int, as_json: bool) -> None:
    from handsight.cli.wiring.browsing import watch
    from handsight.viz.browser.viewer import native_viewer, web_viewer

    with web_viewer(browser.address, port=port) if web else native_viewer(browser.address) as viewer:
        if as_json:
            told = {"attempts": count, "snapshot": dataset.snapshot_id, "address": browser.address, "page": viewer.page}
            print_json({**told, "viewer_port": viewer.port})
        else:
            console.print(f"{counted(count, 'attempt')} of ", bold(dataset.repository.path), f"@{dataset.ref}")
            console.print("open ", bold(viewer.page or browser.address), "; Ctrl-C ends it")
        watch(browser, viewer.process, quiet=as_json)
