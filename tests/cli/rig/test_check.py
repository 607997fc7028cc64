"""``handsight rig check``, ``calibrate`` and ``home`` against an emulated rig, by the real client libraries."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.emulated_rig import RunningRig, free_address, need_ur_rtde, running_rig
from tests.support.rig_files import SERIAL, true_calibration, write_rig_file

from handsight.cli.app import run
from handsight.collection.sim.config import D435_ON_GRIPPER
from handsight.collection.ur10.calibration import load_calibration, save_calibration
from handsight.collection.ur10.rig_file import load_rig
from handsight.collection.ur10.station_factory import Ur10StationFactory
from handsight.datasets import GraspDataset

BESIDE_M = (0.45, 0.3, 0.03)
"""On the table, and out of the workspace of the rig's file."""

PAYLOAD_KG, CENTRE_M = 1.45, (0.01, -0.015, 0.07)
"""What really hangs on the flange; the rig's file says 1.3 kg at 0.06 m."""


@pytest.fixture(scope="module", params=["e-series", "cb3"])
def running(request: pytest.FixtureRequest) -> Iterator[RunningRig]:
    need_ur_rtde()
    options = ("--generation", request.param, "--objects", "blocks-test", "--objects-per-scene", "1", "--speed", "8")
    payload = ("--payload", str(PAYLOAD_KG), "--payload-centre", ",".join(map(str, CENTRE_M)))
    with running_rig(*options, *payload, camera=True) as rig:
        rig.do("put", object=0, position_m=BESIDE_M)
        yield rig


@pytest.fixture
def file(running: RunningRig, tmp_path: Path) -> Iterator[Path]:
    yield write_rig_file(tmp_path, robot=running.robot, camera=running.camera, generation=running.generation)
    running.do("clear")
    running.do("release")
    running.do("board", gone=True)


def said(capsys: pytest.CaptureFixture[str], *words: str, status: int = 0) -> dict[str, Any]:
    """What a command says as JSON."""
    assert run(["rig", *words, "--json"]) == status
    answer: dict[str, Any] = json.loads(capsys.readouterr().out)
    return answer


def found(answer: dict[str, Any], device: str) -> dict[str, tuple[bool, str]]:
    return {one["what"]: (one["ok"], one["found"]) for one in answer["findings"] if one["device"] == device}


