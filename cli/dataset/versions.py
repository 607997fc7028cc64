"""``handsight dataset init|release|branch|diff|revert|migrate``: versions, and moving between them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from handsight.cli.completion import complete_branch_name, complete_other_version, complete_ref, complete_version
from handsight.cli.opening import open_repository, open_version
from handsight.cli.options import Dataset, DatasetBranch, DatasetPath, DryRun, Json, Message, NewBranch
from handsight.cli.output import bold, console, print_json
from handsight.cli.tables import Column, print_facts, print_table, short_snapshot
from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.errors import CorruptDataError, RefNotFoundError, counted, pasteable

if TYPE_CHECKING:
    # These take a second to import; a command does so once its dataset is known to be there.
    from handsight.datasets.reading.diff import Balance, VersionDiff
    from handsight.datasets.reading.reader import GraspDataset
    from handsight.datasets.store.repository import GraspRepository

_LISTED = 5
"""Ids shown of each list; --json has them all."""


def init(dataset: DatasetPath, as_json: Json = False) -> None:
    """Create an empty dataset; refuses a location where something is already."""
    from handsight.datasets.store.repository import GraspRepository  # a second; see above

    made = GraspRepository.create(dataset)
    if as_json:
        print_json({"dataset": str(made.path), "snapshot": made.resolve(DEFAULT_REF)})
    else:
        console.print("created an empty dataset at ", bold(dataset))


def release(
    dataset: Dataset,
    name: Annotated[str, typer.Argument(help="Name of the release, such as v1; never to be used again.")],
    message: Message = "",
    as_json: Json = False,
) -> None:
    """Give a version an immutable name."""
    repository, ref = open_repository(dataset)
    made = repository.release(name, ref, message)
    if as_json:
        print_json(
            {
                "release": made.name,
                "snapshot": made.snapshot_id,
                "message": made.message,
                "released": made.released_at,
            }
        )
        return
    console.print(f"released {repository.path}@", bold(made.name), f" (snapshot {made.snapshot_id})")


def diff(
    before: Annotated[
        str, typer.Argument(metavar="DATASET[@REF]", help="The version left.", autocompletion=complete_version)
    ],
    after: Annotated[
        str,
        typer.Argument(
            metavar="DATASET[@REF] | REF",
            help="The version reached; a ref alone is of the same dataset.",
            autocompletion=complete_other_version,
        ),
    ],
    as_json: Json = False,
) -> None:
    """Compare two versions: attempts added, excluded, restored, relabelled, and how the balance moved."""
    first = open_version(before)
    from handsight.datasets.reading.diff import diff_versions  # a second; see above

    found = diff_versions(first, _version(first.repository, after))
    if as_json:
        print_json(found)
    else:
        _print_diff(found)


def branch(
    dataset: Dataset,
    name: Annotated[
        str,
        typer.Argument(
            help="Branch to begin at REF, or to delete; without it, all are listed.",
            autocompletion=complete_branch_name,
        ),
    ] = "",
    delete: Annotated[bool, typer.Option("--delete", help="Delete the branch.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Delete it even if its commits are nowhere else.")] = False,
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Create, list or delete branches."""
    repository, ref = open_repository(dataset)
    if name:
        snapshot = _moved_branch(repository, name, ref, delete=delete, force=force, dry_run=dry_run)
        if as_json:
            print_json({"branch": name, "snapshot": snapshot, "deleted": delete and not dry_run})
        else:
            _print_branch(repository, name, snapshot, delete=delete, dry_run=dry_run)
    else:
        branches = repository.branches()
        if as_json:
            print_json([{"branch": one, "snapshot": snapshot} for one, snapshot in branches.items()])
        else:
            short = short_snapshot(branches.values())
            print_table(("branch", Column(heading="snapshot", short=short)), list(branches.items()))


def _moved_branch(repository: GraspRepository, name: str, ref: str, *, delete: bool, force: bool, dry_run: bool) -> str:
    """Delete a branch or begin one, or see whether that can be done; the snapshot id that it had or has."""
    from handsight.datasets.store import branches  # a second; see above

    if delete:
        gone = branches.check_deletable if dry_run else branches.delete_branch
        return gone(repository, name, force=force)
    if dry_run:
        branches.check_new_branch(repository, name)
        return repository.resolve(ref)
    return branches.create_branch(repository, name, ref)


