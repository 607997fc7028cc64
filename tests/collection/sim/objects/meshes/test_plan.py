"""What an import would make, said before it is made."""

from __future__ import annotations

import json
import os
import struct
from pathlib import Path

import pytest
from tests.support.meshes import block, cuboid, pyramid, stl

from handsight.cli.app import run
from handsight.collection.errors import MeshImportError
from handsight.collection.sim.objects.cache import cache_root
from handsight.collection.sim.objects.meshes.importer import carry_out, import_folder
from handsight.collection.sim.objects.meshes.plan import ImportSettings, plan_import


def test_a_dry_run_tells_what_an_import_makes(meshes: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (meshes / "cube.stl").write_bytes(stl(block(0.05)))
    (meshes / "bad.stl").write_bytes(b"")
    words = ["objects", "import", str(meshes), "--name", "mine", "--skip-bad", "--density", "1000", "--json"]
    assert run([*words, "--dry-run"]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert not cache_root().exists()
    assert run(words) == 0
    report = json.loads(capsys.readouterr().out)
    (planned,), (made,) = plan["objects"], report["objects"]
    assert planned["mass_kg"] == pytest.approx(0.125)
    assert planned["triangles"] == 12
    assert {key: planned[key] for key in ("name", "source", "size_m", "mass_kg")} == {
        key: made[key] for key in ("name", "source", "size_m", "mass_kg")
    }
    assert plan["folder"] == report["folder"]
    assert plan["skipped"] == report["skipped"] == [{"path": str(meshes / "bad.stl"), "reason": "the file is empty"}]
    assert run(["objects", "ls", "--json"]) == 0
    (listed,) = [one for one in json.loads(capsys.readouterr().out) if one["name"] == "mine"]
    assert (listed["objects"], listed["folder"]) == (1, report["folder"])


def test_a_picture_that_changes_makes_another_set(meshes: Path) -> None:
    (meshes / "skin.mtl").write_text("newmtl m\nmap_Kd skin.bmp\n")
    (meshes / "skin.obj").write_bytes(pyramid("skin.mtl"))
    header = b"BM" + struct.pack("<IIIIIIHHIIIIII", 58, 0, 54, 40, 1, 1, 1, 24, 0, 4, 0, 0, 0, 0)
    (meshes / "skin.bmp").write_bytes(header + b"\x00\x00\xff\x00")
    plan = plan_import(meshes, "mine")
    assert [sorted(one.sha256) for one in plan.objects] == [["skin.bmp", "skin.mtl", "skin.obj"]]
    assert carry_out(plan).objects[0].source_sha256 == plan.objects[0].sha256["skin.obj"]
    assert plan_import(meshes, "mine").reused
    (meshes / "skin.bmp").write_bytes(header + b"\xff\x00\x00\x00")
    with pytest.raises(MeshImportError, match="made from other meshes or settings"):
        plan_import(meshes, "mine")


def test_settings_that_no_manifest_could_hold(meshes: Path) -> None:
    (meshes / "cube.stl").write_bytes(stl(block()))
    with pytest.raises(MeshImportError, match=r"licence is .*expected printable text"):
        plan_import(meshes, "mine", settings=ImportSettings(licence=os.fsdecode(b"\xff")))


def test_wrong_arguments_are_all_reported(meshes: Path) -> None:
    settings = ImportSettings(scale=0.0, density_kg_m3=float("nan"))
    with pytest.raises(MeshImportError) as caught:
        import_folder(meshes / "nowhere", "a b", settings=settings)
    for fault in ("scale is 0", "density_kg_m3 is nan", "set name is 'a b'", "is missing, expected a folder"):
        assert fault in str(caught.value)


@pytest.mark.parametrize("name", ["household-train", "../up", ".hidden", ""])
def test_a_set_cannot_take_such_a_name(meshes: Path, name: str) -> None:
    cuboid().export(meshes / "cup.stl")
    with pytest.raises(MeshImportError, match="set name"):
        import_folder(meshes, name)
