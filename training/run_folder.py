"""The folder of a training run, looked at from outside: asked before PyTorch is imported, which takes seconds."""

from __future__ import annotations

from pathlib import Path

from handsight.training.errors import CheckpointError

RUN_RECORD = "run.json"
"""Written last: a folder that has it is complete."""


def check_run_folder(folder: Path) -> None:
    """Refuse a place where a run cannot be written, before hours are spent on training.

    Raises:
        CheckpointError: A file is in the way, or the folder holds other things.
    """
    if folder.is_file():
        raise CheckpointError(f"{folder} is a file, expected a new folder for the run: choose another --out")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / RUN_RECORD).exists():
        raise CheckpointError(f"{folder} holds other files, expected a new or empty folder: choose another --out")


def check_finished_run(folder: Path) -> None:
    """Refuse a folder that holds no finished run.

    Raises:
        CheckpointError: The folder is missing, or has no record.
    """
    if not (folder / RUN_RECORD).is_file():
        what = "holds no finished run" if folder.is_dir() else "is no folder"
        raise CheckpointError(f"{folder} {what} ({RUN_RECORD} is missing): train one with 'handsight train'")
