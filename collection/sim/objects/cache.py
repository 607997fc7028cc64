"""Where object sets are kept on this machine, and how a set gets there whole or not at all."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from handsight.collection.errors import ObjectSetError
from handsight.datasets.address import cache_folder
from handsight.datasets.atomic import atomic_folder

CACHE_VARIABLE = "HANDSIGHT_CACHE"


def cache_root() -> Path:
    """The folder of object sets: ``$HANDSIGHT_CACHE/objects``, by default ``~/.cache/handsight/objects``."""
    return cache_folder() / "objects"


def publish(target: Path, fill: Callable[[Path], None]) -> bool:
    """Make folder ``target`` at once: ``fill`` writes into an empty folder beside it, which is then renamed.

    Several processes may try; the first one wins and the others throw their work away. A process that is killed
    leaves a folder whose name starts with a dot, which is never read.

    Returns:
        Whether this call made the folder.

    Raises:
        ObjectSetError: The folder cannot be written, with the reason.
    """
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with atomic_folder(target) as unfinished:
            unfinished.mkdir()
            fill(unfinished)
    except OSError as error:
        # A folder that is not empty cannot be renamed over: somebody else was first.
        if target.is_dir():
            return False
        raise _unwritable(target, error) from error
    return True


def _unwritable(target: Path, error: OSError) -> ObjectSetError:
    return ObjectSetError(
        f"cannot write object set {target} ({error.strerror or error}), expected a writable folder with some space; "
        f"set {CACHE_VARIABLE} to another one"
    )
