"""``handsight dataset folds``: how a version is divided for cross-validation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from handsight.cli.completion import complete_folds
from handsight.cli.dataset.author import author_named
from handsight.cli.opening import open_repository, open_version
from handsight.cli.options import Author, Dataset, DryRun, Json, Seed
from handsight.cli.output import console, print_json
from handsight.cli.tables import print_table

if TYPE_CHECKING:
    # These take a second to import; a command does so once its dataset is known to be there.
    from handsight.datasets.curation.folds import Folds
    from handsight.datasets.reading.reader import GraspDataset


def folds(
    dataset: Dataset,
    name: Annotated[
        str,
        typer.Argument(help="Folds to make or to check; without it, all are listed.", autocompletion=complete_folds),
    ] = "",
    by: Annotated[
        Literal["object", "scene", "session"] | None,
        typer.Option("--by", help="Make the folds: what is never split between two."),
    ] = None,
    count: Annotated[int, typer.Option("--count", "-k", max=1000, help="How many folds.")] = 5,
    seed: Seed = 0,
    replace: Annotated[bool, typer.Option("--replace", help="Make them anew under the same name.")] = False,
    author: Author = "",
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Make, check or list the folds that are stored in a version."""
    repository, ref = open_repository(dataset)
    from handsight.datasets.curation.folds import fold_names, make_folds, read_folds  # a second; see above

    made = None
    if name and by:
        made = make_folds(
            repository,
            name,
            by=by,
            count=count,
            seed=seed,
            author=author_named(author),
            branch=ref,
            replace=replace,
            dry_run=dry_run,
        )
    opened = open_version(dataset)
    if made is not None and dry_run:
        rows = _fold_rows(opened, made)
    else:
        names = [name] if name else fold_names(opened.root)
        rows = [row for one in names for row in _fold_rows(opened, read_folds(opened, one))]
    if as_json:
        print_json(rows)
        return
    cells = [
        (row.folds, row.by, str(row.fold), str(row.attempts), f"{row.successes / row.attempts:.1%}") for row in rows
    ]
    print_table(("folds", "by", "fold", "attempts", "successful"), cells)
    if made is not None and dry_run:
        console.print("nothing was stored")


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
