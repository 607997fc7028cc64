"""``handsight review``: attempts one by one in the viewer, decided by single keys in the terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from handsight.cli.choosing import DrawnModel, Like, Reverse, Sort, Suspect, check_likeness, choice_faults
from handsight.cli.dataset.author import author_named
from handsight.cli.errors import CommandError
from handsight.cli.opening import checked_address, open_version
from handsight.cli.options import MOST_ATTEMPTS, Author, DatasetBranch, Filter, Ids, Json, Where
from handsight.cli.output import bold, console, errors, print_json
from handsight.datasets.errors import counted, pasteable
from handsight.training.run_folder import check_finished_run

if TYPE_CHECKING:
    # Icechunk, PyTorch and Rerun take seconds; nothing is imported where there is no dataset.
    from handsight.cli.wiring.browsing import Chosen
    from handsight.datasets.curation.review import Review, Verdict
    from handsight.viz.browser.browser import Browser
    from handsight.viz.browser.viewer import OpenViewer

KEYS: dict[str, Verdict] = {
    "k": "keep",
    "x": "exclude",
    "r": "restore",
    "s": "success",
    "f": "failure",
    "o": "recorded",
    "u": "undo",
    "n": "next",
    "b": "back",
}
QUIT = "q"
HELP = "k keep  x exclude  r restore  s success  f failure  o label as recorded  u undo  n next  b back  q quit"


def review_command(
    dataset: DatasetBranch,
    attempts: Ids = None,
    *,
    where: Where = "",
    filter: Filter = "",
    suspect: Suspect = False,
    like: Like = "",
    sort: Sort = "",
    reverse: Reverse = False,
    limit: Annotated[
        int, typer.Option("--limit", "-n", min=0, max=MOST_ATTEMPTS, help="At most so many; 0 goes through all.")
    ] = 0,
    model: DrawnModel = None,
    viewer: Annotated[
        bool, typer.Option("--viewer/--no-viewer", help="Whether a window shows each attempt as it comes up.")
    ] = True,
    reason: Annotated[str, typer.Option("--reason", "-m", help="Why; kept with every decision.")] = "reviewed",
    author: Author = "",
    as_json: Json = False,
) -> None:
    """Go through attempts one by one: the viewer shows each, and a key in the terminal decides.

    Keys: k keep, x exclude, r restore, s success, f failure, o label as recorded, u undo, n next, b back, q quit. Every
    decision is committed at once and can be undone, here or with 'dataset undo'. Keys may be piped in.
    """
    checked_address(dataset)
    if faults := choice_faults(attempts, where, filter, sort=sort, suspect=suspect, like=like):
        raise CommandError("; ".join(faults))
    if model is not None:
        check_finished_run(model)
    check_likeness(like, model)
    if viewer:
        from handsight.viz.browser.display import check_display

        check_display("pass --no-viewer to go by what is printed")
    opened = open_version(dataset)
    from handsight.cli.wiring.browsing import chosen_attempts, curator_of
    from handsight.datasets.curation.review import Review

    curator = curator_of(opened, author_named(author))
    if curator is None:
        raise CommandError(f"{dataset} is a release or a snapshot, which does not change: name a branch")
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
    review = Review(curator, chosen.ids, reason=reason)
    with _viewer_of(dataset, review, chosen, model) if viewer else nullcontext((None, None)) as (browser, window):
        _walk(review, chosen, browser, window, quiet=as_json)
    _summarise(review, dataset, as_json=as_json)


@contextmanager
def _viewer_of(
    dataset: str, review: Review, chosen: Chosen, model: Path | None
) -> Iterator[tuple[Browser, OpenViewer]]:
    from handsight.cli.wiring.browsing import open_browser
    from handsight.viz.browser.viewer import native_viewer

    version = review.dataset()
    browsing = open_browser(version, chosen, name=dataset, model=model, author="")
    with browsing as browser, native_viewer(browser.address) as window:
        yield browser, window


def _walk(review: Review, chosen: Chosen, browser: Browser | None, window: OpenViewer | None, *, quiet: bool) -> None:
    from handsight.datasets.errors import CurationError

    if not quiet:
        console.print(HELP)
    keys = _keys()
    version = review.dataset()
    while (attempt := review.attempt) is not None:
        if browser is not None and window is not None:
            browser.follow()
            window.show(browser.attempt_address(attempt))
        if not quiet:
            console.print(*_facts(review, version, chosen, attempt))
        verdict = next(keys, None)
        if verdict is None:
            return
        try:
            reviewed = review.say(verdict)
        except CurationError as error:
            errors.print(str(error))
            continue
        if reviewed.decision is not None:
            version = review.dataset()
        if not quiet:
            said = "nothing changes" if reviewed.decision is None else f"decision {reviewed.decision.number}"
            console.print(f"  {verdict}: {said}")


def _keys() -> Iterator[Verdict]:
    """Verdicts as they are typed or piped in; ends with the key that quits or with the input."""
    import click

    while True:
        key = click.getchar() if sys.stdin.isatty() else sys.stdin.read(1)
        if not key or key in (QUIT, "\x04"):
            return
        if key == "\x03":
            raise KeyboardInterrupt
        if key.isspace():
            continue
        if key.lower() in KEYS:
            yield KEYS[key.lower()]
        else:
            errors.print(f"key {key!r} means nothing here; {HELP}")


def _facts(review: Review, version: Any, chosen: Chosen, attempt: str) -> list[Any]:
    """One line about the attempt that is looked at."""
    from handsight.viz.browser.rows import browser_rows

    row = browser_rows(version, [attempt])[attempt]
    parts = [f"label {row.label}", f"opening {1e3 * row.width_final_m:.1f} mm"]
    predicted = chosen.seen.predicted.get(attempt)
    if predicted is not None:
        parts.append(f"S {predicted:.2f}")
    parts += chosen.seen.findings.get(attempt, ())
    if row.curation:
        parts.append(row.curation)
    return [f"{review.position + 1} of {len(chosen.ids)}  ", bold(row.title), f"  {', '.join(parts)}"]


def _summarise(review: Review, dataset: str, *, as_json: bool) -> None:
    decisions = review.decisions
    if as_json:
        told = [
            {"decision": one.number, "action": one.action.name.lower(), "value": one.value, "attempts": one.attempts}
            for one in decisions
        ]
        print_json({"looked_at": review.looked_at, "decisions": told})
        return
    console.print(f"{counted(review.looked_at, 'attempt')} looked at, {counted(len(decisions), 'decision')} taken")
    if decisions:
        console.print(f"take back the last one with {pasteable('handsight', 'dataset', 'undo', dataset)}")
