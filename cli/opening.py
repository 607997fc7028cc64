"""Datasets and runs as commands open them, and the places that they write to.

Icechunk, Zarr and pandas take a second to import, PyTorch longer. What is not there, and a place that takes no files,
is refused before; every command opens through here, so that no command has to think of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from handsight.cli.errors import CommandError
from handsight.datasets.address import DatasetAddress, check_dataset_folder, location_of
from handsight.datasets.writable import file_fault, folder_fault, refuse_unwritable

if TYPE_CHECKING:
    from handsight.datasets.reading.reader import GraspDataset
    from handsight.datasets.store.repository import GraspRepository


def checked_address(text: str) -> DatasetAddress:
    """Where a dataset is and the version meant, once a local folder is known to be there.

    Raises:
        AddressError: The text is no address.
        DatasetNotFoundError: Nothing is there.
        NotADatasetError: A file or a folder that is no dataset is there.
    """
    address = DatasetAddress.parse(text)
    check_dataset_folder(address.path)
    return address


def check_named_once(datasets: Sequence[str]) -> None:
    """Refuse versions that are named more than once.

    Raises:
        CommandError: Some are; all of them are named.
    """
    twice = sorted({name for name in datasets if datasets.count(name) > 1})
    if twice:
        raise CommandError(f"{', '.join(twice)} is named more than once, expected every version once")


def open_version(text: str) -> GraspDataset:
    """The version that ``PATH[@REF]`` names; errors as of :meth:`GraspDataset.open`."""
    address = checked_address(text)
    from handsight.datasets.reading.reader import GraspDataset  # once the folder is there; see above

    return GraspDataset.open(address)


def open_repository(text: str) -> tuple[GraspRepository, str]:
    """The dataset that ``PATH[@REF]`` names, with the ref; errors as of :meth:`GraspRepository.open`."""
    address = checked_address(text)
    from handsight.datasets.store.repository import GraspRepository  # once the folder is there; see above

    return GraspRepository.open(address.path), address.ref


def check_target(dataset: str | Path) -> None:
    """Refuse a dataset that cannot be added to, or a place where none can be made, before there is anything to add.

    Raises:
        AddressError: The text is no location.
        StorageError: The disk takes no files there.
    """
    refuse_unwritable(location_of(dataset))


def check_out_file(path: Path, *suffixes: str) -> None:
    """Refuse an ``--out`` where no file can be written.

    Args:
        path: What was given.
        suffixes: How its name may end, in lower case; any end will do where there are none.

    Raises:
        CommandError: The name ends otherwise, or the disk takes no such file.
    """
    if suffixes and path.suffix.lower() not in suffixes:
        raise CommandError(f"--out is {path}, expected a file name that ends in {' or '.join(suffixes)}")
    if (fault := file_fault(path)) is not None:
        raise CommandError(f"--out is {path}, and {fault}")


def check_out_folder(path: Path) -> None:
    """Refuse an ``--out`` where no folder can be made; see :func:`check_folder`."""
    check_folder("--out", path)


def check_folder(option: str, path: Path) -> None:
    """Refuse a place where no folder can be made, or nothing can be written to the one that is there.

    Args:
        option: With which it was given.
        path: What was given.

    Raises:
        CommandError: A file or a link that leads nowhere is in the way, or the disk takes no files there.
    """
    if (fault := folder_fault(path)) is not None:
        raise CommandError(f"{option} is {path}, and {fault}: choose another folder")


def check_rig_file(path: Path) -> None:
    """Refuse a rig's file that is not there, before anything that reads one is imported.

    Raises:
        CommandError: It is no file.
    """
    if not path.is_file():
        raise CommandError(f"{path} is no file, expected the rig's file: docs/rig.md has one to begin with")


def check_rig_option(station: str, rig: Path | None) -> None:
    """Refuse a rig's file for the simulated station, and a rig without its file.

    Raises:
        CommandError: They do not go together, or the file is not there.
    """
    if rig is None and station == "ur10":
        raise CommandError("--station ur10 needs the rig's file: --rig FILE")
    if rig is not None:
        if station != "ur10":
            raise CommandError(f"--rig goes with --station ur10, and the station is {station}")
        check_rig_file(rig)
