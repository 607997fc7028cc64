"""Set ``blocks``: the 1,000 procedural shapes that ship with PyBullet.

They are split as in PyBullet's own grasping environment: shapes whose number ends in 0 are held out for testing. Shape
168 is left out, its mesh holds NaN vertices.
"""

from __future__ import annotations

from pathlib import Path

import pybullet_data

from handsight.collection.sim.objects.model import ObjectModel

BLOCKS_BROKEN = 168
BLOCKS_SCALE = 0.7
"""Brings the median width of the shapes (92 mm as shipped) under the gripper's 85 mm stroke."""


def blocks(*, held_out: bool) -> tuple[ObjectModel, ...]:
    """The training shapes, or those held out for testing."""
    folder = Path(pybullet_data.getDataPath()) / "random_urdfs"
    return tuple(
        ObjectModel(
            object_id=f"blocks/{number:03d}", urdf=folder / f"{number:03d}" / f"{number:03d}.urdf", scale=BLOCKS_SCALE
        )
        for number in range(1000)
        if number != BLOCKS_BROKEN and (number % 10 == 0) == held_out
    )
