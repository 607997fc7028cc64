"""Rows by position."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from handsight.datasets.exchange.parquet_rows import RowReader


@pytest.mark.parametrize("group", [1, 3, 7, 100])
def test_rows_are_found_however_the_file_is_divided(tmp_path: Path, group: int) -> None:
    pq.write_table(pa.table({"at": list(range(7))}), tmp_path / "rows.parquet", row_group_size=group)
    reader = RowReader(tmp_path / "rows.parquet")
    assert [reader.row(position)["at"] for position in (0, 1, 6, 3, 2)] == [0, 1, 6, 3, 2]
    for outside in (-1, 7):
        with pytest.raises(IndexError):
            reader.row(outside)