def test_bring_up_from_an_uncalibrated_rig_to_a_dry_run(
    running: RunningRig, file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (file.parent / "calibration.json").unlink()
    before = running.do("status")["tcp_pose"]
    answer = said(capsys, "check", "--rig", str(file), "--move", status=1)
    assert running.do("status")["tcp_pose"] == pytest.approx(before, abs=2e-3)  # Nothing moves but to settle.
    assert answer["attempt"] is None
    for part in ("table", "gripper"):
        assert found(answer, "calibration")[part] == (False, f"not yet: 'rig calibrate {part}'")
    assert "rig calibrate camera" in found(answer, "calibration")["camera"][1]

    jaws = said(capsys, "calibrate", "gripper", "--rig", str(file))["jaws"]
    assert (jaws["open_count"], jaws["closed_count"], jaws["spread"]) == (0, 228, 0)
    table = said(capsys, "calibrate", "table", "--rig", str(file))["table"]
    assert table["height_m"] == pytest.approx(0.0, abs=0.001)  # The first touch alone was 2 mm too deep.
    assert table["points"] == 5
    running.do("board")
    camera = said(capsys, "calibrate", "camera", "--rig", str(file))["camera"]
    running.do("board", gone=True)
    mount = D435_ON_GRIPPER
    true_m = (mount.x_tool_camera_m, mount.y_tool_camera_m, mount.z_tool_camera_m)
    assert camera["translation_m"] == pytest.approx(true_m, abs=0.002)
    assert camera["rotation_rad"] == pytest.approx((0, 0, 0), abs=0.005)
    assert camera["serial"] == SERIAL
    assert load_calibration(file.parent / "calibration.json").camera is not None

    answer = said(capsys, "check", "--rig", str(file), "--move")
    assert all(one["ok"] for one in answer["findings"] if one["device"] != "alarm")
    assert answer["attempt"]["failure"] == ""
    assert running.do("status")["travelled_m"][0][2] < 0.01  # By the touches of the table; the dry run stays above it.
    (attempt,) = GraspDataset.open(answer["attempt"]["dataset"]).attempts.itertuples()
    assert attempt.outcome == "empty"
    notes = (file.parent / "operator_log.jsonl").read_text(encoding="utf-8")
    assert notes.count('"calibrated"') == 3


def test_payload_and_reach_are_measured(running: RunningRig, file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = running.do("status")["flange_pose"]
    reach = said(capsys, "calibrate", "reach", "--rig", str(file))["reach"]
    assert (reach["x_min_m"], reach["y_min_m"], len(reach["rows"])) == (0.5, -0.15, 15)
    assert set("".join(reach["rows"])) == {"#"}
    assert running.do("status")["flange_pose"] == pytest.approx(before, abs=2e-3)
    if running.generation == "cb3":
        assert run(["rig", "calibrate", "payload", "--rig", str(file)]) == 2
        assert "no force sensor to weigh with" in capsys.readouterr().err
        return
    payload = said(capsys, "calibrate", "payload", "--rig", str(file))["payload"]
    findings = found(said(capsys, "check", "--rig", str(file), status=1), "calibration")
    assert findings["payload"] == (True, f"{payload['mass_kg']:.2f} kg of {payload['date']}")
    assert findings["reach"] == (True, f"100% of the workspace, {reach['date']}")
    assert payload["mass_kg"] == pytest.approx(PAYLOAD_KG, abs=0.03)
    assert payload["centre_of_mass_m"] == pytest.approx(CENTRE_M, abs=0.006)
    factory = Ur10StationFactory.of(load_rig(file))
    assert factory.rig.robot.payload_kg == payload["mass_kg"]
    assert factory.settings()["calibration"] == load_calibration(file.parent / "calibration.json").to_json()


def test_check_tells_every_device_at_fault_at_once(
    running: RunningRig, file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    running.do("fault", fault="emergency-stop")
    file.write_text(
        file.read_text(encoding="utf-8").replace(f'address = "{running.camera}"', f'address = "{free_address()}"'),
        encoding="utf-8",
    )
    answer = said(capsys, "check", "--rig", str(file), status=1)
    assert not found(answer, "controller")["safety"][0]
    assert not found(answer, "arm")["state"][0]
    assert not found(answer, "camera")["answers"][0]
    assert "emergency stop" in found(answer, "gripper")["answers"][1]


def test_check_is_a_table_for_people(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["rig", "check", "--rig", str(file), "--move"]) == 1
    shown = capsys.readouterr().out
    assert "FAULT" in shown
    assert "nothing was moved: first mend what is at fault" in shown


def test_calibration_of_another_camera_is_refused(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_calibration(file.parent / "calibration.json", true_calibration(serial="000000000001"))
    answer = said(capsys, "check", "--rig", str(file), status=1)
    ok, told = found(answer, "calibration")["camera"]
    assert not ok
    assert "000000000001" in told
    assert SERIAL in told


def test_board_that_is_not_there_is_told_and_the_calibration_before_is_kept(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = (file.parent / "calibration.json").read_bytes()
    assert run(["rig", "calibrate", "camera", "--rig", str(file)]) == 2
    assert "board" in capsys.readouterr().err
    assert (file.parent / "calibration.json").read_bytes() == before


def test_home_goes_over_the_middle(running: RunningRig, file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pose = np.array(said(capsys, "home", "--rig", str(file))["pose_base_tool"])
    assert pose[:2, 3] == pytest.approx((0.65, 0.0), abs=1e-3)
    assert running.do("status")["tcp_pose"][:2] == pytest.approx((0.65, 0.0), abs=1e-3)
    assert run(["rig", "home", "--rig", str(file)]) == 0
    assert "(0.650, 0.000, 0.500) m over the table" in capsys.readouterr().out
