"""Mass and inertia against the textbook."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support.household import vertices_m

from handsight.collection.sim.objects.household.build import rigid_object
from handsight.collection.sim.objects.household.finishes import WHITE, plain
from handsight.collection.sim.objects.household.solids import box
from handsight.collection.sim.objects.household.surface import collision_part
from handsight.collection.sim.objects.household.table import TRAIN
from handsight.collection.sim.objects.urdf import mass_properties

extents_mm = st.floats(5.0, 200.0)
shifts_mm = st.floats(-100.0, 100.0)


@given(st.tuples(extents_mm, extents_mm, extents_mm), st.tuples(shifts_mm, shifts_mm, shifts_mm))
def test_mass_properties_of_a_box(size_mm: tuple[float, float, float], shift_mm: tuple[float, float, float]) -> None:
    """Inertia about the centre of mass follows the textbook, wherever the box is."""
    mass_kg = 0.5
    mass = mass_properties([collision_part(box(*size_mm, plain(WHITE)).at(*shift_mm))], mass_kg)
    middle_mm = np.add(shift_mm, (0, 0, size_mm[2] / 2))
    assert mass.centre_m == pytest.approx(middle_mm / 1000, abs=1e-6)
    x2, y2, z2 = np.square(np.array(size_mm) / 1000)
    assert mass.inertia_kg_m2 == pytest.approx(mass_kg / 12 * np.diag([y2 + z2, x2 + z2, x2 + y2]), abs=2e-9)


def test_a_steel_head_pulls_the_centre_of_mass_towards_it() -> None:
    hammer = rigid_object(next(item for item in TRAIN if item.name == "hammer"))
    low, high = vertices_m(hammer)[:, 0].min(), vertices_m(hammer)[:, 0].max()
    assert mass_properties(hammer.parts, 1.0).centre_m[0] > low + 0.6 * (high - low)
