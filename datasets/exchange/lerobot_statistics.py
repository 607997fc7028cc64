"""Statistics of a LeRobotDataset: of every feature, over all episodes and for each, in the shapes LeRobot computes.

LeRobot reckons from a sample of the pixels and from histograms; these are exact. An episode has one frame, so the
statistics of a number in it are the number itself. What stands in for something that a row lacks is in the statistics
of its episode, as LeRobot would compute them, but not in those of the dataset.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
MEASURES = ("min", "max", "mean", "std", *QUANTILES)

Measures = dict[str, list[Any]]
"""Values by the name of the measure, and ``count``, the number of frames."""


class NumberStatistics:
    """Of a feature that is a number or a vector of ``width`` numbers."""

    def __init__(self, width: int) -> None:
        self._width = width
        self._values, self._valid = array("d"), array("b")

    def add(self, value: object, *, valid: bool) -> None:
        """Take the value of one more row."""
        self._values.extend(np.atleast_1d(np.asarray(value, np.float64)))
        self._valid.append(valid)

    def overall(self) -> Measures:
        """Over the rows that are valid."""
        values = self._table()[np.frombuffer(self._valid, np.int8) != 0]
        if not len(values):
            values = np.zeros((1, self._width))
        quantiles = np.quantile(values, list(QUANTILES.values()), axis=0)
        found = {name: getattr(values, name)(axis=0).tolist() for name in ("min", "max", "mean", "std")}
        found |= dict(zip(QUANTILES, quantiles.tolist(), strict=True))
        return {**found, "count": [len(values)]}

    def by_episode(self) -> dict[str, pa.Array]:
        """One list for each row, by the name of the measure."""
        values = self._table()
        zeros = np.zeros_like(values)
        lists = {name: _lists(zeros if name == "std" else values) for name in MEASURES}
        return {**lists, "count": _lists(np.ones((len(values), 1), np.int64))}

    def _table(self) -> NDArray[np.float64]:
        return np.frombuffer(self._values, np.float64).reshape(-1, self._width)


class PictureStatistics:
    """Of a feature with pictures of some channels, whose pixels are whole numbers times a unit."""

    def __init__(self, channels: int) -> None:
        self._channels = channels
        self._rows = {name: array("d") for name in MEASURES}
        self._counts: dict[float, NDArray[np.int64]] = {}
        self._frames = 0

    def add(self, picture: NDArray[np.integer[Any]], *, unit: float, valid: bool) -> None:
        """Take one more picture, shape (H, W, channels) or (H, W), with what a pixel of 1 is worth."""
        pixels = picture.reshape(-1, self._channels)
        levels = int(np.iinfo(picture.dtype).max) + 1
        counts = np.stack([np.bincount(pixels[:, one], minlength=levels) for one in range(self._channels)])
        for name, values in _of_counts(counts, np.arange(levels, dtype=np.float64) * unit).items():
            self._rows[name].extend(values)
        if valid:
            self._counts[unit] = self._counts.get(unit, 0) + counts
            self._frames += 1

    def overall(self) -> Measures:
        """Over the pictures that are valid, each measure of shape (channels, 1, 1)."""
        counts = np.concatenate(list(self._counts.values()), axis=1)
        levels = np.concatenate(
            [np.arange(one.shape[1], dtype=np.float64) * unit for unit, one in self._counts.items()]
        )
        order = np.argsort(levels, kind="stable")
        found = _of_counts(counts[:, order], levels[order])
        return {**{name: values.reshape(-1, 1, 1).tolist() for name, values in found.items()}, "count": [self._frames]}

    def by_episode(self) -> dict[str, pa.Array]:
        """One nested list for each row, by the name of the measure."""
        tables = {name: np.frombuffer(rows).reshape(-1, self._channels, 1, 1) for name, rows in self._rows.items()}
        lists = {name: _lists(values) for name, values in tables.items()}
        return {**lists, "count": _lists(np.ones((len(tables["min"]), 1), np.int64))}


Statistics = Mapping[str, NumberStatistics | PictureStatistics]
"""By the name of the feature."""


def episode_columns(features: Statistics) -> dict[str, pa.Array]:
    """The columns of ``meta/episodes`` that hold the statistics of each episode."""
    columns: dict[str, pa.Array] = {}
    for name, feature in features.items():
        columns |= {f"stats/{name}/{measure}": values for measure, values in feature.by_episode().items()}
    return columns


def _of_counts(counts: NDArray[np.int64], levels: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Measures of pixels: ``counts``, shape (channels, L), of each of the ascending ``levels``, shape (L,)."""
    total = counts.sum(axis=1)
    mean = counts @ levels / total
    variance = [one @ (levels - centre) ** 2 / all_ for one, centre, all_ in zip(counts, mean, total, strict=True)]
    present = counts > 0
    reached = counts.cumsum(axis=1)
    quantiles = {name: levels[(reached >= share * total[:, None]).argmax(axis=1)] for name, share in QUANTILES.items()}
    return {
        "min": levels[present.argmax(axis=1)],
        "max": levels[len(levels) - 1 - present[:, ::-1].argmax(axis=1)],
        "mean": mean,
        "std": np.sqrt(variance),
        **quantiles,
    }


def _lists(values: NDArray[Any]) -> pa.Array:
    """An Arrow array of one list for each row of ``values``, nested as deep as its shape."""
    nested = pa.array(values.reshape(-1))
    for size in values.shape[:0:-1]:
        rows = len(nested) // size
        nested = pa.ListArray.from_arrays(np.arange(rows + 1, dtype=np.int32) * size, nested)
    return nested
