"""The formats there are, and which of them a path holds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from handsight.datasets.errors import InterchangeError
from handsight.datasets.exchange import hdf5, image_table, lerobot, lerobot_export, plain_zarr
from handsight.datasets.exchange.bundle import Bundle
from handsight.datasets.reading.reader import GraspDataset

OnAttempt = Callable[[], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """One format and what can be done with it."""

    name: str
    description: str
    recognises: Callable[[Path], bool]
    """Whether a path looks like this format; reads little and believes nothing."""
    open: Callable[[Path], AbstractContextManager[Bundle]]
    """Opens what is to be imported; its attempts are read while the context lasts."""
    write: Callable[[GraspDataset, Path, OnAttempt], None] | None = None
    """Writes a version to a path that does not exist; None where the format is only read."""


FORMATS: tuple[Format, ...] = (
    Format(
        name="hdf5",
        description="one HDF5 file in the layout of robomimic",
        recognises=hdf5.recognises,
        open=hdf5.open_bundle,
        write=hdf5.write,
    ),
    Format(
        name="zarr",
        description="a plain Zarr v3 folder that opens with zarr alone",
        recognises=plain_zarr.recognises,
        open=plain_zarr.open_bundle,
        write=plain_zarr.write,
    ),
    Format(
        name="lerobot",
        description="a LeRobotDataset v3.0 folder",
        recognises=lerobot.recognises,
        open=lerobot.open_bundle,
        write=lerobot_export.write,
    ),
    Format(
        name="images",
        description="a folder of pictures with attempts.csv and station.json",
        recognises=image_table.recognises,
        open=image_table.open_bundle,
    ),
)

EXPORT_FORMATS = tuple(one.name for one in FORMATS if one.write is not None)
"""Names of the formats that can be written."""


def format_named(name: str) -> Format:
    """The format of that name.

    Raises:
        InterchangeError: There is none.
    """
    for one in FORMATS:
        if one.name == name:
            return one
    raise InterchangeError(f"format is {name!r}, expected one of {', '.join(one.name for one in FORMATS)}")


def format_of(path: Path) -> Format:
    """The format that a path holds.

    Raises:
        InterchangeError: It looks like none of the formats.
    """
    for one in FORMATS:
        if one.recognises(path):
            return one
    known: Sequence[str] = [f"{one.name} ({one.description})" for one in FORMATS]
    raise InterchangeError(
        f"{path} is in no known format, expected {'; '.join(known)}. Pictures of your own take an attempts.csv and a "
        "station.json beside them, a LeRobot or HDF5 set of other origin a map (--map map.toml): see docs/datasets.md"
    )
