"""HDF5 as robomimic lays it out: a group ``data/demo_<k>`` for each episode, a dataset in it for each column."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from handsight.datasets.errors import DatasetError, InterchangeError, counted, headline
from handsight.datasets.exchange.mapped.episodes import MOST_FRAMES
from handsight.datasets.format.quantities import PICTURE_SIDE
from handsight.datasets.machine import of_the_machine

_DEMOS = "data"
_NAMES_SHOWN = 12


@contextmanager
def open_set(path: Path) -> Iterator[Hdf5Set]:
    """Open a file.

    Raises:
        InterchangeError: It is no HDF5, or holds no demos.
    """
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        if trouble := of_the_machine(f"{path} cannot be read", error):
            raise trouble from error
        raise InterchangeError(
            f"{path} cannot be opened as HDF5 ({headline(error)}): take an undamaged copy"
        ) from error
    with file:
        try:
            data = _child(file, _DEMOS)
            names = sorted(data, key=_order) if isinstance(data, h5py.Group) else []
        except (OSError, RuntimeError, KeyError, ValueError) as error:
            if trouble := of_the_machine(f"{path} cannot be read", error):
                raise trouble from error
            raise InterchangeError(f"{path} cannot be read ({headline(error)}): take an undamaged copy") from error
        if not names:
            raise InterchangeError(f"{path} has no demos: a map expects a group {_DEMOS}/demo_<k> for each attempt")
        yield Hdf5Set(data, names)


class Hdf5Set:
    """The demos of an open file."""

    format = "hdf5"

    def __init__(self, data: h5py.Group, names: Sequence[str]) -> None:
        self._data = data
        self.names = names

    def faults(self, *, numbers: Sequence[str], pictures: Sequence[str]) -> list[str]:
        """What keeps these columns from being read in the first demo; the others are looked at as they are read."""
        faults = []
        for column in (*numbers, *pictures):
            try:
                self._node(0, column)
            except InterchangeError as error:
                faults.append(str(error))
        return faults

    def depth_unit_m(self, column: str) -> float | None:
        """HDF5 has no place for it."""
        return None

    def values(self, episode: int, column: str) -> NDArray[Any]:
        """A column of a demo, or one of its attributes."""
        node = self._node(episode, column)
        if not isinstance(node, h5py.Dataset):
            return np.atleast_1d(np.asarray(node))
        with _reading(node.name):
            flat = node[()] if node.shape == () else node[:]
        return np.asarray(flat).reshape(len(flat), -1) if np.ndim(flat) > 2 else np.atleast_1d(np.asarray(flat))

    def picture(self, episode: int, column: str, frame: int) -> NDArray[Any]:
        """One picture of a demo."""
        node = self._node(episode, column)
        if (
            not isinstance(node, h5py.Dataset)
            or node.ndim not in (3, 4)
            or any(map(PICTURE_SIDE.impossible, node.shape[1:3]))
        ):
            raise InterchangeError(f"{column} holds no pictures of at most {PICTURE_SIDE.possible[1]:g} pixels a side")
        if frame >= len(node):
            raise InterchangeError(f"{column} has {counted(len(node), 'frame')}, and frame {frame} is asked for")
        with _reading(node.name):
            return np.asarray(node[frame])

    def _node(self, episode: int, column: str) -> Any:
        """A dataset, or the value of an attribute."""
        name = self.names[episode]
        with _reading(f"{name}: {column}"):
            demo = _child(self._data, name)
            if not isinstance(demo, h5py.Group):
                raise InterchangeError(f"{name} is no group")
            if column.startswith("@"):
                if column[1:] not in demo.attrs:
                    raise InterchangeError(f"{column} is no attribute of {name}, which has {_some(demo.attrs)}")
                return demo.attrs[column[1:]]
            node: Any = demo
            for part in column.strip("/").split("/"):
                node = _child(node, part) if isinstance(node, h5py.Group) else None
            if not isinstance(node, h5py.Dataset):
                raise InterchangeError(f"{column} is not in {name}, which has {_some(_datasets(demo))}")
            if node.external or node.is_virtual:
                raise InterchangeError(f"{column} keeps its data in other files: repack it with h5repack")
            picture = node.ndim > 2 and node.dtype.itemsize * int(np.prod(node.shape[1:])) > 1 << 12
            row_bytes = 1 if picture else node.dtype.itemsize * max(1, int(np.prod(node.shape[1:])))
            if node.shape and node.shape[0] * row_bytes > 64 * MOST_FRAMES:
                raise InterchangeError(f"{column} claims shape {node.shape}, expected at most {MOST_FRAMES} frames")
            return node


@contextmanager
def _reading(what: str) -> Iterator[None]:
    try:
        yield
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, MemoryError) as error:
        if isinstance(error, DatasetError):
            raise
        if trouble := of_the_machine(f"{what} cannot be read", error):
            raise trouble from error
        raise InterchangeError(f"{what} cannot be read ({headline(error)})") from error


def _child(group: h5py.Group, name: str) -> Any:
    """What lies in a group; links are not followed."""
    if name not in group:
        return None
    if not isinstance(group.get(name, getlink=True), h5py.HardLink):
        raise InterchangeError(f"{group.name}/{name} is a link: links are not followed; remove it")
    return group[name]


def _datasets(demo: h5py.Group) -> list[str]:
    names: list[str] = []
    demo.visititems(lambda name, node: names.append(name) if isinstance(node, h5py.Dataset) else None)
    return names


def _some(names: Any) -> str:
    listed = sorted(str(name) for name in names)
    more = f" and {len(listed) - _NAMES_SHOWN} more" if len(listed) > _NAMES_SHOWN else ""
    return (", ".join(listed[:_NAMES_SHOWN]) or "none") + more


def _order(name: str) -> tuple[str, int, str]:
    """demo_2 comes before demo_10."""
    stem, digits = re.fullmatch(r"(.*?)(\d{0,9})", name, re.DOTALL).groups()  # type: ignore[union-attr]
    return (stem, int(digits or 0), name)
