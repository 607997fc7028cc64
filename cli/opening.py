"""Datasets and runs as commands open them.

Icechunk, Zarr and pandas take a second to import, PyTorch longer. What is not there is refused before, and every
command opens through here, so that no command has to think of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from handsight.datasets.address import DatasetAddress, check_dataset_folder

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
