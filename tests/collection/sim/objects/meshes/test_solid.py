"""Surfaces that look inwards, and hollows."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.support.meshes import block, cuboid, inverted, stl

from handsight.collection.sim.objects.meshes.importer import import_folder
from handsight.collection.sim.objects.meshes.plan import plan_import


def test_pieces_that_look_inwards_are_turned_and_hollows_stay(meshes: Path) -> None:
    (meshes / "one-inverted.stl").write_bytes(stl(block() + inverted(block(x_m=0.0505))))
    (meshes / "all-inverted.stl").write_bytes(stl(inverted(block() + block(x_m=0.0505))))
    (meshes / "hollow.stl").write_bytes(stl(block(0.06) + inverted(block(0.04))))
    (meshes / "hollow-inverted.stl").write_bytes(stl(inverted(block(0.06) + inverted(block(0.04)))))
    masses = {one.name: one.mass_kg for one in plan_import(meshes, "mine").objects}
    solid, hollow = 2 * 0.05**3 * 400, (0.06**3 - 0.04**3) * 400
    expected = {"one-inverted": solid, "all-inverted": solid, "hollow": hollow, "hollow-inverted": hollow}
    assert masses == pytest.approx(expected, abs=1e-4)


def test_an_inside_out_mesh_is_turned(meshes: Path) -> None:
    mesh = cuboid()
    mesh.invert()
    mesh.export(meshes / "cup.stl")
    (entry,) = import_folder(meshes, "cups").objects
    assert entry.mass_kg == pytest.approx(0.06 * 0.05 * 0.04 * 400)
