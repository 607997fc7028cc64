"""Whether something can be made at a place, asked of the disk itself before long work is done for it.

Permission bits do not tell: they bind everybody but root, and a disk that is full or mounted read-only refuses whatever
they say. So a small file without a name is written where the result will be; it is gone once it is closed, even where
the process is killed before.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from handsight.datasets.address import SIDE_FOLDER, Location, S3Prefix, looks_like_dataset
from handsight.datasets.errors import StorageError

_PROBE = bytes(4096)
"""A block, which a full disk has not."""


def file_fault(path: Path) -> str | None:
    """Why no file can be written at a path, in an existing folder; None where one can. A file there is replaced."""
    if path.is_dir():
        return f"{path} is a folder, expected the name of a file"
    if path.exists() and not path.is_file():
        return f"{path} is neither a file nor a folder, and would be replaced by one"
    fault = _fault_above(path)
    if fault is None and not path.parent.exists():
        return f"there is no folder {path.parent} to write {path.name} to: create it first"
    return fault


def folder_fault(path: Path) -> str | None:
    """Why no folder can be made at a path, or in the one that is there nothing; None where it can.

    Folders above it need not exist.
    """
    return _fault_above(path / "_")


def dataset_fault(path: Path) -> str | None:
    """Why nothing can be added to the dataset in a folder, or where there is none, why none can be made there."""
    faults = [folder_fault(path)]
    if looks_like_dataset(path):
        try:
            folders = [one for one in sorted(path.iterdir()) if one.is_dir()]
        except OSError as error:
            return f"{path} cannot be listed: {error.strerror}"
        # In a folder that a group shares, each of them may be somebody else's.
        faults += [folder_fault(folder) for folder in folders]
        faults.append(folder_fault(path / SIDE_FOLDER))
    return next((fault for fault in faults if fault is not None), None)


def refuse_unwritable(location: Location) -> None:
    """Refuse a dataset that cannot be added to, or a place for a new one; what is in a bucket is not asked.

    Raises:
        StorageError: Nothing can be written there.
    """
    if not isinstance(location, S3Prefix) and (fault := dataset_fault(location)) is not None:
        raise StorageError(f"cannot write to {location}: {fault}; mend that, or choose another place")


def link_fault(path: Path) -> str | None:
    """What is wrong with a link that leads nowhere; None for anything else."""
    if path.is_symlink() and not path.exists():
        return f"{path} is a link to {path.readlink()}, which is not there"
    return None


def _fault_above(path: Path) -> str | None:
    """What keeps a path from being made, in the nearest thing that is there."""
    if (fault := link_fault(path)) is not None:
        return fault
    for folder in path.absolute().parents:
        if (fault := link_fault(folder)) is not None:
            return fault
        if folder.is_dir():
            return _probe_fault(folder)
        if folder.exists():
            return f"{folder} is a file, expected a folder"
    return None


def _probe_fault(folder: Path) -> str | None:
    try:
        with tempfile.TemporaryFile(dir=folder, buffering=0) as probe:
            probe.write(_PROBE)
    except FileNotFoundError:
        return f"{folder} takes no new files"  # Where the kernel keeps what it knows, for instance.
    except OSError as error:
        return f"{folder} takes no new files: {error.strerror}"
    return None
