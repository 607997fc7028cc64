"""Session headers as JSON, held against those that a golden dataset has stored."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import pytest
from tests.support.factories import make_header

from handsight.datasets import GraspRepository
from handsight.datasets.format.header import config_digest, header_from_json, header_to_json
from handsight.datasets.format.upgrades import current_attributes
from handsight.servoing.camera import HandCamera
from handsight.servoing.errors import CameraModelError

GOLDEN = Path(__file__).parents[1] / "scenarios" / "golden" / "schema-1.zip"


@pytest.fixture
def stored(tmp_path: Path) -> list[dict[str, Any]]:
    """Attributes of the sessions of a dataset of schema 1, as today's schema has them."""
    with zipfile.ZipFile(GOLDEN) as archive:
        archive.extractall(tmp_path / "grasps")
    repository = GraspRepository.open(tmp_path / "grasps")
    sessions = dict(repository.root(repository.resolve("main"))["sessions"].groups())  # type: ignore[union-attr]
    return [current_attributes(sessions[ulid].attrs.asdict(), 1) for ulid in sorted(sessions)]


def test_a_stored_header_comes_back_to_the_letter(stored: list[dict[str, Any]]) -> None:
    assert len(stored) == 2
    for attributes in stored:
        header = header_from_json(attributes["header"])
        assert header.station.camera == make_header().station.camera
        assert header_to_json(header) == attributes["header"]
        assert config_digest(header) == attributes["config_digest"]


def test_a_new_header_is_written_in_the_order_in_which_headers_always_were() -> None:
    text = json.dumps(header_to_json(make_header())["station"])
    assert text.startswith('{"source": "sim", "camera": {"intrinsics": {"width": 8, "height": 6, "fx": 7.85')
    assert text.endswith('"conditions": ["table_friction", "light_ambient"], "serials": {"camera": "D435-1"}}')
    assert header_from_json(json.loads(json.dumps(header_to_json(make_header())))) == make_header()


def test_a_camera_that_cannot_be_is_refused() -> None:
    values = make_header().station.camera.to_json()
    assert HandCamera.from_json(values) == make_header().station.camera
    with pytest.raises(CameraModelError, match="image size is 0x6"):
        HandCamera.from_json({**values, "intrinsics": {**values["intrinsics"], "width": 0}})
    with pytest.raises(TypeError, match="y_tool_camera_m"):
        HandCamera.from_json({name: value for name, value in values.items() if name != "y_tool_camera_m"})
