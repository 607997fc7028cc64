"""Encoded attempts on their way from a foreign file into a dataset, with their pictures out of memory."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from types import TracebackType
from typing import Any

from zarr.core.buffer import cpu

from handsight.datasets.errors import StorageError
from handsight.datasets.format.frames import EncodedFrames, FrameEncoder
from handsight.datasets.records import SessionHeader
from handsight.datasets.writing.batches import Columns, EncodedAttempt, PreparedAttempt, new_layouts

Extents = Mapping[str, tuple[int, int]]
"""Where the chunks of an attempt begin and how long they are, by the path of their array."""


class AttemptSpool:
    """Attempts that were checked, hashed and encoded before it is known whether all of them can be imported.

    Their pictures, about 0.5 MB for one of 640x480, are kept in an unnamed file where temporary files go (``TMPDIR``),
    so no picture has to be decoded or hashed again.
    """

    def __init__(self, header: SessionHeader) -> None:
        self._header = header
        self._attempts: list[tuple[Columns, Extents]] = []
        self._file = tempfile.TemporaryFile()  # noqa: SIM115  # Closed by __exit__.

    def __enter__(self) -> AttemptSpool:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def append(self, attempt: PreparedAttempt) -> None:
        """Encode an attempt and keep it.

        Raises:
            StorageError: There is no room for it.
        """
        extents = {}
        for path, chunk in self._encoder.encode(attempt.frames).items():
            data = chunk.to_bytes()
            with _disk_errors():
                extents[path] = (self._file.tell(), len(data))
                self._file.write(data)
        self._attempts.append((attempt.columns, extents))

    def attempts(self) -> Iterator[EncodedAttempt]:
        """What was appended, in order."""
        for columns, extents in self._attempts:
            yield EncodedAttempt(columns=columns, frames=self._read(extents))

    @cached_property
    def _encoder(self) -> FrameEncoder:
        """Made for the first attempt: a header that cannot be recorded may have no arrays."""
        return FrameEncoder(new_layouts(self._header))

    def _read(self, extents: Extents) -> EncodedFrames:
        frames: dict[str, Any] = {}
        with _disk_errors():
            for path, (start, size) in extents.items():
                self._file.seek(start)
                frames[path] = cpu.Buffer.from_bytes(self._file.read(size))
        return frames


@contextmanager
def _disk_errors() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise StorageError(
            f"cannot keep encoded pictures in {tempfile.gettempdir()}: {error.strerror or error}; make room there, or "
            "let TMPDIR name another folder"
        ) from error
