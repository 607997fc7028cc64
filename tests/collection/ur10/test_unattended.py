"""The run of a day by the emulator's clock (``tests/support/rig_day.py``), cut to minutes and gone on with."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from tests.support.emulated_rig import need_ur_rtde

PROGRAM = Path(__file__).parents[2] / "support" / "rig_day.py"
LIMIT_S = 240


def day(folder: Path, *options: str) -> dict[str, Any]:
    command = [sys.executable, str(PROGRAM), str(folder), "--speed", "20", *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_a_run_with_faults_loses_nothing_and_goes_on_where_it_was_left(tmp_path: Path) -> None:
    need_ur_rtde()
    folder = tmp_path / "day"
    first = day(folder, "--hours", "0.1", "--faults-per-hour", "120")
    second = day(folder, "--hours", "0.2", "--faults-per-hour", "120")
    assert (first["wrong"], second["wrong"]) == ([], [])
    assert second["robot_hours"] >= 0.2 > first["robot_hours"] >= 0.1
    assert second["lives_of_the_emulator"] > first["lives_of_the_emulator"]
    assert second["kept"] >= second["attempts"] >= first["attempts"]
    assert sum(second["faults_of_the_rig"].values()) > 0