def _print_branch(repository: GraspRepository, name: str, snapshot: str, *, delete: bool, dry_run: bool) -> None:
    if dry_run:
        console.print(f"would have {'deleted' if delete else 'begun'} branch ", bold(name), f" at {snapshot}")
    elif delete:
        again = pasteable("handsight", "dataset", "branch", f"{repository.path}@{snapshot}", name)
        console.print("deleted branch ", bold(name), f"; until the next gc it is back with {again}")
    else:
        console.print("branch ", bold(name), f" begins at {snapshot}")


def revert_command(
    dataset: DatasetBranch,
    ref: Annotated[
        str,
        typer.Argument(help="Release, branch or snapshot whose content it shall have.", autocompletion=complete_ref),
    ],
    message: Message = "",
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Give a branch the content of another version, in a new commit; nothing is lost, and it can be reverted."""
    repository, branch_name = open_repository(dataset)
    from handsight.datasets.reading.diff import diff_versions  # a second; see above
    from handsight.datasets.reading.reader import GraspDataset
    from handsight.datasets.writing.revert import revert

    wanted = GraspDataset(repository, ref=ref)
    try:
        found = diff_versions(GraspDataset(repository, ref=branch_name), wanted)
    except CorruptDataError as error:
        # A branch that cannot be read is one to revert; what the other has that it has not stays unsaid.
        found, unreadable = None, error
    snapshot = None if dry_run else revert(repository, ref, branch=branch_name, message=message)
    if as_json:
        print_json({"snapshot": snapshot, "diff": found})
        return
    if found is None:
        console.print(f"what changes is not known: {unreadable}")
    else:
        _print_diff(found)
    if dry_run:
        console.print("nothing was changed")
    elif snapshot is None:
        console.print(f"{branch_name} has that content already")
    else:
        console.print(f"{branch_name} is now at {snapshot}")


def _version(repository: GraspRepository, text: str) -> GraspDataset:
    """A ref of the dataset at hand or, where it has none of that name, the version that an address names."""
    from handsight.datasets.reading.reader import GraspDataset  # a second; see above

    try:
        return GraspDataset(repository, ref=text)
    except RefNotFoundError:
        if "/" not in text and "@" not in text:
            raise
        return open_version(text)


def _print_diff(found: VersionDiff) -> None:
    facts = []
    for name in ("added", "removed", "replaced", "excluded", "restored", "relabelled"):
        ids: tuple[str, ...] = getattr(found, name)
        if ids:
            more = f" and {len(ids) - _LISTED} more" if len(ids) > _LISTED else ""
            facts.append((name, f"{len(ids)}: {', '.join(ids[:_LISTED])}{more}"))
    if found.empty:
        console.print("the same attempts, curated alike")
    print_facts([*facts, ("balance", f"{_share(found.balance_before)} -> {_share(found.balance_after)}")])
    if found.objects:
        rows = [(name, _share(was), _share(now)) for name, (was, now) in found.objects.items()]
        print_table(("object", "before", "after"), rows)


def _share(balance: Balance) -> str:
    share = f" ({balance.successes / balance.labelled:.1%})" if balance.labelled else ""
    return f"{balance.successes} of {balance.labelled}{share}"


def migrate_command(
    dataset: Dataset,
    branch: NewBranch,
    dry_run: DryRun = False,
    as_json: Json = False,
) -> None:
    """Bring a version of an older schema forward, on a new branch; every attempt keeps its id and digest."""
    repository, ref = open_repository(dataset)
    from handsight.datasets.integrity.migrate import migrate  # a second; see above

    done = migrate(repository, branch, ref=ref, dry_run=dry_run)
    if as_json:
        print_json(done)
    elif done is None:
        console.print(f"{dataset} has the newest schema already: no branch was made")
    else:
        console.print(
            "would make branch " if dry_run else "branch ",
            bold(branch),
            "" if dry_run else f" ({done.snapshot})",
            f": {counted(done.sessions, 'session')} upgraded from schema {done.schema_before} to {done.schema_after}",
        )
