"""Which files of a folder are meshes, and what the objects made of them are called."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from tests.support.meshes import block, cuboid, pyramid, refused_import, stl

from handsight.cli.app import run
from handsight.collection.errors import MeshImportError
from handsight.collection.sim.bullet import connect
from handsight.collection.sim.objects.catalogue import load_object_set
from handsight.collection.sim.objects.meshes.finding import find_meshes, object_names
from handsight.collection.sim.objects.meshes.importer import import_folder
from handsight.collection.sim.objects.meshes.plan import ImportSettings


def test_links_out_of_the_folder_are_not_followed(
    meshes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "secret.stl").write_bytes(stl(block()))
    (meshes / "out.stl").symlink_to(tmp_path / "secret.stl")
    (meshes / "nowhere.stl").symlink_to(tmp_path / "gone.stl")
    (meshes / "round.stl").symlink_to(meshes / "round.stl")
    (meshes / "inside.stl").write_bytes(stl(block()))
    (meshes / "same.stl").symlink_to(meshes / "inside.stl")
    (meshes / "skin.png").symlink_to("/etc/passwd")
    (meshes / "skin.mtl").write_text("newmtl m\nmap_Kd skin.png\n")
    (meshes / "skinned.obj").write_bytes(pyramid("skin.mtl"))
    (meshes / "round.mtl").symlink_to(meshes / "round.mtl")
    (meshes / "rounded.obj").write_bytes(pyramid("round.mtl"))
    first, *lines = refused_import(capsys, meshes)
    assert "5 of 7 meshes" in first
    said = dict(line.strip().split(": ", 1) for line in lines)
    assert said.keys() == {"out.stl", "nowhere.stl", "round.stl", "skinned.obj", "rounded.obj"}
    assert said["rounded.obj"].startswith("names 'round.mtl', which is a link that leads nowhere")
    assert said["out.stl"].startswith("is a link out of the folder")
    assert said["nowhere.stl"].startswith("is a link that leads nowhere")
    assert said["skinned.obj"].startswith("names 'skin.png', which is outside the folder")


def test_names_that_become_one_or_none(meshes: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = ["my cup.stl", "my-cup.stl", "manifest.json.stl", "x" * 210 + ".stl", "\x1b[31mred.stl", "good.stl"]
    for name in names:
        (meshes / name).write_bytes(stl(block()))
    Path(os.fsdecode(os.fsencode(meshes) + b"/\xff.stl")).write_bytes(stl(block()))
    (meshes / "._good.stl").write_bytes(b"what a Mac packs beside every file")
    first, *lines = refused_import(capsys, meshes)
    assert "4 of 7 meshes" in first
    assert "my-cup.stl: gives object 'my-cup' a second time, after my cup.stl; rename one of them" in "\n".join(lines)
    assert any("which is the name of the set's own manifest" in line for line in lines)
    assert any("gives an object name of 210 bytes" in line for line in lines)
    assert any(line.strip().startswith("\\udcff.stl: has a name that is not UTF-8") for line in lines)
    assert run(["objects", "import", str(meshes), "--name", "mine", "--skip-bad", "--dry-run"]) == 0
    said = capsys.readouterr().out
    assert "\x1b[31m" not in said
    assert "left out \\udcff.stl" in said


def test_names_beyond_ascii_are_kept(meshes: Path) -> None:
    for name in ("Größe 2.stl", "e\N{COMBINING ACUTE ACCENT}tui.stl", "茶碗.stl", "[bold]#1.stl"):
        (meshes / name).write_bytes(stl(block()))
    import_folder(meshes, "mine")
    models = load_object_set("mine")
    assert {model.object_id for model in models} == {"mine/Größe-2", "mine/étui", "mine/茶碗", "mine/-bold--1"}
    bullet = connect()
    assert all(bullet.loadURDF(str(model.urdf)) >= 0 for model in models)
    bullet.disconnect()


def test_a_folder_without_meshes_tells_what_is_there(meshes: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("a.wrl", "b.wrl", "c.dae"):
        (meshes / name).write_text("")
    (line,) = refused_import(capsys, meshes)
    assert line.endswith("there are 2 .wrl, 1 .dae")
    (line,) = refused_import(capsys, meshes / "a.wrl")
    assert line.endswith("is a file, expected a folder of meshes")


@pytest.mark.parametrize("pattern", ["../*.stl", "a/../../*.stl", "**x"])
def test_a_pattern_that_leaves_the_folder_or_is_none(
    meshes: Path, capsys: pytest.CaptureFixture[str], pattern: str
) -> None:
    (meshes.parent / "secret.stl").write_bytes(stl(block()))
    (line,) = refused_import(capsys, meshes, "--pattern", pattern)
    assert line.startswith(f"error: pattern is {pattern!r}")


@pytest.mark.parametrize("pattern", ["", "/tmp/*"])
def test_a_pattern_stays_in_the_folder(meshes: Path, pattern: str) -> None:
    with pytest.raises(MeshImportError, match="expected a pattern below the folder"):
        import_folder(meshes, "mine", settings=ImportSettings(pattern=pattern))


def test_an_empty_folder_and_a_file_are_refused(meshes: Path, tmp_path: Path) -> None:
    with pytest.raises(MeshImportError, match="holds no mesh that matches"):
        import_folder(meshes, "none")
    (tmp_path / "file.stl").write_text("")
    with pytest.raises(MeshImportError, match="is a file, expected a folder"):
        import_folder(tmp_path / "file.stl", "none")


def test_names_leave_out_what_all_paths_share(meshes: Path) -> None:
    for name in ("025_mug", "006 mustard"):
        (meshes / name / "google_16k").mkdir(parents=True)
        cuboid().export(meshes / name / "google_16k" / "textured.obj")
    paths = find_meshes(meshes, "*/google_16k/textured.obj")
    assert object_names(meshes, paths) == ["006-mustard", "025_mug"]


def test_two_files_of_one_name_are_a_fault(meshes: Path) -> None:
    cuboid().export(meshes / "cup.stl")
    cuboid().export(meshes / "cup.ply")
    with pytest.raises(MeshImportError, match=r"gives object 'cup' a second time"):
        import_folder(meshes, "cups")
    assert len(import_folder(meshes, "cups", settings=ImportSettings(pattern="*.ply")).objects) == 1
