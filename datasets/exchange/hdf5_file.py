"""A new HDF5 file whose disk may fail.

The HDF5 library crashes the process when it cannot write what it still holds at the time a file is closed. So it writes
through a file of Python's that never fails: once the disk does, the error is kept, and what is written from then on is
held in memory until the library has closed the file. The error is raised afterwards.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from io import FileIO
from pathlib import Path

import h5py


class _UnfailingFile:
    """A file for h5py's driver of Python files, which keeps the first error instead of raising it."""

    def __init__(self, file: FileIO) -> None:
        self._file = file
        self._position = 0
        self._size = 0
        self._unwritten: list[tuple[int, bytes]] = []
        self.error: OSError | None = None

    def seek(self, offset: int, whence: int = 0) -> int:
        self._position = offset + (0, self._position, self._size)[whence]
        return self._position

    def tell(self) -> int:
        return self._position

    def write(self, data: memoryview) -> int:
        content = bytes(data)
        if self.error is None:
            try:
                self._write(content)
            except OSError as error:
                self.error = error
        if self.error is not None:
            self._unwritten.append((self._position, content))
        self._position += len(content)
        self._size = max(self._size, self._position)
        return len(content)

    def read(self, size: int = -1) -> bytes:
        """Named because h5py knows files by it; the library reads with :meth:`readinto`."""
        content = bytearray(max(self._size - self._position, 0) if size < 0 else size)
        self.readinto(memoryview(content))
        return bytes(content)

    def readinto(self, target: memoryview) -> int:
        start, size = self._position, len(target)
        read = bytearray(size)
        self._file.seek(start)
        stored = self._file.read(size)
        read[: len(stored)] = stored
        for at, content in self._unwritten:
            first, last = max(at, start), min(at + len(content), start + size)
            if first < last:
                read[first - start : last - start] = content[first - at : last - at]
        target[:] = bytes(read)
        self._position += size
        return size

    def truncate(self, size: int | None = None) -> int:
        self._size = self._position if size is None else size
        if self.error is None:
            try:
                self._file.truncate(self._size)
            except OSError as error:
                self.error = error
        return self._size

    def flush(self) -> None:
        pass  # Python's file holds nothing back.

    def _write(self, content: bytes) -> None:
        self._file.seek(self._position)
        rest = memoryview(content)
        while rest:
            rest = rest[self._file.write(rest) :]


class NewHdf5File:
    """A new HDF5 file that is being written."""

    def __init__(self, file: h5py.File, disk: _UnfailingFile) -> None:
        self.root = file
        self._disk = disk

    def check(self) -> None:
        """Find out whether the disk has failed. Until then, what could not be written takes memory.

        Raises:
            OSError: It has.
        """
        if self._disk.error is not None:
            raise self._disk.error


@contextmanager
def new_hdf5_file(path: Path) -> Iterator[NewHdf5File]:
    """A file for the block to write to; the folder it is in exists.

    Raises:
        OSError: It cannot be written, for instance because the disk is full.
    """
    with path.open("x+b", buffering=0) as raw:
        disk = _UnfailingFile(raw)
        with h5py.File(disk, "w", driver="fileobj") as file:
            new = NewHdf5File(file, disk)
            yield new
        new.check()
