"""rig.toml: what it says, and everything that is wrong with one in one message."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from tests.support.rig_files import write_rig_file

from handsight.collection.errors import RigSettingsError
from handsight.collection.ur10.rig_file import load_rig

EXAMPLE = Path(__file__).parents[3] / "docs" / "rig" / "rig.toml"


def refusal(path: Path, *changes: tuple[str, str]) -> str:
    """What is said about a rig's file in which texts were replaced."""
    text = write_rig_file(path, robot="127.0.0.2", camera="127.0.0.3", generation="cb3").read_text(encoding="utf-8")
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    (path / "rig.toml").write_text(text, encoding="utf-8")
    with pytest.raises(RigSettingsError) as refused:
        load_rig(path / "rig.toml")
    return str(refused.value)


def test_the_example_is_a_rig() -> None:
    rig = load_rig(EXAMPLE)
    assert (rig.robot.generation, rig.camera.port, rig.workspace.pregrasp_height_m) == ("e-series", 8435, 0.2)
    assert rig.calibration == EXAMPLE.parent / "calibration.json"


def test_every_fault_is_told_at_once(tmp_path: Path) -> None:
    said = refusal(
        tmp_path,
        ('address = "127.0.0.2"\ngeneration = "cb3"', 'adress = "127.0.0.2"\ngeneration = "cb3"'),
        ("payload_kg = 1.3", "payload_kg = 1300"),
        ("tcp_length_m = 0.16", "tcp_length_m = 160"),
        ("x_max_m = 0.8", 'x_max_m = "far"'),
        ("[guards]", "[guard]"),
    )
    for part in (
        "robot.adress is no setting: did you mean robot.address?",
        "robot.address is missing, expected a text",
        "robot.payload_kg is 1300, expected 0 to 10: was that in g?",
        "robot.tcp_length_m is 160, expected 0 to 0.5: was that in mm?",
        "workspace.x_max_m is 'far', expected a number",
        "guard is no setting: did you mean guards?",
    ):
        assert part in said


@pytest.mark.parametrize(
    ("before", "after", "part"),
    [
        ('address = "127.0.0.3"', 'address = "127.0.0.300"', "camera.address is '127.0.0.300', expected an IP address"),
        ('generation = "cb3"', 'generation = "cb4"', "robot.generation is 'cb4', expected cb3 or e-series: cb3?"),
        ("x_max_m = 0.8", "x_max_m = 1.45", "points that the UR10 cannot reach"),
        ("y_max_m = 0.15", "y_max_m = -0.2", "workspace.y runs from -0.15 to -0.2 m"),
        ("closed_count = 228", "closed_count = 0", "gripper.open_count is 0"),
        ("stale_s = 2.0", "stale_s = nan", "robot.stale_s is nan, expected a number"),
        ("stale_s = 2.0", "stale_s = true", "robot.stale_s is true, expected a number"),
        ("centre_of_mass_m = [0.0, 0.0, 0.06]", "centre_of_mass_m = [0.0, 60.0]", "expected a list of 3 numbers"),
    ],
)
def test_one_fault_is_named(tmp_path: Path, before: str, after: str, part: str) -> None:
    assert part in refusal(tmp_path, (before, after))


def test_no_file_and_no_toml_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RigSettingsError, match=re.escape(str(tmp_path / "none.toml"))):
        load_rig(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_text("robot = [", encoding="utf-8")
    with pytest.raises(RigSettingsError, match="cannot be read as TOML"):
        load_rig(tmp_path / "bad.toml")
