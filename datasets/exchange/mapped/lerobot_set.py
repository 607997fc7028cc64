"""A LeRobotDataset that others wrote, v2.0 to v3.0: Parquet with numbers and pictures, videos beside it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from handsight.datasets.errors import DatasetError, InterchangeError, headline
from handsight.datasets.exchange.bundle import refuse_linked
from handsight.datasets.exchange.mapped.episodes import MOST_FRAMES
from handsight.datasets.exchange.mapped.video import VideoFrames
from handsight.datasets.exchange.pictures import decoded
from handsight.datasets.machine import of_the_machine

_VERSIONS = ("v2.0", "v2.1", "v3.0")
_MOST_ROWS = 5 * MOST_FRAMES


@contextmanager
def open_set(path: Path) -> Iterator[LeRobotSet]:
    """Open a folder.

    Raises:
        InterchangeError: It is no LeRobotDataset of a version that is known, is damaged, or holds links.
    """
    refuse_linked(path)
    try:
        found = LeRobotSet(path)
    except DatasetError:
        raise
    except (OSError, KeyError, ValueError, TypeError, AttributeError, pa.ArrowException, RecursionError) as error:
        if trouble := of_the_machine(f"{path} cannot be read", error):
            raise trouble from error
        raise InterchangeError(
            f"{path} is no LeRobotDataset of {_VERSIONS[0]} to {_VERSIONS[-1]} ({type(error).__name__}: "
            f"{headline(error)}): take an undamaged copy"
        ) from error
    try:
        yield found
    finally:
        found.close()


class LeRobotSet:
    """The episodes of a folder."""

    def __init__(self, path: Path) -> None:
        self._path = path
        info = _object(json.loads((path / "meta/info.json").read_text()), "meta/info.json")
        version = info.get("codebase_version")
        if version not in _VERSIONS:
            raise InterchangeError(f"{path} is a LeRobotDataset {version!r}, expected {', '.join(_VERSIONS)}")
        self.format = f"lerobot {version}"
        self._info = info
        self._features = {name: _object(one, name) for name, one in _object(info["features"], "features").items()}
        self._places = _places(path)
        self.names = [f"episode {number}" for number in self._places]
        self._episodes = _episode_table(path, str(version))
        self._numbers = list(self._places)
        self._videos = VideoFrames()
        self._columns: dict[tuple[Path, str], pa.ChunkedArray] = {}

    def close(self) -> None:
        """Close the video that is open."""
        self._videos.close()

    def faults(self, *, numbers: Sequence[str], pictures: Sequence[str]) -> list[str]:
        """What keeps these columns from being read, as far as ``info.json`` says."""
        known = ", ".join(self._features) or "none"
        faults = []
        for column in numbers:
            kind = self._features.get(column, {}).get("dtype")
            if column not in self._features and not any(column in one for one in self._episodes.values()):
                faults.append(f"{column} is no feature, and no column of the episodes; there are {known}")
            elif kind in ("image", "video"):
                faults.append(f"{column} is a feature of {kind}s, expected numbers")
        for column in pictures:
            feature = self._features.get(column, {})
            if feature.get("dtype") not in ("image", "video"):
                seen = [name for name, one in self._features.items() if one.get("dtype") in ("image", "video")]
                faults.append(f"{column} is no feature of pictures; there are {', '.join(seen) or 'none'}")
            elif feature["dtype"] == "video" and _is_depth(feature):
                faults.append(f"{column} is depth encoded as video, which is lossy: store it as images")
        return faults

    def depth_unit_m(self, column: str) -> float | None:
        """What LeRobot noted when the depth was recorded."""
        details = self._features.get(column, {}).get("info")
        unit = details.get("depth_unit") if isinstance(details, dict) else None
        return {"mm": 1e-3, "m": 1.0}.get(unit) if isinstance(unit, str) else None

    def values(self, episode: int, column: str) -> NDArray[Any]:
        """A column of an episode, from the data or from what is said of episodes."""
        number = self._numbers[episode]
        file, first, length = self._places[number]
        if column in self._features:
            rows = self._read(file, column).slice(first, length).to_pylist()
        else:
            rows = [self._episodes.get(number, {}).get(column)]
        try:
            values = np.asarray(rows)
        except ValueError as error:
            raise InterchangeError(f"{column} has rows of different length") from error
        return values.reshape(len(values), -1) if values.ndim > 2 else values

    def picture(self, episode: int, column: str, frame: int) -> NDArray[Any]:
        """One picture of an episode."""
        number = self._numbers[episode]
        if self._features[column].get("dtype") == "video":
            return self._video_frame(number, column, frame)
        file, first, _ = self._places[number]
        cell = self._cell(file, column, first + frame)
        if not isinstance(cell, dict) or not isinstance(cell.get("bytes"), bytes):
            raise InterchangeError(f"{column} has no picture in frame {frame}, expected its bytes in {file.name}")
        return decoded(cell["bytes"])

    def _read(self, file: Path, column: str) -> pa.ChunkedArray:
        """A whole column of a file; the last file's are kept, because its episodes come one after the other."""
        if (file, column) not in self._columns:
            self._columns = {key: rows for key, rows in self._columns.items() if key[0] == file}
            with _reading(file, column):
                self._columns[file, column] = pq.read_table(file, columns=[column])[column]
        return self._columns[file, column]

    def _cell(self, file: Path, column: str, row: int) -> Any:
        with _reading(file, column):
            parquet = pq.ParquetFile(file)
            for group in range(parquet.num_row_groups):
                rows = parquet.metadata.row_group(group).num_rows
                if row < rows:
                    for batch in parquet.iter_batches(batch_size=8, row_groups=[group], columns=[column]):
                        if row < len(batch):
                            return batch[0][row].as_py()
                        row -= len(batch)
                row -= rows
        raise InterchangeError(f"{file} ends before a frame that its episodes have")

    def _video_frame(self, number: int, column: str, frame: int) -> NDArray[np.uint8]:
        said = self._episodes.get(number, {})
        place = {
            "video_key": column,
            "episode_index": number,
            "episode_chunk": number // max(1, _count(self._info.get("chunks_size"), 1000)),
            "chunk_index": said.get(f"videos/{column}/chunk_index", 0),
            "file_index": said.get(f"videos/{column}/file_index", 0),
        }
        try:
            path = (self._path / str(self._info["video_path"]).format(**place)).resolve()
            started_s = float(said.get(f"videos/{column}/from_timestamp") or 0)
            start = round(started_s * float(self._info["fps"]))
        except (KeyError, ValueError, TypeError, IndexError, AttributeError, OverflowError) as error:
            raise InterchangeError(f"where the video of {column} lies is not said: {headline(error)}") from error
        if not path.is_relative_to(self._path.resolve()):
            raise InterchangeError(f"the video of {column} is not in the folder: {path}")
        details = self._features[column].get("info") or self._features[column].get("video_info") or {}
        codec = details.get("video.codec", "unknown") if isinstance(details, dict) else "unknown"
        return self._videos.frame(path, start + frame, codec=str(codec))


