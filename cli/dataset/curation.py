"""``handsight dataset exclude|restore|relabel|undo|decisions|filter|folds``: what a curator decides."""

from __future__ import annotations

import getpass
from dataclasses import dataclass
from typing import Annotated

import typer

from handsight.cli.options import Dataset, Json, Seed
from handsight.cli.output import console, print_json, print_table
from handsight.datasets.address import DatasetAddress
from handsight.datasets.curation.curator import Curator
from handsight.datasets.curation.folds import Folds, Grouping, fold_names, make_folds, read_folds
from handsight.datasets.curation.saved_filters import forget_filter, save_filter
from handsight.datasets.errors import counted
from handsight.datasets.format.decisions import Decision
from handsight.datasets.format.saved_filters import read_filters
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.reading.selection import Selection, matches
from handsight.datasets.store.repository import GraspRepository

Branch = Annotated[str, typer.Argument(metavar="DATASET[@BRANCH]", help="Dataset folder, optionally at a branch.")]
Ids = Annotated[list[str] | None, typer.Argument(metavar="[ID]...", help="Attempts, as printed by ls.")]
Where = Annotated[
    str, typer.Option("--where", metavar="EXPRESSION", help="Attempts for which this holds: \"target == 'cup'\".")
]
Filter = Annotated[str, typer.Option("--filter", metavar="NAME", help="Attempts of a saved filter.")]
Reason = Annotated[str, typer.Option("--reason", "-m", help="Why; kept with the decision.")]
Author = Annotated[
    str, typer.Option("--author", envvar="HANDSIGHT_AUTHOR", help="Who decides.", show_default="the user's name")
]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Say what would be done, and do nothing.")]


def register(app: typer.Typer) -> None:
    """Add the commands to ``handsight dataset``."""
    app.command("exclude")(exclude)
    app.command("restore")(restore)
    app.command("relabel")(relabel)
    app.command("undo")(undo)
    app.command("decisions")(decisions)
    app.command("filter")(filter_command)
    app.command("folds")(folds)


