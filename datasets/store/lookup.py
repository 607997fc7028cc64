"""What names lead to: each asked for by itself, and all of them listed only where it must be said which there are."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import icechunk

from handsight.datasets.address import Location
from handsight.datasets.errors import RefNotFoundError
from handsight.datasets.store.icechunk_engine import icechunk_errors, is_missing_ref
from handsight.datasets.store.refs import ref_names
from handsight.datasets.store.releases import is_internal, is_snapshot_id


def version_names(path: Location) -> tuple[list[str], list[str]]:
    """Names of the releases and of the branches that hold versions, each sorted.

    Raises:
        StorageError: The disk or bucket cannot be read.
    """
    tags, branches = ref_names(path)
    return tags, [name for name in branches if not is_internal(name)]


def version_named(engine: icechunk.Repository, path: Location, name: str) -> icechunk.Session | None:
    """The version that a release, a branch or a snapshot id names, to be read; None where none of them does.

    Icechunk reads nothing of it yet. It looks for a snapshot that it is given by its id alone, and then fetches it
    again to read it.

    Raises:
        StorageError: There is one, and it cannot be read.
    """
    with icechunk_errors(f"cannot look up {name!r} in {path}"):
        # No release or branch has a name of that form, so there is no need to ask for one.
        if is_snapshot_id(name):
            with suppress(icechunk.IcechunkError):
                return engine.readonly_session(snapshot_id=name)
        found = _looked_up(lambda: engine.readonly_session(tag=name), lambda: name in ref_names(path)[0])
        if found is None and not is_internal(name):
            found = _looked_up(lambda: engine.readonly_session(name), lambda: name in ref_names(path)[1])
    return found


@contextmanager
def branch_of(path: Location, branch: str) -> Iterator[None]:
    """Where the block asks Icechunk for a branch that is not there, say which there are.

    Raises:
        RefNotFoundError: There is no such branch.
    """
    try:
        yield
    except icechunk.IcechunkError as error:
        if not is_missing_ref(error) and branch in ref_names(path)[1]:
            raise
        _, branches = version_names(path)
        raise RefNotFoundError(f"{path} has no branch {branch!r} (branches: {', '.join(branches)})") from error


def _looked_up(lookup: Callable[[], icechunk.Session], is_there: Callable[[], bool]) -> icechunk.Session | None:
    """What a tag or a branch leads to; None where there is none of that name.

    Icechunk has one error for whatever goes wrong: unless that says plainly that there is no such ref, the names decide
    whether it is passed on.
    """
    try:
        return lookup()
    except icechunk.IcechunkError as error:
        if is_missing_ref(error) or not is_there():
            return None
        raise
