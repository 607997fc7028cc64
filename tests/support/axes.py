"""Names of the axes of Zarr arrays, as xarray wants them."""

from __future__ import annotations

from typing import Any

import zarr
from zarr.core.metadata import ArrayV3Metadata


def axes_of(array: zarr.Array[Any]) -> tuple[str | None, ...] | None:
    """Their names; None where they have none."""
    assert isinstance(array.metadata, ArrayV3Metadata)
    return array.metadata.dimension_names


def arrays_of(group: zarr.Group) -> dict[str, zarr.Array[Any]]:
    return {name: node for name, node in group.members(max_depth=None) if isinstance(node, zarr.Array)}


def assert_axes_are_named(root: zarr.Group) -> None:
    """Whatever has one name in a group has one length, and no array with several axes has the name of one."""
    lengths: dict[tuple[str, str], int] = {}
    for path, array in arrays_of(root).items():
        group, _, name = path.rpartition("/")
        axes = axes_of(array)
        assert axes is not None, path
        assert len(set(axes)) == len(axes) == array.ndim, path
        assert all(axes), path
        assert name not in axes or array.ndim == 1, path
        for axis, length in zip(axes, array.shape, strict=True):
            assert axis is not None
            assert lengths.setdefault((group, axis), length) == length, (path, axis)
