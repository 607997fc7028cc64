"""Solids keep their volume wherever they are turned."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from handsight.collection.sim.objects.household.finishes import WHITE, plain
from handsight.collection.sim.objects.household.solids import lathe
from handsight.collection.sim.objects.household.surface import collision_part

extents_mm = st.floats(5.0, 200.0)


@given(st.integers(3, 16), extents_mm, extents_mm, st.sampled_from("xyz"), st.floats(-180, 180))
def test_a_turned_frustum_keeps_its_volume_and_stays_convex(
    sides: int, low_mm: float, high_mm: float, axis: str, degrees: float
) -> None:
    part = collision_part(
        lathe([(0.0, low_mm), (50.0, high_mm)], sides, plain(WHITE)).turned(axis, degrees).at(9, 8, 7)
    )
    areas_mm2 = [0.5 * sides * radius**2 * math.sin(2 * math.pi / sides) for radius in (low_mm, high_mm)]
    # Volume of a frustum, from its two ends and their geometric mean.
    expected_m3 = 50.0 / 3 * (sum(areas_mm2) + math.sqrt(math.prod(areas_mm2))) * 1e-9
    volume_m3 = np.linalg.det(part.vertices_m[part.triangles]).sum() / 6
    assert volume_m3 == pytest.approx(expected_m3, rel=1e-9)
    assert ConvexHull(part.vertices_m).volume == pytest.approx(expected_m3, rel=1e-6)
