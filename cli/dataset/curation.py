"""``handsight dataset exclude|restore|relabel|undo|decisions|filter``: what a curator decides."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from handsight.cli.completion import complete_filter, words
from handsight.cli.dataset.author import author_named
from handsight.cli.opening import open_repository, open_version
from handsight.cli.options import Author, Dataset, DatasetBranch, DryRun, Filter, Ids, Json, Reason, Where
from handsight.cli.output import bold, console, print_json
from handsight.cli.tables import Column, print_table, short_time
from handsight.datasets.errors import counted, pasteable

if TYPE_CHECKING:
    # These take a second to import; a command does so once its dataset is known to be there.
    from handsight.datasets.curation.curator import Curator
    from handsight.datasets.format.decisions import Decision
    from handsight.datasets.reading.reader import GraspDataset
    from handsight.datasets.reading.selection import Selection


_LABELS = ("success", "failure", "recorded")


def exclude(
    dataset: DatasetBranch,
    ids: Ids = None,
    *,
    reason: Reason,
    where: Where = "",
    filter: Filter = "",
    author: Author = "",
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Keep attempts out of training; nothing is deleted, and 'restore' or 'undo' takes them back."""
    curator, which = _curator(dataset, author), _selection(dataset, ids, where, filter)
    decided = curator.exclude(which, reason, dry_run=dry_run)
    _report("excluded", decided, dataset, dry_run=dry_run, as_json=as_json)


