"""A folder that a group shares: with umask 002 whatever handsight makes can be written to by the next member."""

from __future__ import annotations

import stat
import subprocess
import sys
from pathlib import Path

PROGRAM = """
import os
os.umask(0o002)
from handsight.cli.app import run
for words in (
    "collect sim grasps -n 6 --seed 3 -w 1",
    "dataset release grasps v1",
    "dataset branch grasps other",
    "dataset exclude grasps 2 -m dark --author jo",
    "dataset materialize grasps",
    "train grasps --out run --epochs 1",
    "train grasps --out run --epochs 1 --overwrite",
    "heatmap grasps --model run -n 1 --spacing 80",
    "dataset export grasps grasps.hdf5 --format hdf5",
    "dataset export grasps grasps.zarr --format zarr",
    "dataset gc grasps",
):
    assert run(words.split()) == 0, words
"""


def test_what_one_member_makes_the_next_can_change(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-P", "-c", PROGRAM], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    made = sorted(tmp_path.rglob("*"))
    assert {path.suffix for path in made} >= {".json", ".safetensors", ".npy", ".rrd", ".hdf5", ".lock"}
    shut = [path.relative_to(tmp_path) for path in made if not path.stat().st_mode & stat.S_IWGRP]
    assert shut == []
