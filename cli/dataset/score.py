"""``handsight dataset score``: what a network expects of recorded grasps, as columns to sort and filter by."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from handsight.cli.completion import complete_folds
from handsight.cli.dataset.author import author_named
from handsight.cli.errors import CommandError
from handsight.cli.opening import checked_address, open_repository, open_version
from handsight.cli.options import MOST_EPOCHS, Author, DatasetBranch, DryRun, Json
from handsight.cli.output import bold, console, print_json
from handsight.cli.tables import Column, print_table
from handsight.datasets.errors import counted, pasteable
from handsight.training.run_folder import check_finished_run

if TYPE_CHECKING:
    # These take a second to import; a command does so once its dataset is known to be there.
    from handsight.datasets.reading.reader import GraspDataset


def score(
    dataset: DatasetBranch,
    name: Annotated[
        str, typer.Argument(help="Name of the scores, of which columns are made; without it, all are listed.")
    ] = "",
    *,
    model: Annotated[
        Path | None, typer.Option("--model", metavar="RUN", help="Score by this network, whatever it was trained on.")
    ] = None,
    folds: Annotated[
        str,
        typer.Option(
            "--folds",
            metavar="NAME",
            help="Score by networks that never saw what they score: one is trained for each of these folds.",
            autocompletion=complete_folds,
        ),
    ] = "",
    epochs: Annotated[
        int, typer.Option(min=1, max=MOST_EPOCHS, help="Passes over the data for each network of --folds.")
    ] = 10,
    delete: Annotated[bool, typer.Option("--delete", help="Forget the scores.")] = False,
    replace: Annotated[bool, typer.Option("--replace", help="Replace scores of that name.")] = False,
    author: Author = "",
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Write back what a network expects of the attempts: columns score_NAME, and error_NAME, its distance to the label.

    'dataset ls', 'view dataset' and --where know the columns like any other, so that the next collection can be aimed
    at what the network gets wrong. Nothing recorded changes; a branch moves by one commit.
    """
    checked_address(dataset)
    if model is not None:
        check_finished_run(model)
    faults = _faults(name, ways=(model is not None) + bool(folds) + delete, replace=replace)
    if faults:
        raise CommandError("; ".join(faults))
    if not name:
        _list_scores(open_version(dataset), as_json=as_json)
        return
    repository, branch = open_repository(dataset)
    from handsight.datasets.curation.scores import check_score_name, forget_scores, save_scores  # a second; see above

    check_score_name(name)
    if delete:
        forget_scores(repository, name, branch=branch, dry_run=dry_run)
        if as_json:
            print_json({"scores": name, "deleted": not dry_run})
        else:
            console.print(bold(name), f" {'would have been' if dry_run else 'is'} forgotten")
        return
    from handsight.cli.wiring.scoring import scores_by_folds, scores_by_run  # PyTorch

    opened = open_version(dataset)
    source, values = scores_by_run(opened, model) if model else scores_by_folds(opened, folds, epochs=epochs)
    save_scores(
        repository,
        name,
        values,
        source=source,
        author=author_named(author),
        branch=branch,
        replace=replace,
        dry_run=dry_run,
    )
    errors = (values - opened.table("success")["success"].reindex(values.index).astype("float64")).abs()
    wrong = int((errors > 0.5).sum())
    if as_json:
        print_json({"scores": name, "source": source, "attempts": len(values), "wrong": wrong, "stored": not dry_run})
        return
    would = "would have " if dry_run else ""
    console.print(
        f"{would}scored {counted(len(values), 'attempt')}; of these, on the other side of 0.5 than the label: {wrong}"
    )
    if not dry_run:
        listing = pasteable("handsight", "dataset", "ls", dataset, "--sort", f"error_{name}", "--reverse", "-n", 20)
        console.print(f"the worst: {listing}")


def _faults(name: str, *, ways: int, replace: bool) -> list[str]:
    if name:
        return [] if ways == 1 else ["expected one of --model, --folds and --delete beside the name of scores"]
    return ["scores are given no name, expected one first"] if ways or replace else []


def _list_scores(dataset: GraspDataset, *, as_json: bool) -> None:
    from handsight.datasets.format.scores import read_scores, score_names  # a second; see above

    found = [read_scores(dataset.root, name) for name in score_names(dataset.root)]
    if as_json:
        print_json(
            [
                {"scores": one.name, "attempts": len(one.score), "source": one.origin.source, "made": one.origin.made}
                for one in found
            ]
        )
        return
    rows = [(one.name, str(len(one.score)), one.origin.made, one.origin.author, one.origin.source) for one in found]
    columns = ("scores", "attempts", Column(heading="made (UTC)", rank=2), Column(heading="author", rank=1))
    print_table((*columns, Column(heading="source", prose="wrap")), rows)
