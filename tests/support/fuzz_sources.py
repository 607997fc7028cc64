"""Good input of every kind that handsight reads and did not write."""

from __future__ import annotations

import io
import json
import shutil
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import torch
import trimesh
from tests.support.factories import make_attempt, make_header, record
from tests.support.foreign_sets import HDF5_MAP, LEROBOT_MAP, unpack_lerobot, write_hdf5, write_map
from tests.support.meshes import block, pyramid, stl
from tests.support.rig_files import true_calibration, write_rig_file

from handsight.cli.app import run
from handsight.collection.sim.objects.meshes.importer import import_folder
from handsight.collection.ur10.calibration import (
    JawCalibration,
    PayloadCalibration,
    ReachCalibration,
    TableCalibration,
    save_calibration,
)
from handsight.datasets import GraspDataset, GraspRepository, Outcome
from handsight.datasets.inputs.materialize import materialize
from handsight.servoing.homography import InputGrid
from handsight.training.gqn import GqnConfig, GraspQualityNetwork
from handsight.training.run import DataOrigin, save_run
from handsight.training.settings import TrainSettings

CACHED_GRID = InputGrid(crop_px=8, size_px=8)
RUN_NETWORK = GqnConfig(widths=(16, 32), kernels=(5, 3), size_px=16)


def command(*words: str) -> int:
    """Run the command line with its output thrown away."""
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        return run(list(words))


def make_dataset(folder: Path) -> None:
    """Six attempts of small pictures."""
    header = make_header()
    repository = GraspRepository.create(folder / "grasps")
    record(repository, header, [make_attempt(header, number) for number in range(4)])


def make_rig(folder: Path) -> None:
    """A rig's file, with everything measured."""
    write_rig_file(folder, robot="127.0.0.2", camera="127.0.0.3", generation="e-series")
    date = "2026-01-01T00:00:00+00:00"
    calibration = replace(
        true_calibration(),
        table=TableCalibration(date=date, height_m=0.001, tilt_rad=0.002, residual_m=0.0004, points=5),
        jaws=JawCalibration(date=date, open_count=3, closed_count=228, spread=1, pad_width_m=0.022, pad_length_m=0.037),
        payload=PayloadCalibration(
            date=date,
            mass_kg=1.4,
            centre_of_mass_m=(0.001, -0.01, 0.07),
            told_kg=1.3,
            residual_n=0.1,
            residual_nm=0.02,
            poses=7,
        ),
        reach=ReachCalibration(date=date, x_min_m=0.5, y_min_m=-0.15, step_m=0.02, rows=("#" * 14 + ".",) * 15),
    )
    save_calibration(folder / "calibration.json", calibration)


def make_export(format: str, name: str, folder: Path) -> None:
    """An export, and no longer the dataset that it was made from."""
    make_dataset(folder)
    assert command("dataset", "export", str(folder / "grasps"), str(folder / name), "--format", format) == 0
    shutil.rmtree(folder / "grasps")


def make_images(folder: Path) -> None:
    """A table of pictures with its station."""
    (folder / "set").mkdir()
    station = {
        "source": "lab",
        "camera": {
            "intrinsics": {"width": 16, "height": 12, "fx": 15.0, "fy": 15.0, "cx": 7.5, "cy": 5.5},
            **{"x_tool_camera_m": 0.0, "y_tool_camera_m": -0.055, "z_tool_camera_m": -0.1},
        },
        **{"depth_scale_m": 0.001, "gripper_stroke_m": 0.085, "closed_width_m": 0.002, "pregrasp_height_m": 0.4},
        **{"objects": ["cup", "bowl"], "conditions": [], "serials": None},
    }
    (folder / "set" / "station.json").write_text(json.dumps(station))
    names = (
        "overhead_rgb,overhead_depth,overhead_x_m,overhead_y_m,overhead_z_m,overhead_angle_rad,pregrasp_x_m,"
        "pregrasp_y_m,pregrasp_angle_rad,grasp_z_m,width_final_m,target,contact_force_n,started_ns"
    )
    rows = [names]
    for number in range(3):
        cv2.imwrite(str(folder / "set" / f"c{number}.png"), np.full((12, 16, 3), 90, np.uint8))
        cv2.imwrite(str(folder / "set" / f"d{number}.png"), np.full((12, 16), 600, np.uint16))
        rows.append(
            f"c{number}.png,d{number}.png,0.55,0.0,0.6,0.0,0.5{number},0.0,-1.0,0.03,0.03,cup,1.0,1700000000{number}00000000"
        )
    (folder / "set" / "attempts.csv").write_text("\n".join(rows) + "\n")


