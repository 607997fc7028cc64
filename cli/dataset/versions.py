"""``handsight dataset diff|branch|revert``: moving between versions."""

from __future__ import annotations

from typing import Annotated

import typer

from handsight.cli.options import Dataset, Json
from handsight.cli.output import console, print_json, print_table
from handsight.datasets.address import DatasetAddress
from handsight.datasets.errors import RefNotFoundError, counted
from handsight.datasets.integrity.migrate import migrate
from handsight.datasets.reading.diff import Balance, VersionDiff, diff_versions
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.store.branches import create_branch, delete_branch
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.writing.revert import revert

_LISTED = 5
"""Ids shown of each list; --json has them all."""


def register(app: typer.Typer) -> None:
    """Add the commands to ``handsight dataset``."""
    app.command("diff")(diff)
    app.command("branch")(branch)
    app.command("revert")(revert_command)
    app.command("migrate")(migrate_command)


def diff(
    before: Annotated[str, typer.Argument(metavar="DATASET[@REF]", help="The version left.")],
    after: Annotated[
        str,
        typer.Argument(metavar="DATASET[@REF] | REF", help="The version reached; a ref alone is of the same dataset."),
    ],
    as_json: Json = False,
) -> None:
    """Compare two versions: attempts added, excluded, restored, relabelled, and how the balance moved."""
    first = DatasetAddress.parse(before)
    repository = GraspRepository.open(first.path)
    found = diff_versions(GraspDataset(repository, ref=first.ref), _version(repository, after))
    if as_json:
        print_json(found)
    else:
        _print_diff(found)


def branch(
    dataset: Dataset,
    name: Annotated[str, typer.Argument(help="Branch to begin at REF, or to delete; without it, all are listed.")] = "",
    delete: Annotated[bool, typer.Option("--delete", help="Delete the branch.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Delete it even if its commits are nowhere else.")] = False,
    as_json: Json = False,
) -> None:
    """Create, list or delete branches."""
    address = DatasetAddress.parse(dataset)
    repository = GraspRepository.open(address.path)
    if not name:
        branches = repository.branches()
        if as_json:
            print_json([{"branch": one, "snapshot": snapshot} for one, snapshot in branches.items()])
        else:
            print_table(("branch", "snapshot"), list(branches.items()))
    elif delete:
        snapshot = delete_branch(repository, name, force=force)
        console.print(f"deleted branch [bold]{name}[/]; until the next gc it is back with")
        console.print(f"  handsight dataset branch {address.path}@{snapshot} {name}")
    else:
        snapshot = create_branch(repository, name, address.ref)
        console.print(f"branch [bold]{name}[/] begins at {snapshot}")


def revert_command(
    dataset: Annotated[str, typer.Argument(metavar="DATASET[@BRANCH]", help="The branch to change.")],
    ref: Annotated[str, typer.Argument(help="Release, branch or snapshot whose content it shall have.")],
    message: Annotated[str, typer.Option("--message", "-m", help="Of the commit.")] = "",
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Show the difference, and do nothing.")] = False,
    as_json: Json = False,
) -> None:
    """Give a branch the content of another version, in a new commit; nothing is lost, and it can be reverted."""
    address = DatasetAddress.parse(dataset)
    repository = GraspRepository.open(address.path)
    found = diff_versions(GraspDataset(repository, ref=address.ref), GraspDataset(repository, ref=ref))
    snapshot = None if dry_run else revert(repository, ref, branch=address.ref, message=message)
    if as_json:
        print_json({"snapshot": snapshot, "diff": found})
        return
    _print_diff(found)
    if dry_run:
        console.print("nothing was changed")
    elif snapshot is None:
        console.print(f"{address.ref} has that content already")
    else:
        console.print(f"{address.ref} is now at {snapshot}")


def _version(repository: GraspRepository, text: str) -> GraspDataset:
    """A ref of the dataset at hand or, where it has none of that name, the version that an address names."""
    try:
        return GraspDataset(repository, ref=text)
    except RefNotFoundError:
        if "/" not in text and "@" not in text:
            raise
        return GraspDataset.open(text)


def _print_diff(found: VersionDiff) -> None:
    for name in ("added", "removed", "replaced", "excluded", "restored", "relabelled"):
        ids: tuple[str, ...] = getattr(found, name)
        if ids:
            more = f" and {len(ids) - _LISTED} more" if len(ids) > _LISTED else ""
            console.print(f"[bold]{name:<11}[/] {len(ids):>6}  {', '.join(ids[:_LISTED])}{more}")
    if found.empty:
        console.print("the same attempts, curated alike")
    console.print(f"[bold]{'balance':<11}[/] {_share(found.balance_before)} -> {_share(found.balance_after)}")
    if found.objects:
        rows = [(name, _share(was), _share(now)) for name, (was, now) in found.objects.items()]
        print_table(("object", "before", "after"), rows)


def _share(balance: Balance) -> str:
    share = f" ({balance.successes / balance.labelled:.1%})" if balance.labelled else ""
    return f"{balance.successes} of {balance.labelled}{share}"


def migrate_command(
    dataset: Dataset,
    branch: Annotated[str, typer.Option("--branch", help="Name of the branch to make; the version itself stays.")],
    as_json: Json = False,
) -> None:
    """Upgrade a version of an older schema, on a new branch; every attempt keeps its id and digest."""
    address = DatasetAddress.parse(dataset)
    done = migrate(GraspRepository.open(address.path), branch, ref=address.ref)
    if as_json:
        print_json(done)
    elif done is None:
        console.print(f"{dataset} has the newest schema already: no branch was made")
    else:
        console.print(
            f"branch [bold]{done.branch}[/] ({done.snapshot}): {counted(done.sessions, 'session')} upgraded from "
            f"schema {done.schema_before} to {done.schema_after}"
        )
