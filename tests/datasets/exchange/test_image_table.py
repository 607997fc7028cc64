"""Pictures and a table of one's own become attempts; whatever is wrong with them is said at once, line by line."""

from __future__ import annotations

import csv
import errno
import io
import json
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from tests.support.factories import make_station
from tests.support.image_table_mutations import mutate_image_table
from typer.testing import CliRunner

from handsight.cli.dataset.app import dataset_app
from handsight.datasets import (
    DatasetError,
    GraspDataset,
    InterchangeError,
    Outcome,
    StorageError,
    doctor,
    export_dataset,
    import_dataset,
)
from handsight.datasets.format.digest import attempt_digest
from handsight.datasets.format.header import station_to_json
from handsight.servoing.planar import PlanarPose

Lines = list[dict[str, Any]]
LINES = 3


def write_table(folder: Path, lines: Lines) -> None:
    with (folder / "attempts.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(lines[0]))
        writer.writeheader()
        writer.writerows(lines)


def make_lines(folder: Path) -> Lines:
    """Random pictures in the folder, and the lines of the table that name them."""
    rng = np.random.default_rng(0)
    (folder / "frames").mkdir(parents=True)
    lines = []
    for number in range(LINES):
        names = {}
        for viewpoint in ("overhead", "pregrasp"):
            for name, shape, dtype in (("rgb", (6, 8, 3), np.uint8), ("depth", (6, 8), np.uint16)):
                path = f"frames/{viewpoint}_{name}_{number}.png"
                cv2.imwrite(str(folder / path), rng.integers(0, np.iinfo(dtype).max, shape, dtype=dtype))
                names[f"{viewpoint}_{name}"] = path
        poses = {
            name: float(rng.normal())
            for name in ("overhead_x_m", "overhead_y_m", "overhead_z_m", "overhead_angle_rad", "grasp_z_m")
        }
        goal = {name: float(rng.normal()) for name in ("pregrasp_x_m", "pregrasp_y_m", "pregrasp_angle_rad")}
        rest = {"width_final_m": 0.03 * number, "target": "cup", "started_ns": 1_700_000_000_123_456_789 + number}
        lines.append({**names, **poses, **goal, **rest})
    lines[1] |= {"pregrasp_rgb": "", "pregrasp_depth": "", "target": "", "started_ns": ""}
    return lines


@pytest.fixture
def lines(tmp_path: Path) -> Lines:
    made = make_lines(tmp_path / "photos")
    (tmp_path / "photos" / "station.json").write_text(json.dumps(station_to_json(make_station(source="lab"))))
    write_table(tmp_path / "photos", made)
    return made


def test_pictures_and_table_become_attempts(lines: Lines, tmp_path: Path) -> None:
    report = import_dataset(tmp_path / "photos", tmp_path / "grasps")
    assert (report.format, report.transfer.attempts) == ("images", LINES)
    dataset = GraspDataset.open(f"{tmp_path}/grasps")
    assert dataset.sessions[0].status == "sealed"
    for number, line in enumerate(lines):
        attempt = dataset.attempt(dataset.attempts.index[number])
        assert attempt.overhead is not None
        bgr = cv2.imread(str(tmp_path / "photos" / line["overhead_rgb"]), cv2.IMREAD_UNCHANGED)
        depth = cv2.imread(str(tmp_path / "photos" / line["overhead_depth"]), cv2.IMREAD_UNCHANGED)
        assert bgr is not None
        np.testing.assert_array_equal(attempt.overhead.rgb, bgr[:, :, ::-1])
        np.testing.assert_array_equal(attempt.overhead.depth, depth)
        pose = PlanarPose.from_pose_base_tool(attempt.overhead.pose_base_tool)
        assert (pose.x_m, pose.y_m) == (line["overhead_x_m"], line["overhead_y_m"])
        assert attempt.pose_base_tool_grasp[2, 3] == line["grasp_z_m"]
        assert attempt.pregrasp_angle_rad == line["pregrasp_angle_rad"]
        assert attempt.outcome is (Outcome.HELD if number else Outcome.EMPTY)
        assert attempt.started_ns == (line["started_ns"] or 0)
        assert (attempt.pregrasp is None, attempt.scene is None) == (number == 1, number == 1)
    assert dataset.attempts["target"].tolist()[0] == "cup"


@pytest.mark.parametrize("dry_run", [False, True])
def test_every_picture_is_decoded_and_every_attempt_hashed_once(
    lines: Lines, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dry_run: bool
) -> None:
    made: Counter[str] = Counter()

    def counting(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def count(*arguments: Any, **named: Any) -> Any:
            made[name] += 1
            return function(*arguments, **named)

        return count

    monkeypatch.setattr(cv2, "imdecode", counting("decoded", cv2.imdecode))
    monkeypatch.setattr("handsight.datasets.writing.batches.attempt_digest", counting("hashed", attempt_digest))
    words = ["import", str(tmp_path / "photos"), str(tmp_path / "grasps"), *["--dry-run"] * dry_run]
    assert CliRunner().invoke(dataset_app, words, catch_exceptions=False).exit_code == 0
    assert made == {"decoded": 4 * LINES - 2, "hashed": LINES}
    assert (tmp_path / "grasps").exists() != dry_run


def test_a_full_disk_for_temporary_files_is_said_and_leaves_nothing(
    lines: Lines, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Full(io.BytesIO):
        def write(self, data: Any) -> int:
            raise OSError(errno.ENOSPC, "No space left on device")

    # That of the pictures; whether the target takes files is asked with one in its own folder.
    real = tempfile.TemporaryFile
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda **where: real(**where) if where else Full())
    with pytest.raises(StorageError, match=r"cannot keep encoded pictures in .*: No space left .* TMPDIR"):
        import_dataset(tmp_path / "photos", tmp_path / "grasps")
    assert [path.name for path in tmp_path.iterdir()] == ["photos"]


def test_importing_twice_adds_nothing(lines: Lines, tmp_path: Path) -> None:
    first = import_dataset(tmp_path / "photos", tmp_path / "grasps").transfer
    second = import_dataset(tmp_path / "photos", tmp_path / "grasps").transfer
    assert (len(first.sessions), second.sessions, len(second.duplicates)) == (1, (), 1)
    with pytest.raises(InterchangeError, match="only imported"):
        export_dataset(GraspDataset.open(f"{tmp_path}/grasps"), tmp_path / "out", format="images")


def edited(at: int, **cells: Any) -> Callable[[Path, Lines], None]:
    def edit(folder: Path, lines: Lines) -> None:
        lines[at] |= cells
        write_table(folder, lines)

    return edit


def station_with(**changes: Any) -> Callable[[Path, Lines], None]:
    """Changes to ``station.json``; ``intrinsics`` are changes to the camera's own."""

    def edit(folder: Path, lines: Lines) -> None:
        path = folder / "station.json"
        station = json.loads(path.read_text())
        station["camera"]["intrinsics"] |= changes.pop("intrinsics", {})
        station["camera"] |= changes.pop("camera", {})
        path.write_text(json.dumps({**station, **changes}))

    return edit


def station_of(text: str) -> Callable[[Path, Lines], object]:
    return lambda folder, lines: (folder / "station.json").write_text(text)


def twice(folder: Path, lines: Lines) -> None:
    text = (folder / "attempts.csv").read_text().splitlines()
    (folder / "attempts.csv").write_text(
        "\n".join(f"{one},{'grasp_z_m' if not at else 0.5}" for at, one in enumerate(text))
    )


def with_blank_lines(folder: Path, lines: Lines) -> None:
    edited(2, grasp_z_m="x")(folder, lines)
    head, first, *rest = (folder / "attempts.csv").read_text().splitlines()
    (folder / "attempts.csv").write_text("\n".join([head, "", first, "", "", *rest]))


def link_out(folder: Path, lines: Lines) -> None:
    (folder / "frames" / "link.png").symlink_to("/etc/hostname")
    edited(0, overhead_rgb="frames/link.png")(folder, lines)


def without_column(folder: Path, lines: Lines) -> None:
    write_table(folder, [{key: value for key, value in line.items() if key != "grasp_z_m"} for line in lines])


BAD: dict[str, tuple[Callable[[Path, Lines], object], str]] = {
    "parent": (edited(0, overhead_rgb="../secret.png"), "line 2: picture '../secret.png' is not in the folder"),
    "absolute": (edited(2, overhead_depth="/etc/hostname"), "line 4: picture '/etc/hostname' is not in the folder"),
    "link": (link_out, "line 2: picture 'frames/link.png' is not in the folder"),
    "no such picture": (edited(1, overhead_rgb="frames/x.png"), "line 3: picture 'frames/x.png' does not exist"),
    "no picture": (edited(1, overhead_rgb="attempts.csv"), "line 3: picture 'attempts.csv' cannot be decoded"),
    "depth for colours": (edited(0, overhead_rgb="frames/overhead_depth_0.png"), r"uint16 \(6, 8\), expected three"),
    "colours for depth": (edited(0, overhead_depth="frames/overhead_rgb_0.png"), "expected one 16-bit channel"),
    "half a pregrasp": (edited(0, pregrasp_rgb=""), "line 2: pregrasp_rgb and pregrasp_depth belong together"),
    "no number": (edited(0, grasp_z_m="high"), "line 2: grasp_z_m is 'high', expected a number"),
    "no width": (edited(0, width_final_m="nan"), "line 2: width_final_m is 'nan', expected a number"),
    "no whole number": (edited(0, started_ns="1.5"), "line 2: started_ns is '1.5'"),
    "target": (edited(0, target="duk"), "line 2: target 'duk' is not among"),
    "missing column": (without_column, "columns are missing: grasp_z_m"),
    "unknown column": (lambda folder, lines: write_table(folder, [{**one, "sucess": 1} for one in lines]), "sucess"),
    "no lines": (lambda folder, lines: (folder / "attempts.csv").write_text("a\n"), "there are no attempts"),
    "no station": (lambda folder, lines: (folder / "station.json").unlink(), "is no station spec"),
    "column twice": (twice, "columns stand more than once: 'grasp_z_m'"),
    "blank lines": (with_blank_lines, "line 7: grasp_z_m is 'x'"),
    "semicolons": (
        lambda folder, lines: (folder / "attempts.csv").write_text("overhead_rgb;overhead_depth\na;b\n"),
        "its separator is ';'",
    ),
    "stroke in mm": (
        station_with(gripper_stroke_m=85, closed_width_m=2),
        r"gripper_stroke_m is 85 m, expected 0.001 to 1 m: millimetres\?; closed_width_m is 2 m, .* millimetres\?",
    ),
    "stroke in cm": (station_with(gripper_stroke_m=8.5), r"gripper_stroke_m is 8.5 m, .*: centimetres\?"),
    "heights in mm": (station_with(pregrasp_height_m=400.0), r"pregrasp_height_m is 400.0 m, .*: millimetres\?"),
    "mount in mm": (
        station_with(camera={"y_tool_camera_m": -55.0}),
        r"camera.y_tool_camera_m is -55.0 m, expected -5 to 5 m: millimetres\?",
    ),
    "focal length in mm": (
        station_with(intrinsics={"fx": 0.0019}),
        r"camera.intrinsics.fx is 0.0019 px for 8 px, a field of view of 3.14\d? rad, .*: focal lengths are in pixels",
    ),
    "depth in mm": (station_with(depth_scale_m=1), r"depth_scale_m is 1 m per unit, .*: millimetres per unit\?"),
    "depth upside down": (station_with(depth_scale_m=1000.0), r"depth_scale_m is 1000.0 .*: units per metre\?"),
    "text for a number": (station_with(depth_scale_m="0.001"), "depth_scale_m is '0.001', expected a number"),
    "null for text": (station_with(source=None), "source is null, expected text"),
    "a number for a name": (station_with(objects=["cup", 3]), r"objects\[1\] is 3, expected text"),
    "a fraction of a pixel": (station_with(intrinsics={"width": 8.0}), "width is 8.0, expected a whole number"),
    "truth for a number": (station_with(closed_width_m=True), "closed_width_m is true, expected a number"),
    "unknown field": (station_with(stroke_m=0.1), "fields 'stroke_m' are unknown, expected source, camera"),
    "huge pictures": (station_with(intrinsics={"width": 10**6}), "width is 1000000 px, expected 1 to 8192 px"),
    "all at once": (
        station_with(source=None, serials={"camera": 7}, depth_scale_m="a", camera={"x_tool_camera_m": []}),
        r"source is null.*camera.x_tool_camera_m is a list of 0.*depth_scale_m is 'a'.*serials.'camera' is 7",
    ),
    "a field twice": (station_of('{"source": "lab", "source": "lab"}'), "'source' is given more than once"),
    "nested": (station_of("[" * 100_000), "is no station spec"),
    "many digits": (station_of('{"source": ' + "9" * 5000 + "}"), "is no station spec"),
    "width in mm": (
        edited(1, width_final_m="31"),
        r"line 3: width_final_m is 31.0 m, .*: millimetres or centimetres\?",
    ),
    "wider than the stroke": (edited(1, width_final_m="0.31"), "width_final_m is 0.31 m, expected 0 to 0.085 m"),
    "angle in degrees": (edited(0, overhead_angle_rad="90"), r"line 2: overhead_angle_rad is 90.0 rad, .*: degrees\?"),
    "clock in seconds": (edited(0, started_ns="1700000000"), r"line 2: started_ns is 1700000000 ns, .*: seconds\?"),
    "decimal comma": (edited(0, grasp_z_m="0,03"), "line 2: grasp_z_m is '0,03', expected a number, with a point"),
    "infinite": (edited(0, grasp_z_m="inf"), "line 2: grasp_z_m is 'inf', expected a number"),
    "bad station": (lambda folder, lines: (folder / "station.json").write_text("[]"), "is no station spec"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_cannot_be_imported_is_said_and_leaves_nothing(lines: Lines, tmp_path: Path, name: str) -> None:
    damage, message = BAD[name]
    damage(tmp_path / "photos", lines)
    with pytest.raises(InterchangeError, match=message):
        import_dataset(tmp_path / "photos", tmp_path / "grasps")
    assert [path.name for path in tmp_path.iterdir()] == ["photos"]


def test_all_faults_are_said_at_once(lines: Lines, tmp_path: Path) -> None:
    edited(0, grasp_z_m="high")(tmp_path / "photos", lines)
    edited(2, target="duk")(tmp_path / "photos", lines)
    with pytest.raises(InterchangeError, match=r"line 2: .*; line 4: "):
        import_dataset(tmp_path / "photos", tmp_path / "grasps")


def test_every_cell_of_a_line_is_looked_at(lines: Lines, tmp_path: Path) -> None:
    edited(0, grasp_z_m="high", target="duk", overhead_rgb="no.png")(tmp_path / "photos", lines)
    with pytest.raises(InterchangeError, match=r"line 2: grasp_z_m .*; line 2: picture 'no.png' .*; line 2: target"):
        import_dataset(tmp_path / "photos", tmp_path / "grasps")


def test_of_many_faults_the_first_are_shown_and_the_others_counted(lines: Lines, tmp_path: Path) -> None:
    write_table(tmp_path / "photos", [{**lines[0], "grasp_z_m": "high"} for _ in range(25)])
    with pytest.raises(InterchangeError, match=r"line 11: grasp_z_m .*; and 15 more faults$"):
        import_dataset(tmp_path / "photos", tmp_path / "grasps")


def test_a_station_and_a_table_that_are_both_bad_are_said_together(lines: Lines, tmp_path: Path) -> None:
    station_with(source=3)(tmp_path / "photos", lines)
    without_column(tmp_path / "photos", lines)
    with pytest.raises(InterchangeError, match=r"source is 3, expected text; .*columns are missing: grasp_z_m"):
        import_dataset(tmp_path / "photos", tmp_path / "grasps")


def test_poses_far_away_are_imported_for_the_doctor_to_judge(lines: Lines, tmp_path: Path) -> None:
    edited(0, pregrasp_x_m="500", grasp_z_m="30")(tmp_path / "photos", lines)
    import_dataset(tmp_path / "photos", tmp_path / "grasps")
    findings = doctor(GraspDataset.open(f"{tmp_path}/grasps")).findings
    assert {"GD-208", "GD-209"} <= {finding.code for finding in findings if finding.severity == "error"}


def test_mutated_folders_are_imported_or_refused(lines: Lines, tmp_path: Path) -> None:
    """Whatever becomes of the files: all attempts, or an error of the datasets room on one line."""
    refusals = []
    for seed in range(80):
        folder = tmp_path / "mutated"
        shutil.copytree(tmp_path / "photos", folder)
        done = mutate_image_table(folder, np.random.default_rng(seed))
        try:
            import_dataset(folder, tmp_path / "grasps", dry_run=True)
        except DatasetError as error:
            refusals.append(str(error))
        except Exception as error:
            raise AssertionError(f"mutation {seed}: {done}") from error
        shutil.rmtree(folder)
    assert len(refusals) > 40
    assert [one for one in refusals if len(one) > 5000 or not one.isprintable()] == []
    assert [path.name for path in tmp_path.iterdir()] == ["photos"]