def _places(path: Path) -> dict[int, tuple[Path, int, int]]:
    """For each episode its data file, its first row there, and how many rows it has."""
    places: dict[int, tuple[Path, int, int]] = {}
    for file in sorted(path.glob("data/*/*.parquet")):
        with _reading(file, "episode_index"):
            if pq.read_metadata(file).num_rows > _MOST_ROWS:
                raise InterchangeError(f"{file} claims more than {_MOST_ROWS} rows")
            index = pq.read_table(file, columns=["episode_index"])["episode_index"].to_numpy()
        if index.dtype.kind not in "iu":
            raise InterchangeError(f"episode_index in {file} is {index.dtype}, expected whole numbers")
        begins = np.concatenate(([0], np.flatnonzero(np.diff(index)) + 1)) if len(index) else np.array([], np.int64)
        for first, end in zip(begins, [*begins[1:], len(index)], strict=True):
            number = int(index[first])
            if number in places:
                raise InterchangeError(f"episode {number} lies in two places, the second in {file}")
            places[number] = (file, int(first), int(end - first))
    if not places:
        raise InterchangeError(f"{path} has no episodes in data/*/*.parquet")
    return dict(sorted(places.items()))


def _episode_table(path: Path, version: str) -> dict[int, dict[str, Any]]:
    """What is said of each episode; statistics are left out."""
    rows: list[Any] = []
    if version == "v3.0":
        for file in sorted(path.glob("meta/episodes/*/*.parquet")):
            with _reading(file, "episodes"):
                names = [name for name in pq.read_schema(file).names if not name.startswith("stats/")]
                rows += pq.read_table(file, columns=names).to_pylist()
    else:
        lines = (path / "meta/episodes.jsonl").read_text().splitlines()
        rows = [json.loads(line) for line in lines if line.strip()]
    return {int(_object(row, "an episode")["episode_index"]): row for row in rows}


def _object(value: object, what: str) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise InterchangeError(f"{what} is {type(value).__name__}, expected an object")
    return dict(value)


def _count(value: object, otherwise: int) -> int:
    return value if isinstance(value, int) else otherwise


def _is_depth(feature: Mapping[str, Any]) -> bool:
    details = feature.get("info") or {}
    return isinstance(details, dict) and bool(details.get("is_depth_map") or details.get("video.is_depth_map"))


@contextmanager
def _reading(file: Path, column: str) -> Iterator[None]:
    try:
        yield
    except DatasetError:
        raise
    except (OSError, KeyError, ValueError, TypeError, IndexError, MemoryError, pa.ArrowException) as error:
        if trouble := of_the_machine(f"{file} cannot be read", error):
            raise trouble from error
        raise InterchangeError(f"{column} cannot be read from {file}: {headline(error)}") from error
