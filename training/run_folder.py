"""The folder of a training run, looked at from outside: asked before PyTorch is imported, which takes seconds."""

from __future__ import annotations

from pathlib import Path

from handsight.datasets.writable import folder_fault, link_fault
from handsight.training.errors import CheckpointError

RUN_RECORD = "run.json"
"""A folder that has it is complete: it is written after the weights, and names them by their hash."""
WEIGHTS = "model.safetensors"
NEXT_WEIGHTS = "model.next.safetensors"
"""Weights that a new record may name already, until they take the place of the old ones."""
CARD = "README.md"
"""What the record says, in words (card.py)."""
CARD_MARK = "<!-- handsight: card of a run -->"
"""How a card begins: a README that somebody else wrote is never replaced."""
CHECKPOINT = "checkpoint.ckpt"
"""A training that is not at its end (checkpoint.py)."""
EVENTS = "tensorboard"
"""Folder of curves (event_files.py), each in a folder of its own. Nothing of it is ever replaced."""

_OWN = (RUN_RECORD, WEIGHTS, NEXT_WEIGHTS, EVENTS, CHECKPOINT)
_NAMES_LISTED = 3


def check_run_folder(folder: Path, *, overwrite: bool = False, resume: bool = False) -> None:
    """Refuse a place where a run cannot be written, before hours are spent on training.

    Args:
        folder: Where the run is to be.
        overwrite: Whether a run that is there may be replaced. Other things never are.
        resume: Whether a training that was interrupted is to go on.

    Raises:
        CheckpointError: A file is in the way, the folder holds a run or other things, or it cannot be written to.
    """
    if (fault := link_fault(folder)) is not None:
        raise CheckpointError(f"{fault}: create that folder, or choose another --out")
    if folder.exists() and not folder.is_dir():
        raise CheckpointError(f"{folder} is a file, expected a new folder for the run: choose another --out")
    if (fault := folder_fault(folder)) is not None:
        raise CheckpointError(f"no run can be written to {folder}: {fault}; choose another --out")
    held = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    foreign = [name for name in held if not (name in _OWN or _is_unfinished(name) or is_card(folder / name))]
    if foreign:
        more = f" and {len(foreign) - _NAMES_LISTED} more" if len(foreign) > _NAMES_LISTED else ""
        raise CheckpointError(
            f"{folder} holds other files ({', '.join(foreign[:_NAMES_LISTED])}{more}), expected a new or empty folder: "
            "choose another --out"
        )
    # Weights that no record names yet are what a killed process was about to make a run of.
    if not overwrite and any(name in held for name in (RUN_RECORD, WEIGHTS)):
        what = "a run" if RUN_RECORD in held else "a run that is not complete"
        raise CheckpointError(
            f"{folder} holds {what} already, expected a new or empty folder: choose another --out, or replace it with "
            "--overwrite"
        )

    if CHECKPOINT in held and not (overwrite or resume):
        raise CheckpointError(
            f"{folder} holds a training that was interrupted: go on with --resume, or begin anew with --overwrite"
        )


def check_finished_run(folder: Path) -> None:
    """Refuse a folder that holds no finished run.

    Raises:
        CheckpointError: The folder is missing, or has no record.
    """
    if not (folder / RUN_RECORD).is_file():
        fault = link_fault(folder)
        if fault is not None:
            raise CheckpointError(f"{fault}: mend the link, or name the run itself")
        what = "holds no finished run" if folder.is_dir() else "is no folder"
        raise CheckpointError(f"{folder} {what} ({RUN_RECORD} is missing): to train one, see 'handsight train --help'")


def is_card(path: Path) -> bool:
    """Whether a file is a card that was written with a run."""
    if path.name != CARD or path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(CARD_MARK)) == CARD_MARK.encode()


def remove_unfinished(folder: Path) -> None:
    """Remove what led to a run that is saved, and what a process that was killed while it did so has left behind."""
    for path in folder.iterdir():
        if path.name == CHECKPOINT or _is_unfinished(path.name):
            path.unlink(missing_ok=True)


def _is_unfinished(name: str) -> bool:
    return name.startswith(
        (".run.unfinished-", ".model.next.unfinished-", ".README.unfinished-", ".checkpoint.unfinished-")
    )