def exclude(
    dataset: Branch,
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
    decided = _curator(dataset, author).exclude(_selection(ids, where, filter), reason, dry_run=dry_run)
    _report("excluded", decided, dry_run=dry_run, as_json=as_json)


def restore(
    dataset: Branch,
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
    decided = _curator(dataset, author).restore(_selection(ids, where, filter), reason, dry_run=dry_run)
    _report("restored", decided, dry_run=dry_run, as_json=as_json)


def relabel(
    dataset: Branch,
    ids: Ids = None,
    *,
    label: Annotated[
        str, typer.Option("--to", metavar="success|failure|recorded", help="The label; 'recorded' goes back to it.")
    ],
    reason: Reason,
    where: Where = "",
    filter: Filter = "",
    author: Author = "",
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Correct labels; the recorded ones are kept."""
    if label not in ("success", "failure", "recorded"):
        raise typer.BadParameter(f"the label is {label!r}, expected success, failure or recorded", param_hint="--to")
    curator, which = _curator(dataset, author), _selection(ids, where, filter)
    if label == "recorded":
        decided = curator.unlabel(which, reason, dry_run=dry_run)
    else:
        decided = curator.relabel(which, label == "success", reason, dry_run=dry_run)
    _report("relabelled", decided, dry_run=dry_run, as_json=as_json)


def undo(
    dataset: Branch,
    number: Annotated[int | None, typer.Argument(help="Decision to undo; the latest unless given.")] = None,
    *,
    reason: Reason = "undone",
    author: Author = "",
    as_json: Json = False,
) -> None:
    """Revert a curation decision; undoing the undo brings it back."""
    decided = _curator(dataset, author).undo(number, reason)
    if as_json:
        print_json(_decision_json(decided, counts=True))
    else:
        console.print(f"decision {decided.value} is reverted (undone by decision {decided.number})")


def decisions(dataset: Dataset, as_json: Json = False) -> None:
    """List the decisions of curation, oldest first."""
    overlay = GraspDataset.open(dataset).overlay
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
    print_table(("decision", "decided (UTC)", "what", "attempts", "author", "reason"), rows)


def filter_command(
    dataset: Dataset,
    name: Annotated[str, typer.Argument(help="Filter to save or to delete; without it, all are listed.")] = "",
    where: Where = "",
    delete: Annotated[bool, typer.Option("--delete", help="Forget the filter.")] = False,
    replace: Annotated[bool, typer.Option("--replace", help="Give an existing filter another expression.")] = False,
    author: Author = "",
    as_json: Json = False,
) -> None:
    """Save, list or forget named --where expressions."""
    address = DatasetAddress.parse(dataset)
    repository = GraspRepository.open(address.path)
    if name and delete:
        forget_filter(repository, name, branch=address.ref)
        console.print(f"forgot filter [bold]{name}[/]")
    elif name and where:
        found = save_filter(repository, name, where, author=_author(author), branch=address.ref, replace=replace)
        console.print(f"saved filter [bold]{name}[/]: {counted(found, 'attempt')} matching now")
    elif name:
        raise typer.BadParameter("give the filter an expression, or --delete it", param_hint="--where")
    else:
        _list_views(GraspDataset.open(address), as_json=as_json)


def folds(
    dataset: Dataset,
    name: Annotated[str, typer.Argument(help="Folds to make or to check; without it, all are listed.")] = "",
    by: Annotated[
        Grouping | None, typer.Option("--by", help="Make the folds: what is never split between two.")
    ] = None,
    count: Annotated[int, typer.Option("--count", "-k", help="How many folds.")] = 5,
    seed: Seed = 0,
    replace: Annotated[bool, typer.Option("--replace", help="Make them anew under the same name.")] = False,
    author: Author = "",
    as_json: Json = False,
) -> None:
    """Make, check or list the folds that are stored in a version."""
    address = DatasetAddress.parse(dataset)
    repository = GraspRepository.open(address.path)
    if name and by:
        make_folds(
            repository, name, by=by, count=count, seed=seed, author=_author(author), branch=address.ref, replace=replace
        )
    opened = GraspDataset.open(address)
    names = [name] if name else fold_names(opened.root)
    rows = [row for one in names for row in _fold_rows(opened, read_folds(opened, one))]
    if as_json:
        print_json(rows)
        return
    cells = [
        (row.folds, row.by, str(row.fold), str(row.attempts), f"{row.successes / row.attempts:.1%}") for row in rows
    ]
    print_table(("folds", "by", "fold", "attempts", "successful"), cells)


@dataclass(frozen=True, slots=True, kw_only=True)
class _FoldRow:
    folds: str
    by: str
    fold: int
    attempts: int
    successes: int


def _fold_rows(dataset: GraspDataset, folds: Folds) -> list[_FoldRow]:
    success = dataset.attempts["success"][folds.fold.index].astype(bool)
    rows = []
    for fold in range(folds.count):
        labels = success[folds.fold == fold]
        rows.append(
            _FoldRow(folds=folds.name, by=folds.by, fold=fold, attempts=len(labels), successes=int(labels.sum()))
        )
    return rows


def _list_views(dataset: GraspDataset, *, as_json: bool) -> None:
    filters = read_filters(dataset.root)
    counts = {name: int(matches(dataset.attempts, where).sum()) for name, where in filters.items()}
    if as_json:
        print_json([{"filter": name, "where": where, "attempts": counts[name]} for name, where in filters.items()])
    else:
        print_table(
            ("filter", "where", "attempts"), [(name, where, str(counts[name])) for name, where in filters.items()]
        )


def _curator(dataset: str, author: str) -> Curator:
    address = DatasetAddress.parse(dataset)
    return Curator(GraspRepository.open(address.path), author=_author(author), branch=address.ref)


def _author(author: str) -> str:
    return author or getpass.getuser()


def _selection(ids: list[str] | None, where: str, filter: str) -> Selection:
    return Selection(ids=tuple(ids or ()), where=where, filter=filter)


def _report(verb: str, decided: Decision | None, *, dry_run: bool, as_json: bool) -> None:
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
        console.print(f"take it back with 'handsight dataset undo DATASET {decided.number}'")


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
