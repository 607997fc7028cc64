"""Sets that others recorded, the maps that describe them, and damage to both."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from tests.support.fuzz_mutations import mutate_bytes, mutate_json_text

GOLDEN = Path(__file__).resolve().parents[1] / "datasets/exchange/mapped/golden"

LEROBOT_MAP: dict[str, dict[str, Any]] = {
    "label": {"column": "next.success"},
    "picture": {"rgb": "observation.images.wrist"},
    "pose": {"column": "observation.state", "convention": "xyz_rotvec", "grasp_frame": "lowest"},
    "camera": {"fx": 30, "fy": 30, "cx": 15.5, "cy": 11.5, "pose_tool_camera": [0.0, -0.07, -0.11]},
    "gripper": {"stroke_m": 0.085},
}
"""Of the sets in ``golden``."""

HDF5_MAP: dict[str, dict[str, Any]] = {
    "label": {"column": "rewards", "frame": "any"},
    "picture": {"rgb": "obs/wrist_image", "depth": "obs/wrist_depth", "depth_unit": "m"},
    "pose": {"column": "obs/eef", "convention": "xyz_quat_xyzw", "unit": "mm", "grasp_frame": 1},
    "camera": {"fx": 10, "fy": 10, "cx": 3.5, "cy": 2.5, "pose_base_camera": [0.5, 0.1, 0.9, np.pi, 0, 0]},
    "gripper": {"stroke_m": 0.1, "closed_width_m": 0.004},
}
"""Of what ``write_hdf5`` writes."""


def write_map(path: Path, tables: Mapping[str, Mapping[str, Any]], **changes: dict[str, Any]) -> Path:
    """Write a map; of the tables named in ``changes`` some entries are changed, and those that are None left out."""
    lines = []
    for table in {**tables, **changes}:
        entries = {**tables.get(table, {}), **changes.get(table, {})}
        lines += [
            f"[{table}]",
            *(f"{key} = {json.dumps(value)}" for key, value in entries.items() if value is not None),
        ]
    path.write_text("\n".join(lines) + "\n")
    return path


def unpack_lerobot(folder: Path, kind: str = "image") -> Path:
    """A set that LeRobot itself wrote, with pictures as ``image`` or as ``video``."""
    with zipfile.ZipFile(GOLDEN / f"lerobot-0.4.4-{kind}.zip") as file:
        file.extractall(folder)
    return folder


def write_hdf5(path: Path, demos: int = 3) -> Path:
    """Demos as robomimic lays them out: three frames, depth as floating-point metres, the pose in millimetres."""
    rng = np.random.default_rng(0)
    with h5py.File(path, "w") as file:
        for number in range(demos):
            demo = file.create_group(f"data/demo_{number}")
            demo.attrs["num_samples"] = 3
            demo.attrs["success"] = number % 2 == 0
            demo["rewards"] = np.array([0.0, float(number % 2 == 0), 0.0])
            demo["obs/wrist_image"] = rng.integers(0, 256, (3, 6, 8, 3), dtype=np.uint8)
            depth_m = rng.uniform(0.3, 0.9, (3, 6, 8, 1)).astype(np.float32)
            depth_m[:, 0, 0] = (np.nan,)
            demo["obs/wrist_depth"] = depth_m
            down = [1.0, 0.0, 0.0, 0.0]  # Half a turn about x.
            demo["obs/eef"] = np.array([[500 + 10 * number, 100, height, *down] for height in (300, 20, 250)])
    return path


def damage_folder(folder: Path, rng: np.random.Generator) -> str:
    """Change one file of a folder; returns what was done."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    file = files[rng.integers(len(files))]
    if file.suffix == ".json" and rng.integers(3):
        file.write_text(mutate_json_text(file.read_text(), rng), errors="surrogatepass")
        done = "JSON"
    else:
        file.write_bytes(mutate_bytes(file.read_bytes(), rng))
        done = "bytes"
    return f"{done} of {file.relative_to(folder)}"


STRANGE: tuple[Any, ...] = (
    *(None, True, -1, 0, 1e308, 10**12, 10**400, float("nan")),
    *("", "../../x", "{", "{episode_index.__class__}"),
    *([], [[]], {}, [None] * 3),
)
"""Values that stand where others belong."""


def damaged_map(tables: Mapping[str, Mapping[str, Any]], rng: np.random.Generator, path: Path) -> None:
    """Write a map of which a value is strange, a table or an entry missing or new, or some bytes damaged."""
    changed: dict[str, Any] = {table: dict(entries) for table, entries in tables.items()}
    table = list(changed)[rng.integers(len(changed))]
    kind = rng.integers(4)
    if kind == 0:
        key = list(changed[table])[rng.integers(len(changed[table]))]
        del changed[table][key]
    elif kind == 1:
        changed[table]["frame"] = 7
    elif kind == 2:
        key = list(changed[table])[rng.integers(len(changed[table]))]
        values = [value for value in STRANGE if value is not None and value != {} and value != [None] * 3]
        changed[table][key] = values[rng.integers(len(values))]
    write_map(path, changed)
    if kind == 3:
        path.write_bytes(mutate_bytes(path.read_bytes(), rng))
