"""The object sets by name."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.support.household import SETS

from handsight.collection.errors import ObjectSetError
from handsight.collection.sim.objects.cache import CACHE_VARIABLE
from handsight.collection.sim.objects.catalogue import list_object_sets, load_object_set
from handsight.collection.sim.objects.model import ObjectModel


def test_sets_have_the_sizes_that_are_promised() -> None:
    sizes = {info.name: info.objects for info in list_object_sets() if info.folder is None}
    assert sizes == {
        "blocks-train": 899,
        "blocks-test": 100,
        "household-train": 30,
        "household-test": 10,
        "clutter-train": 30,
        "clutter-test": 10,
    }


def test_blocks_leave_out_the_broken_shape_and_keep_their_split() -> None:
    train = {model.object_id for model in load_object_set("blocks-train")}
    test = {model.object_id for model in load_object_set("blocks-test")}
    assert "blocks/168" not in train | test
    assert all(name.endswith("0") for name in test)
    assert not train & test


def test_an_object_is_in_one_set_only() -> None:
    names = [model.object_id for name in SETS for model in load_object_set(name)]
    assert len(names) == len(set(names)) == 40


def test_a_folder_with_a_manifest_stands_in_for_a_name(household: Path) -> None:
    models = load_object_set(str(household))
    assert len(models) == 40
    assert models[0] == ObjectModel(
        object_id="household/mug", urdf=household / "mug" / "object.urdf", scale=models[0].scale
    )


def test_an_unknown_set_names_those_that_exist(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    for name in ("no-such-set", "", "../household"):
        with pytest.raises(ObjectSetError, match="expected one of: blocks-train, blocks-test, household-train"):
            load_object_set(name)
