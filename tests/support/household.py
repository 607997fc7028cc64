"""The household objects, as their tests go through them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handsight.collection.sim.objects.household.table import TEST, TRAIN, HouseholdObject
from handsight.collection.sim.objects.urdf import RigidObject

EVERYTHING = (*TRAIN, *TEST)
SETS = ("household-train", "household-test")


def vertices_m(model: RigidObject) -> NDArray[np.float64]:
    return np.concatenate([part.vertices_m for part in model.parts])


def entry_named(name: str) -> HouseholdObject:
    return next(item for item in EVERYTHING if item.name == name)
