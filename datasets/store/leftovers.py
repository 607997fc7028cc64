"""What killed processes left in a local dataset and beside it."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from handsight.datasets.atomic import clear_unfinished, is_unfinished
from handsight.datasets.held import clear_abandoned, remove_abandoned, remove_tree, temporary_folder
from handsight.datasets.store.releases import DRAFT_PREFIX

TEMPORARY_PREFIX = "handsight-"
"""Of every folder that handsight makes where temporary files go."""

WRITERS_FOLDER = "writers"
"""In the side folder: a file for every writer at work (writers.py)."""

_DRAFT_FOLDER = f"branch.{DRAFT_PREFIX}"


def clear_leftovers(root: Path, side_folder: Path) -> None:
    """Delete what was never renamed into place: branches and releases, and of writers that are gone drafts and entries.

    The caller holds the commit lock. Those are written under that lock alone, so none of them is being written now.
    What may not be deleted stays.
    """
    with suppress(OSError):
        for folder in (root, *(one for one in (root / "refs").iterdir() if one.is_dir())):
            for path in folder.iterdir():
                if is_unfinished(path):
                    remove_tree(path)
        for draft in (root / "refs").glob(f"{_DRAFT_FOLDER}*"):
            writer = side_folder / WRITERS_FOLDER / f"{draft.name.removeprefix(_DRAFT_FOLDER)}.json"
            if not writer.exists():
                remove_tree(draft)
            else:
                remove_abandoned(writer, draft)
        for path in (side_folder / WRITERS_FOLDER).glob("*.json"):
            remove_abandoned(path)


def clear_surroundings(root: Path, side_folder: Path) -> None:
    """Delete what killed processes left in the caches, beside the dataset, and among the temporary files.

    That is where datasets, exports and the robot's model are made. What somebody works at is left alone.
    """
    with suppress(OSError):
        for folder in (root.resolve().parent, side_folder, *(one for one in side_folder.rglob("*") if one.is_dir())):
            clear_unfinished(folder)
    clear_abandoned(temporary_folder(), TEMPORARY_PREFIX)
