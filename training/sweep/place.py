"""Where a sweep is kept: in a folder, or in a bucket with a folder of this machine to work in.

Cells are shared by locks that end with their process, and a bucket has none. So one kept there is worked at in a folder
of the machine that trains it or, with Ray, that hands it out, and every cell is copied to the bucket as it ends, its
metrics last: what has them there is done, and no machine trains it again.
"""

from __future__ import annotations

import json
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from ulid import ULID

from handsight.datasets.address import Location, S3Prefix, cache_folder
from handsight.datasets.atomic import atomic_file
from handsight.datasets.errors import StorageError
from handsight.datasets.store.files import read_object, remove_object, stored_files, write_object
from handsight.training.errors import SweepFolderError
from handsight.training.sweep.cell import Cell
from handsight.training.sweep.folder import CELLS, CONFIG, CURVE, FAILURE, METRICS, PREDICTIONS
from handsight.training.sweep.plan import PLAN

MARK = "sweep.json"
"""In a bucket: which folder of a machine is of this sweep, and not of one that was in its place before."""
_READERS = 16
"""Answers of a bucket take tens of milliseconds each."""


class SweepPlace:
    """A sweep that is kept in the folder in which it is worked at.

    Args:
        folder: That folder.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __str__(self) -> str:
        return str(self.folder)

    def keep_plan(self) -> None:
        """Keep the plan, before anything is trained by it."""

    def keep_cell(self, cell: Cell) -> None:
        """Keep what has become of a cell."""

    def keep_tables(self) -> None:
        """Keep the tables and the figure, and whatever was not kept yet."""


class BucketPlace(SweepPlace):
    """A sweep that is kept in a bucket.

    Args:
        location: Where.
        name: What it is called on machines that work at it.

    Raises:
        AddressError: There is no place on this machine for the folder to work in.
    """

    def __init__(self, location: S3Prefix, name: str) -> None:
        super().__init__(cache_folder() / "sweeps" / name)
        self.location = location
        self._due: list[str] = []
        """Names of cells."""

    def __str__(self) -> str:
        return str(self.location)

    def fetch(self, stored: Collection[str]) -> None:
        """Bring the plan, and of every cell what tells that it is done or failed.

        Args:
            stored: Names of what is there.

        Raises:
            StorageError: The bucket cannot be read.
        """
        there = {name for name in stored if _tells(name)}
        done = {_cell_of(name) for name in there if name.endswith(METRICS)}
        here = {f"{CELLS}/{path.parent.name}/{path.name}" for path in self.folder.glob(f"{CELLS}/*/*.json")}
        # What a call that was killed has left in the folder alone.
        self._due = sorted({_cell_of(name) for name in here - there if _tells(name)} - done)
        wanted = sorted(name for name in there - here if name.endswith(METRICS) or _cell_of(name) not in done)
        with ThreadPoolExecutor(_READERS) as pool:
            contents = pool.map(lambda name: read_object(self.location, name), wanted)
            for name, content in zip(wanted, contents, strict=True):
                self._write(name, content)
        if PLAN in stored:  # last: a folder that has it has all that it goes by
            self._write(PLAN, read_object(self.location, PLAN))

    def keep_plan(self) -> None:
        """See :meth:`SweepPlace.keep_plan`.

        Raises:
            StorageError: The bucket cannot be written to.
        """
        write_object(self.location, MARK, json.dumps({"folder": self.folder.name}).encode())
        write_object(self.location, PLAN, (self.folder / PLAN).read_bytes())

    def keep_cell(self, cell: Cell) -> None:
        """See :meth:`SweepPlace.keep_cell`; where the bucket is out of reach, with the next one or at the end."""
        self._due.append(cell.name)
        try:
            self._keep_due()
        except StorageError:
            return  # a night's work shall not end with an hour's network

    def keep_tables(self) -> None:
        """See :meth:`SweepPlace.keep_tables`.

        Raises:
            StorageError: The bucket cannot be written to; everything is in the folder, and the same call copies it.
        """
        try:
            self._keep_due()
            for path in sorted(self.folder.iterdir()):
                if path.is_file() and not path.name.startswith("."):
                    write_object(self.location, path.name, path.read_bytes())
        except StorageError as error:
            raise StorageError(f"{error}; all that is done is in {self.folder}, and the same call copies it") from error

    def _keep_due(self) -> None:
        while self._due:
            self._copy(self._due[0])
            self._due.pop(0)

    def _copy(self, cell: str) -> None:
        inside = f"{CELLS}/{cell}"
        for name in (CONFIG, CURVE, PREDICTIONS, FAILURE, METRICS):
            if (self.folder / inside / name).is_file():
                write_object(self.location, f"{inside}/{name}", (self.folder / inside / name).read_bytes())
            elif name == FAILURE:
                remove_object(self.location, f"{inside}/{name}")

    def _write(self, name: str, content: bytes) -> None:
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_file(path) as unfinished:
            unfinished.write_bytes(content)


def sweep_place(location: Location, *, begin: bool) -> SweepPlace:
    """Where a sweep is kept, with all that is known of it in a folder of this machine.

    Args:
        location: A folder, or a place in a bucket.
        begin: Whether there need not be a sweep yet.

    Raises:
        SweepFolderError: There is something else in the bucket, or no sweep and none is to be begun.
        StorageError: The bucket is out of reach.
        AddressError: There is no place for the folder to work in.
    """
    if not isinstance(location, S3Prefix):
        return SweepPlace(location)
    stored = stored_files(location)
    if MARK not in stored:
        if stored:
            raise SweepFolderError(f"{location} holds other files, expected a new or empty prefix: choose another")
        if not begin:
            raise SweepFolderError(f"{location} holds no sweep: to begin one, see 'handsight ablate --help'")
        return BucketPlace(location, str(ULID()))
    place = BucketPlace(location, _name_of(location))
    place.fetch(stored)
    return place


def _tells(name: str) -> bool:
    """Whether a file tells what has become of a cell."""
    return name.startswith(f"{CELLS}/") and name.endswith((f"/{METRICS}", f"/{FAILURE}"))


def _cell_of(name: str) -> str:
    return name.split("/")[1]


def _name_of(location: S3Prefix) -> str:
    try:
        return str(ULID.from_str(json.loads(read_object(location, MARK))["folder"]))
    except (ValueError, KeyError, TypeError) as error:
        raise SweepFolderError(
            f"{MARK} of {location} is damaged ({error}): delete it and choose another --out, or restore it from a copy"
        ) from error
