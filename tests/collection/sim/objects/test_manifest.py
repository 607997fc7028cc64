"""Manifests: what they describe, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from handsight.collection.errors import ObjectSetError
from handsight.collection.sim.objects.catalogue import load_object_set
from handsight.collection.sim.objects.household.generate import write_household
from handsight.collection.sim.objects.manifest import MANIFEST_FILE, load_models, read_manifest


def test_the_manifest_describes_every_object(household: Path) -> None:
    entries = read_manifest(household).objects
    assert [entry.split for entry in entries] == ["train"] * 30 + ["test"] * 10
    for entry in entries:
        assert entry.source
        assert entry.licence == "MIT"
        assert 0.01 < entry.mass_kg < 0.7  # Within the payload of a 2F-85 and heavy enough not to jump.
        assert all(0.01 < extent_m < 0.26 for extent_m in entry.size_m)


def test_a_folder_without_a_manifest_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ObjectSetError, match=r"holds no manifest\.json"):
        load_object_set(str(tmp_path))


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        ("", "cannot be read"),
        ("[]", "has format 'list', expected 1"),
        ('{"format": 99}', "has format 99, expected 1"),
        ('{"format": 1, "name": "x"}', "is damaged: settings is missing; objects is missing"),
        (
            '{"format": 1, "name": "x", "settings": {}, "objects": ["cup"]}',
            r"objects\[0\] is 'cup', expected an object",
        ),
        (
            '{"format": 1, "name": "x", "settings": 3, "objects": 7}',
            r"settings is 3, .*; objects is 7, expected a list",
        ),
        ("[" * 100_000, "cannot be read"),
    ],
)
def test_a_broken_manifest_is_refused(tmp_path: Path, content: str, fault: str) -> None:
    (tmp_path / MANIFEST_FILE).write_text(content)
    with pytest.raises(ObjectSetError, match=fault):
        load_object_set(str(tmp_path))


def test_a_manifest_cannot_lead_out_of_its_folder(household: Path, tmp_path: Path) -> None:
    content = json.loads((household / MANIFEST_FILE).read_text())
    content["objects"][0]["name"] = "../mug"
    (tmp_path / MANIFEST_FILE).write_text(json.dumps(content))
    with pytest.raises(ObjectSetError, match=r"an object is called '\.\./mug', expected the name of a folder"):
        load_object_set(str(tmp_path))


def test_sizes_that_no_object_has_are_all_named(household: Path, tmp_path: Path) -> None:
    """What a later version says besides is passed over."""
    content = {**json.loads((household / MANIFEST_FILE).read_text()), "more": 1}
    content["objects"][0] |= {"scale": -1, "more": 1}
    content["objects"][1] |= {"mass_kg": float("nan"), "size_m": [0.1, 0.1]}
    (tmp_path / MANIFEST_FILE).write_text(json.dumps(content))
    with pytest.raises(ObjectSetError, match=r"scale of .* is -1, .*mass_kg of .* is nan, .*size_m of .* has 2"):
        read_manifest(tmp_path)


def test_damaged_objects_are_all_named(tmp_path: Path) -> None:
    write_household(tmp_path)
    with (tmp_path / "mug" / "skin.obj").open("a") as file:
        file.write("v 0 0 0\n")
    (tmp_path / "torch" / "object.urdf").unlink()
    with pytest.raises(ObjectSetError, match=r"mug has SHA-256 .*torch/object\.urdf is missing"):
        load_models(tmp_path)
