"""The generated set: the same bytes everywhere, and what PyBullet makes of it."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest
from tests.support.household import EVERYTHING, entry_named

from handsight.collection.sim.bullet import BulletClient
from handsight.collection.sim.objects.household.build import rigid_object
from handsight.collection.sim.objects.household.generate import write_household
from handsight.collection.sim.objects.manifest import MANIFEST_FILE, load_models, read_manifest
from handsight.collection.sim.objects.urdf import mass_properties

CONTENT_SHA256 = "86198acb8e5fa18c72aa9c5c6be3495dd52f3d7a65a8122684de8ff868c0dec7"
"""Of all hashes in the manifest. Should a change to the generators move it, raise GENERATOR_VERSION and set it anew."""


def test_generation_has_the_same_bytes_everywhere(household: Path, tmp_path: Path) -> None:
    write_household(tmp_path)
    assert (tmp_path / MANIFEST_FILE).read_bytes() == (household / MANIFEST_FILE).read_bytes()
    hashes = "".join(entry.sha256 for entry in read_manifest(household).objects)
    assert hashlib.sha256(hashes.encode()).hexdigest() == CONTENT_SHA256


def test_pybullet_loads_mass_friction_and_every_part(bullet: BulletClient, household: Path) -> None:
    for model, item in zip(load_models(household), EVERYTHING, strict=True):
        body = bullet.loadURDF(str(model.urdf))
        mass_kg, friction, *_ = bullet.getDynamicsInfo(body, -1)
        assert mass_kg == pytest.approx(item.mass_kg, abs=1e-4)
        assert friction == pytest.approx(item.friction)
        low, high = bullet.getAABB(body)
        # The frame is at the centre of mass, inside the object's box.
        assert all(a < 0 < b for a, b in zip(low, high, strict=True))


@pytest.mark.parametrize("name", ["mug", "bowl", "tape-roll", "wine-glass"])
def test_a_hollow_is_hollow_for_contact(bullet: BulletClient, household: Path, name: str) -> None:
    """A ray down the axis meets the floor, or nothing at all, and not a lid."""
    entry = next(entry for entry in read_manifest(household).objects if entry.name == name)
    centre_m = mass_properties(rigid_object(entry_named(name)).parts, 1.0).centre_m
    bullet.loadURDF(str(household / name / "object.urdf"), (0, 0, 0))
    axis = -centre_m[:2]
    top_m = entry.size_m[2] - centre_m[2]
    ((_, _, share, _, _),) = bullet.rayTest((*axis, top_m + 0.01), (*axis, top_m - entry.size_m[2] - 0.01))
    depth_m = share * (entry.size_m[2] + 0.02) - 0.01
    assert depth_m > 0.4 * entry.size_m[2]
