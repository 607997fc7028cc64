"""What CoACD makes of solids, and what is said where it makes nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from tests.support.meshes import block, cuboid, cup, inverted

from handsight.collection.sim.bullet import BulletClient
from handsight.collection.sim.objects.catalogue import load_object_set
from handsight.collection.sim.objects.meshes.decomposition import Cutter
from handsight.collection.sim.objects.meshes.fault import MeshFault
from handsight.collection.sim.objects.meshes.importer import import_folder
from handsight.collection.sim.objects.meshes.solid import Solid, make_solid


def test_what_coacd_cannot_cut_is_a_fault_and_the_next_mesh_is_cut() -> None:
    tangle = trimesh.creation.icosphere(subdivisions=3, radius=0.04)
    tangle.vertices += np.random.default_rng(0).normal(scale=0.01, size=tangle.vertices.shape)
    wild = trimesh.Trimesh(vertices=block().vertices, faces=block().faces + 10**7, process=False)
    with Cutter(limit_s=1) as cutter, pytest.raises(MeshFault, match="takes CoACD more than 1 s"):
        cutter.convex_parts(one_body(tangle))
    with Cutter() as cutter:
        with pytest.raises(MeshFault, match="makes CoACD crash"):
            cutter.convex_parts(one_body(wild))
        assert len(cutter.convex_parts(one_body(block()))) == 1


def one_body(mesh: trimesh.Trimesh) -> Solid:
    return Solid(surface=mesh, bodies=(mesh,))


def test_bodies_are_cut_one_by_one() -> None:
    """Together, two cubes with a narrow gap take CoACD minutes, and cubes that overlap many seconds."""
    for pair in (block() + block(x_m=0.0505), block() + block(x_m=0.03), block(0.06) + block(0.05)):
        with Cutter() as cutter:
            parts = cutter.convex_parts(make_solid(pair))
        assert len(parts) == 2
    hollow = make_solid(block(0.06) + inverted(block(0.04)))
    assert len(hollow.bodies) == 1
    assert hollow.volume_m3 == pytest.approx(0.06**3 - 0.04**3)


def test_a_hollow_survives_the_decomposition(bullet: BulletClient, meshes: Path) -> None:
    cup().export(meshes / "cup.ply")
    import_folder(meshes, "cups")
    (model,) = load_object_set("cups")
    bullet.loadURDF(str(model.urdf))
    ((body, _, _, position, _),) = bullet.rayTest((0, 0, 0.1), (0, 0, -0.1))
    assert body >= 0
    # The centre of mass is below the middle: a lid would be 25 mm and more above it, the floor is below.
    assert position[2] < 0
    text = (model.urdf.parent / "collision.obj").read_text()
    assert 2 <= text.count("o convex_") <= 12


def test_a_decomposition_has_the_same_bytes_again(meshes: Path) -> None:
    pair = cuboid()
    pair.apply_translation((0.0605, 0, 0))
    pair += cuboid()
    pair.export(meshes / "pair.stl")
    first, second = (import_folder(meshes, name) for name in ("one", "two"))
    assert first.objects[0].sha256 == second.objects[0].sha256