def restore(
    dataset: DatasetBranch,
    ids: Ids = None,
    *,
    reason: Reason,
    where: Where = "",
    filter: Filter = "",
    author: Author = "",
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Take excluded attempts back in."""
    curator, which = _curator(dataset, author), _selection(dataset, ids, where, filter)
    decided = curator.restore(which, reason, dry_run=dry_run)
    _report("restored", decided, dataset, dry_run=dry_run, as_json=as_json)


def relabel(
    dataset: DatasetBranch,
    ids: Ids = None,
    *,
    label: Annotated[
        str,
        typer.Option(
            "--to",
            metavar="success|failure|recorded",
            help="The label; 'recorded' goes back to it.",
            autocompletion=words(*_LABELS),
        ),
    ],
    reason: Reason,
    where: Where = "",
    filter: Filter = "",
    author: Author = "",
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Correct labels; the recorded ones are kept."""
    if label not in _LABELS:
        raise typer.BadParameter(f"the label is {label!r}, expected success, failure or recorded", param_hint="--to")
    curator, which = _curator(dataset, author), _selection(dataset, ids, where, filter)
    if label == "recorded":
        decided = curator.unlabel(which, reason, dry_run=dry_run)
    else:
        decided = curator.relabel(which, label == "success", reason, dry_run=dry_run)
    _report("relabelled", decided, dataset, dry_run=dry_run, as_json=as_json)


def undo(
    dataset: DatasetBranch,
    number: Annotated[
        int | None, typer.Argument(min=0, max=2**31, help="Decision to undo; the latest unless given.")
    ] = None,
    *,
    reason: Reason = "undone",
    author: Author = "",
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Revert a curation decision, the latest unless one is named; undoing the undo brings it back."""
    decided = _curator(dataset, author).undo(number, reason, dry_run=dry_run)
    if as_json:
        print_json({**_decision_json(decided, counts=True), **({"decision": None} if dry_run else {})})
    elif dry_run:
        console.print(f"would have reverted decision {decided.value}")
    else:
        console.print(f"decision {decided.value} is reverted (undone by decision {decided.number})")


def decisions(dataset: Dataset, as_json: Json = False) -> None:
    """List the decisions of curation, oldest first."""
    overlay = open_version(dataset).overlay
    if as_json:
        print_json([_decision_json(one, counts=one.number not in overlay.undone) for one in overlay.decisions])
        return
    rows = [
        (
            str(one.number),
            f"{one.decided:%Y-%m-%d %H:%M:%S}",
            _what(one) + (" (undone)" if one.number in overlay.undone else ""),
            str(len(one.attempts)),
            one.author,
            one.reason,
        )
        for one in overlay.decisions
    ]
    columns = (
        "decision",
        Column(heading="decided (UTC)", rank=3, short=short_time),
        "what",
        Column(heading="attempts", rank=1),
        Column(heading="author", rank=2),
        Column(heading="reason", prose="wrap"),
    )
    print_table(columns, rows)


def filter_command(
    dataset: Dataset,
    name: Annotated[
        str,
        typer.Argument(help="Filter to save or to delete; without it, all are listed.", autocompletion=complete_filter),
    ] = "",
    where: Where = "",
    delete: Annotated[bool, typer.Option("--delete", help="Forget the filter.")] = False,
    replace: Annotated[bool, typer.Option("--replace", help="Give an existing filter another expression.")] = False,
    author: Author = "",
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Save, list or forget named --where expressions."""
    repository, ref = open_repository(dataset)
    from handsight.datasets.curation.saved_filters import forget_filter, save_filter  # a second; see above

    would = "would have " if dry_run else ""
    if name and delete:
        forget_filter(repository, name, branch=ref, dry_run=dry_run)
        if as_json:
            print_json({"filter": name, "deleted": not dry_run})
        else:
            console.print(f"{would}{'forgotten' if dry_run else 'forgot'} filter ", bold(name))
    elif name and where:
        found = save_filter(
            repository, name, where, author=author_named(author), branch=ref, replace=replace, dry_run=dry_run
        )
        if as_json:
            print_json({"filter": name, "where": where, "attempts": found})
        else:
            console.print(f"{would}saved filter ", bold(name), f": matches {counted(found, 'attempt')} now")
    elif name:
        raise typer.BadParameter("give the filter an expression, or --delete it", param_hint="--where")
    else:
        _list_filters(open_version(dataset), as_json=as_json)


def _list_filters(dataset: GraspDataset, *, as_json: bool) -> None:
    from handsight.datasets.format.saved_filters import read_filters  # a second; see above
    from handsight.datasets.reading.selection import matches

    filters = read_filters(dataset.root)
    counts = {name: int(matches(dataset.attempts, where).sum()) for name, where in filters.items()}
    if as_json:
        print_json([{"filter": name, "where": where, "attempts": counts[name]} for name, where in filters.items()])
    else:
        print_table(
            ("filter", "attempts", Column(heading="where", prose="wrap")),
            [(name, str(counts[name]), where) for name, where in filters.items()],
        )


def _curator(dataset: str, author: str) -> Curator:
    repository, branch = open_repository(dataset)
    from handsight.datasets.curation.curator import Curator  # a second; see above

    return Curator(repository, author=author_named(author), branch=branch)


def _selection(dataset: str, ids: list[str] | None, where: str, filter: str) -> Selection:
    """The attempts meant, ids written out."""
    version = open_version(dataset) if ids else None
    from handsight.datasets.reading.attempt_ids import resolve_attempt_ids  # a second; see above
    from handsight.datasets.reading.selection import Selection

    whole = () if version is None else resolve_attempt_ids(version, ids or ())
    return Selection(ids=tuple(whole), where=where, filter=filter)


def _report(verb: str, decided: Decision | None, dataset: str, *, dry_run: bool, as_json: bool) -> None:
    attempts = () if decided is None else decided.attempts
    if as_json:
        print_json({"attempts": attempts, "decision": None if decided is None or dry_run else decided.number})
        return
    if not attempts:
        console.print("nothing to do: no attempt would change")
        return
    would = "would have " if dry_run else ""
    console.print(f"{would}{verb} {counted(len(attempts), 'attempt')}")
    if decided is not None and not dry_run:
        console.print(f"take it back with {pasteable('handsight', 'dataset', 'undo', dataset, decided.number)}")


def _what(decision: Decision) -> str:
    name = decision.action.name.lower()
    if decision.value is None:
        return name
    return f"undo {decision.value}" if name == "undo" else f"{name} {'success' if decision.value else 'failure'}"


def _decision_json(decision: Decision, *, counts: bool) -> dict[str, object]:
    return {
        "decision": decision.number,
        "action": decision.action.name.lower(),
        "value": decision.value,
        "reason": decision.reason,
        "author": decision.author,
        "decided": decision.decided,
        "counts": counts,
        "attempts": decision.attempts,
    }
