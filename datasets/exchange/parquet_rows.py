"""Rows of a Parquet file by position, however it is divided: whoever edits an export may write it anew as one group."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq


class RowReader:
    """Reads rows one after the other, with one row group in memory.

    Raises:
        OSError, ArrowException: It cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._file = pq.ParquetFile(path)
        metadata = self._file.metadata
        self._stops = np.cumsum([metadata.row_group(group).num_rows for group in range(metadata.num_row_groups)])
        self._group: int | None = None
        self._rows: pa.Table | None = None

    def row(self, position: int) -> dict[str, Any]:
        """A row as Python values.

        Raises:
            IndexError: The file ends before.
            OSError, ArrowException: It cannot be read.
        """
        group = int(np.searchsorted(self._stops, position, side="right"))
        if position < 0 or group == len(self._stops):
            raise IndexError(f"there is no row {position}")
        if group != self._group or self._rows is None:
            self._group, self._rows = group, self._file.read_row_group(group)
        start = int(self._stops[group - 1]) if group else 0
        return dict(self._rows.slice(position - start, 1).to_pylist()[0])
