"""``handsight rig emulate``: the devices of a rig's file, until Ctrl-C."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from tests.support.emulated_rig import free_address
from tests.support.rig_files import write_rig_file

from handsight.cli.app import run
from handsight.cli.wiring.emulated_rigs import emulated_rig
from handsight.collection.ur10.emulator.board import Board

PROGRAM = "import sys; from handsight.cli.app import main; main()"
LIMIT_S = 60


def test_devices_answer_until_ctrl_c(tmp_path: Path) -> None:
    robot, camera = free_address(), free_address()
    file = write_rig_file(tmp_path, robot=robot, camera=camera, generation="cb3")
    words = ["rig", "emulate", "--rig", str(file), "--objects", "blocks-test", "--objects-per-scene", "1", "--json"]
    command = [sys.executable, "-c", PROGRAM, *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            said = ""
            while not said.endswith("}\n"):
                line = process.stdout.readline()
                assert line, "it ended before it was ready"
                said += line
            ready = json.loads(said)
            assert (ready["robot"], ready["generation"], ready["camera"]) == (robot, "cb3", f"{camera}:8435")
            with socket.create_connection((robot, 29999), timeout=LIMIT_S) as dashboard, dashboard.makefile() as lines:
                assert lines.readline() == "Connected: Universal Robots Dashboard Server\n"
            process.send_signal(signal.SIGINT)
            assert process.wait(LIMIT_S) == 0
        finally:
            process.kill()


def test_everything_that_cannot_be_emulated_is_told_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write_rig_file(tmp_path, robot="192.168.0.17", camera="127.0.0.3", generation="e-series")
    text = file.read_text(encoding="utf-8").replace('model = "2f-85"', 'model = "2f-99"')
    file.write_text(text, encoding="utf-8")
    assert run(["rig", "emulate", "--rig", str(file), "--fault", "slipp", "--fault", "drop@noon"]) == 2
    said = capsys.readouterr().err
    for part in ("'192.168.0.17', expected a loopback address", "'2f-99'", "'slipp'", "'noon'"):
        assert part in said
    assert said.count("\n") == 1


def test_board_of_the_file_lies_on_an_empty_table(tmp_path: Path) -> None:
    file = write_rig_file(tmp_path, robot="127.0.0.2", camera="127.0.0.3", generation="e-series")
    file.write_text(file.read_text(encoding="utf-8") + "[board]\ncolumns = 9\n", encoding="utf-8")
    launch = emulated_rig(
        file,
        objects="blocks-test",
        per_scene=None,
        empty=True,
        board=True,
        speed=1.0,
        seed=0,
        faults=(),
        faults_per_hour=0.0,
        depth_noise_px=0.0,
        control_port=None,
    )
    assert launch.empty
    assert launch.board == Board(columns=9, x_m=0.65, y_m=0.0)


def test_what_contradicts_itself_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write_rig_file(tmp_path, robot="127.0.0.2", camera="127.0.0.3", generation="e-series")
    text = file.read_text(encoding="utf-8").replace('kind = "emulated"', 'kind = "d435"')
    file.write_text(text, encoding="utf-8")
    assert run(["rig", "emulate", "--rig", str(file), "--empty", "--objects-per-scene", "3", "--board"]) == 2
    said = capsys.readouterr().err
    assert "--empty and --objects-per-scene 3 were both given" in said
    assert "camera.kind is 'd435', expected 'emulated'" in said


def test_object_set_that_is_not_there_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write_rig_file(tmp_path, robot="127.0.0.2", camera="127.0.0.3", generation="e-series")
    assert run(["rig", "emulate", "--rig", str(file), "--objects", "blorks"]) == 2
    assert "unknown object set 'blorks'" in capsys.readouterr().err
