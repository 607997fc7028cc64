"""Reading recordings back, as Rerun itself would, for the tests of the room."""

from __future__ import annotations

import subprocess
import warnings
from collections.abc import Iterable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from rerun.chunk import RrdReader

Rows = list[tuple[int | None, Any]]
"""Values in the order of their time; None for those that hold at all times."""
Content = dict[str, dict[str, Rows]]
"""Entity, component, rows."""

ROW_ID = "rerun.controls.RowId"


def read_recording(path: Path, *, timeline: str) -> Content:
    """Everything in a recording but its row ids, which are drawn from the clock."""
    return _content(RrdReader(str(path)).store().stream().to_chunks(), timeline)


def read_received(path: Path, *, timeline: str) -> Content:
    """The same of a file that took a stream: it has no end, and the layout is in it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Rerun warns of the missing end.
        return _content(RrdReader(str(path)).stream().to_chunks(), timeline)


def _content(chunks: Iterable[Any], timeline: str) -> Content:
    content: Content = {}
    for chunk in chunks:
        columns = chunk.to_record_batch().to_pydict()
        columns.pop(ROW_ID)
        count = len(next(iter(columns.values())))
        times = columns.pop(timeline, [None] * count)
        for name, values in columns.items():
            content.setdefault(chunk.entity_path, {}).setdefault(name, []).extend(zip(times, values, strict=True))
    for components in content.values():
        for rows in components.values():
            rows.sort(key=lambda row: -1 if row[0] is None else row[0])
    return content


def scalars(content: Mapping[str, Mapping[str, Rows]], entity: str) -> list[tuple[int | None, float]]:
    """The points of a plotted line."""
    return [(time, value[0]) for time, value in content[entity]["Scalars:scalars"]]


def at(rows: Rows, time: int) -> Any:
    """The value logged at a time."""
    return dict(rows)[time]


def decode(contents: ArrayLike) -> NDArray[Any]:
    """An encoded picture's pixels, colours in the order red, green, blue (and opacity)."""
    pixels = cv2.imdecode(np.asarray(contents, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    assert pixels is not None
    if pixels.ndim == 2:
        return pixels
    return cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB if pixels.shape[2] == 3 else cv2.COLOR_BGRA2RGBA)


def read_picture(path: Path) -> NDArray[Any]:
    """The pixels of a picture file."""
    return decode(np.frombuffer(path.read_bytes(), dtype=np.uint8))


def colours(picture: NDArray[Any]) -> int:
    """How many different colours a picture has."""
    # One number for each pixel: rows take many times as long to sort.
    shifts = np.arange(0, 8 * picture.shape[-1], 8, dtype=np.uint32)
    return len(np.unique((picture.astype(np.uint32) << shifts).sum(axis=-1, dtype=np.uint32)))


def verify(path: Path) -> subprocess.CompletedProcess[str]:
    """Run ``rerun rrd verify`` on a file."""
    package = find_spec("rerun_cli")
    assert package is not None
    assert package.origin is not None
    viewer = Path(package.origin).with_name("rerun")
    return subprocess.run(
        [str(viewer), "rrd", "verify", str(path)], capture_output=True, text=True, check=False, timeout=60
    )
