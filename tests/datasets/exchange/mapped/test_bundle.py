"""A set that others recorded comes in as its map says, whole or not at all."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from tests.support.foreign_sets import (
    HDF5_MAP,
    LEROBOT_MAP,
    damage_folder,
    damaged_map,
    unpack_lerobot,
    write_hdf5,
    write_map,
)
from tests.support.fuzz_mutations import mutate_bytes
from tests.support.refusals import check_refused

from handsight.cli.app import run
from handsight.datasets import DatasetError, GraspDataset, InterchangeError, Outcome, export_dataset, import_dataset
from handsight.servoing.planar import PlanarPose


@pytest.mark.parametrize("kind", ["image", "video"])
def test_what_lerobot_wrote_comes_in(tmp_path: Path, kind: str) -> None:
    size = {"image": (24, 32), "video": (48, 64)}[kind]
    report = import_dataset(
        unpack_lerobot(tmp_path / "set", kind), tmp_path / "grasps", map=write_map(tmp_path / "map.toml", LEROBOT_MAP)
    )
    assert (report.format, report.transfer.attempts) == ("mapped", 5)
    assert report.preview is not None
    assert (report.preview["held"], report.preview["empty"], report.preview["first"]["name"]) == (3, 2, "episode 0")
    dataset = GraspDataset.open(str(tmp_path / "grasps"))
    for number, identity in enumerate(dataset.attempts.index):
        attempt = dataset.attempt(identity)
        assert attempt.outcome == (Outcome.EMPTY if number % 2 else Outcome.HELD)
        expected = PlanarPose(x_m=0.4 + 0.02 * number, y_m=-0.1 + 0.03 * number, angle_rad=0.3 * number - 0.5)
        np.testing.assert_allclose(attempt.pose_base_tool_grasp, expected.pose_base_tool(0.02), atol=1e-6)
        assert attempt.overhead is not None
        np.testing.assert_allclose(attempt.overhead.pose_base_tool, expected.pose_base_tool(0.4), atol=1e-6)
        assert attempt.overhead.rgb.shape == (*size, 3)
        np.testing.assert_allclose(attempt.overhead.rgb[-4:], 40 * number, atol=0 if kind == "image" else 12)
        assert not attempt.overhead.depth.any()
    config = dataset.sessions[0].header.config
    assert config["made_up"] == ["gripper.final_m", "overhead.depth"]
    assert config["map"] == LEROBOT_MAP


def test_an_hdf5_set_comes_in(tmp_path: Path) -> None:
    path = write_hdf5(tmp_path / "demos.hdf5")
    import_dataset(path, tmp_path / "grasps", map=write_map(tmp_path / "map.toml", HDF5_MAP))
    dataset = GraspDataset.open(str(tmp_path / "grasps"))
    assert dataset.attempts["outcome"].tolist() == ["held", "empty", "held"]
    with h5py.File(path) as file:
        for number, identity in enumerate(dataset.attempts.index):
            attempt = dataset.attempt(identity)
            np.testing.assert_allclose(attempt.pose_base_tool_grasp[:3, 3], (0.5 + 0.01 * number, 0.1, 0.02))
            assert attempt.overhead is not None
            np.testing.assert_allclose(attempt.overhead.pose_base_tool[:3, 3], (0.5, 0.1, 0.9))
            np.testing.assert_array_equal(attempt.overhead.rgb, file[f"data/demo_{number}/obs/wrist_image"][0])
            depth_m = np.nan_to_num(file[f"data/demo_{number}/obs/wrist_depth"][0, ..., 0])
            np.testing.assert_allclose(attempt.overhead.depth * 1e-3, depth_m, atol=5.01e-4)


def test_a_camera_may_be_turned_about_its_axis(tmp_path: Path) -> None:
    """Recorded tools are parallel to their camera, so the camera is where the map says, whatever the turn."""
    turned = [0.02, -0.07, -0.11, 0, 0, 1.2]
    path = write_map(tmp_path / "map.toml", LEROBOT_MAP, camera={"pose_tool_camera": turned})
    import_dataset(unpack_lerobot(tmp_path / "set"), tmp_path / "grasps", map=path)
    dataset = GraspDataset.open(str(tmp_path / "grasps"))
    attempt = dataset.attempt(dataset.attempts.index[0])
    camera = dataset.sessions[0].header.station.camera
    assert attempt.overhead is not None
    found = camera.pose_base_camera(attempt.overhead.pose_base_tool)
    tool = PlanarPose(x_m=0.4, y_m=-0.1, angle_rad=-0.5).pose_base_tool(0.4)
    np.testing.assert_allclose(found[:3, 3], (tool @ [0.02, -0.07, -0.11, 1])[:3], atol=1e-6)
    expected_x = tool[:3, :3] @ (np.cos(1.2), np.sin(1.2), 0)
    np.testing.assert_allclose(found[:3, 0], expected_x, atol=1e-6)


MISFITS: dict[str, tuple[dict[str, dict[str, Any]], str]] = {
    "columns": (
        {"label": {"column": "success"}, "picture": {"rgb": "top"}},
        r"success is no feature.*top is no feature of pictures; there are observation.images.wrist",
    ),
    "a picture for a label": ({"label": {"column": "observation.images.wrist"}}, "is a feature of images"),
    "convention": ({"pose": {"convention": "xyz_quat_wxyz"}}, "episode 0: .* quaternion .* expected 1; episode 1"),
    "too narrow": ({"pose": {"convention": "matrix"}}, "expected frames of 16 numbers"),
    "a frame beyond the end": ({"picture": {"frame": 4}}, "frame 4 is asked for, and there are 4"),
    "a tilted camera": ({"camera": {"pose_tool_camera": [0, 0, 0, 0.6, 0, 0]}}, "the camera is tilted by 34.4 degrees"),
    "a label of another type": ({"label": {"success": "yes"}}, "the label next.success is True"),
    "a centre outside": ({"camera": {"cx": 400}}, "cx, cy are 400"),
}


@pytest.mark.parametrize("name", MISFITS)
def test_a_map_that_does_not_fit_is_refused(tmp_path: Path, name: str) -> None:
    changes, said = MISFITS[name]
    path = write_map(tmp_path / "map.toml", LEROBOT_MAP, **changes)
    with pytest.raises(InterchangeError, match=said):
        import_dataset(unpack_lerobot(tmp_path / "set"), tmp_path / "grasps", map=path)
    assert not (tmp_path / "grasps").exists()


def test_an_export_of_ours_comes_in_as_a_foreign_set_too(dataset: GraspDataset, tmp_path: Path) -> None:
    """Depth in millimetres as LeRobot marks it; a map that says otherwise is refused."""
    export_dataset(dataset, tmp_path / "set", format="lerobot")
    tables: dict[str, dict[str, Any]] = {
        "label": {"column": "next.success"},
        "picture": {"rgb": "observation.images.overhead", "depth": "observation.depth.overhead"},
        "pose": {"column": "action", "convention": "x_y_angle", "z_m": 0.02},
        "camera": {"fx": 10, "fy": 10, "cx": 3.5, "cy": 2.5, "pose_base_camera": [0, 0, 0.5, np.pi, 0, 0]},
        "gripper": {"stroke_m": 0.085},
    }
    import_dataset(tmp_path / "set", tmp_path / "copy", map=write_map(tmp_path / "map.toml", tables))
    back = GraspDataset.open(str(tmp_path / "copy"))
    for found, recorded in zip(back.attempts.index, dataset.attempts.index, strict=True):
        attempt, original = back.attempt(found), dataset.attempt(recorded)
        assert attempt.success == original.success
        assert attempt.overhead is not None
        if original.overhead is not None:
            np.testing.assert_array_equal(attempt.overhead.rgb, original.overhead.rgb)
            np.testing.assert_array_equal(attempt.overhead.depth, original.overhead.depth)
    path = write_map(tmp_path / "map.toml", tables, picture={"depth_unit": "m"})
    with pytest.raises(InterchangeError, match=r"says that its unit is 0.001 m, and the map 1.0 m"):
        import_dataset(tmp_path / "set", tmp_path / "new", map=path)


def test_the_routes_for_foreign_sets_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    unpack_lerobot(tmp_path / "set")
    write_hdf5(tmp_path / "demos.hdf5")
    (tmp_path / "photos").mkdir()
    for name in ("set", "demos.hdf5", "photos"):
        check_refused(capsys, ["dataset", "import", str(tmp_path / name), str(tmp_path / "new")], "--map map.toml")


def test_a_dry_run_shows_the_first_attempt(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["dataset", "import", str(unpack_lerobot(tmp_path / "set")), str(tmp_path / "grasps")]
    words += ["--map", str(write_map(tmp_path / "map.toml", LEROBOT_MAP)), "--dry-run"]
    assert run(words) == 0
    said = capsys.readouterr().out
    assert "3 held, 2 empty" in said
    assert "grasp at 0.4 -0.1 0.02 m, -0.5 rad" in said
    assert run([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["mapped"]["held"] == 3
    assert not (tmp_path / "grasps").exists()
    check_refused(capsys, [*words, "-f", "lerobot"], "a map says itself what the set is")


def _attempt_import(source: Path, folder: Path, map_path: Path | None) -> None:
    """An import may succeed or be refused in one line; anything else fails the test that calls this."""
    said = ""
    try:
        import_dataset(source, folder / "new", map=map_path, dry_run=True)
    except DatasetError as error:
        said = str(error)
    assert "\n" not in said


@pytest.mark.no_cover
def test_a_damaged_lerobot_folder_is_refused_or_read(tmp_path: Path) -> None:
    unpack_lerobot(tmp_path / "whole")
    map_path = write_map(tmp_path / "map.toml", LEROBOT_MAP)
    for seed in range(60):
        source = shutil.copytree(tmp_path / "whole", tmp_path / "set")
        done = damage_folder(source, np.random.default_rng(seed))
        try:
            _attempt_import(source, tmp_path, map_path)
        except BaseException as error:
            error.add_note(f"seed {seed}: {done}")
            raise
        shutil.rmtree(source)


@pytest.mark.no_cover
def test_a_damaged_map_is_refused_or_read(tmp_path: Path) -> None:
    unpack_lerobot(tmp_path / "set")
    for seed in range(80):
        damaged_map(LEROBOT_MAP, np.random.default_rng(seed), tmp_path / "map.toml")
        try:
            _attempt_import(tmp_path / "set", tmp_path, tmp_path / "map.toml")
        except Exception as error:
            error.add_note(f"seed {seed}: {(tmp_path / 'map.toml').read_bytes()!r}")
            raise


@pytest.mark.no_cover
def test_a_damaged_hdf5_file_is_refused_or_read(tmp_path: Path) -> None:
    whole = write_hdf5(tmp_path / "whole.hdf5").read_bytes()
    map_path = write_map(tmp_path / "map.toml", HDF5_MAP)
    for seed in range(80):
        (tmp_path / "demos.hdf5").write_bytes(mutate_bytes(whole, np.random.default_rng(seed)))
        try:
            _attempt_import(tmp_path / "demos.hdf5", tmp_path, map_path)
        except Exception as error:
            error.add_note(f"seed {seed}")
            raise