def make_mesh(suffix: str, folder: Path) -> None:
    """One mesh of a kind, with whatever it names."""
    (folder / "meshes").mkdir()
    if suffix in ("obj", "mtl"):
        (folder / "meshes" / "one.obj").write_bytes(pyramid("one.mtl"))
        (folder / "meshes" / "one.mtl").write_text("newmtl m\nKd 0.5 0.5 0.5\nmap_Kd -s 1 1 1 t.png\n")
        cv2.imwrite(str(folder / "meshes" / "t.png"), np.full((4, 4, 3), 90, np.uint8))
    elif suffix == "stl":
        (folder / "meshes" / "one.stl").write_bytes(stl(block()))
        (folder / "meshes" / "two.stl").write_text(trimesh.exchange.stl.export_stl_ascii(block()))
    else:
        block().export(folder / "meshes" / f"one.{suffix}")
        if suffix == "ply":
            block().export(folder / "meshes" / "two.ply", encoding="ascii")


def make_object_set(folder: Path) -> None:
    """An imported set, as a folder that can be named."""
    (folder / "meshes").mkdir()
    block().export(folder / "meshes" / "one.stl")
    shutil.copytree(import_folder(folder / "meshes", f"set-{abs(hash(folder))}").folder, folder / "set")


def make_run(folder: Path) -> None:
    """A network of the smallest size."""
    torch.manual_seed(0)
    save_run(
        folder / "run",
        GraspQualityNetwork(RUN_NETWORK),
        origins=[DataOrigin(dataset="grasps", ref="v1", snapshot="A", digest="d" * 64, view="overhead", attempts=8)],
        grid=InputGrid(crop_px=100, size_px=16),
        settings=TrainSettings(network=RUN_NETWORK),
    )


def make_curated(folder: Path) -> None:
    """A dataset with everything that lies beside attempts: decisions, a filter, folds, a release and a branch."""
    header = make_header()
    repository = GraspRepository.create(folder / "grasps")
    ended = (Outcome.EMPTY, Outcome.HELD, Outcome.HELD, Outcome.ABORTED)
    record(repository, header, [make_attempt(header, number, outcome=ended[number % 4]) for number in range(12)])
    dataset = str(folder / "grasps")
    for words in (
        ("exclude", dataset, "0", "--reason=dark"),
        ("relabel", dataset, "--to=success", "--where=success == 0", "--reason=it held"),
        ("filter", dataset, "held", "--where=success == 1"),
        ("folds", dataset, "cv", "--by=object", "-k2"),
        ("release", dataset, "v1"),
        ("branch", dataset, "trial"),
    ):
        assert command("dataset", *words) == 0, words


def make_foreign_hdf5(folder: Path) -> None:
    """Demos of somebody else with the map of them."""
    write_hdf5(folder / "demos.hdf5")
    write_map(folder / "map.toml", HDF5_MAP)


def make_foreign_lerobot(folder: Path) -> None:
    """A set that LeRobot itself wrote, with the map of it."""
    unpack_lerobot(folder / "set")
    write_map(folder / "map.toml", LEROBOT_MAP)


def make_cache(folder: Path) -> None:
    """A dataset of which the network inputs were made, and these inputs."""
    header = make_header()
    repository = GraspRepository.create(folder / "grasps")
    record(repository, header, [make_attempt(header, number) for number in range(8)])
    inputs = materialize(GraspDataset(repository, ref="main"), grid=CACHED_GRID)
    np.save(folder / "expected.npy", np.asarray(inputs.inputs))
