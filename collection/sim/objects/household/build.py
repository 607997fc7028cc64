"""From an entry of the table to the object that is written to disk."""

from __future__ import annotations

from handsight.collection.sim.objects.household.finishes import pack
from handsight.collection.sim.objects.household.surface import collision_part, skin
from handsight.collection.sim.objects.household.table import HouseholdObject, rng_of
from handsight.collection.sim.objects.urdf import RigidObject


def rigid_object(item: HouseholdObject) -> RigidObject:
    """Parts, skin and texture of one object; the same on every call."""
    solids = item.build(rng_of(item))
    atlas = pack([finish for solid in solids for finish in (solid.side, solid.ends)])
    return RigidObject(
        name=item.name,
        parts=[collision_part(solid) for solid in solids],
        skin=skin(solids, atlas),
        texture=atlas.pixels,
        colour=(1.0, 1.0, 1.0),
        mass_kg=item.mass_kg,
        friction=item.friction,
    )
