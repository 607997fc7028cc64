"""Changes of an HDF5 export that no decision can hold are refused by name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from handsight.datasets import GraspDataset, InterchangeError, export_dataset, import_dataset


def replace(file: h5py.File, name: str, value: object) -> None:
    del file[name]
    file[name] = value


def demo_of(file: h5py.File, *, labelled: bool) -> str:
    group = "data" if labelled else "unlabelled"
    return f"{group}/{min(file[group])}"


REFUSED: dict[str, tuple[Callable[[h5py.File], object], str]] = {
    "actions": (
        lambda file: file["data/demo_3/actions"].__setitem__(0, 0.9),
        r"actions is not what was recorded \(demo_3\)",
    ),
    "a shape": (lambda file: replace(file, "data/demo_3/actions", np.zeros((2, 3))), r"not 3 numbers \(demo_3\)"),
    "no label": (
        lambda file: file[demo_of(file, labelled=False)]["rewards"].__setitem__(0, 1),
        "labels an attempt that did not run to its end",
    ),
    "half a success": (
        lambda file: file[demo_of(file, labelled=True)]["rewards"].__setitem__(0, 0.5),
        "neither 0 nor 1",
    ),
    "dones": (lambda file: file["data/demo_3/dones"].__setitem__(0, 0), r"dones is not 1 \(demo_3\)"),
    "a demo more": (lambda file: file.copy("data/demo_3", "data/demo_24"), r"demos were added \(demo_24\)"),
    "an observation more": (
        lambda file: file["data/demo_3/obs"].__setitem__("force", np.zeros((1, 3))),
        r"obs/force was added \(demo_3\)",
    ),
    "an observation less": (
        lambda file: file[demo_of(file, labelled=True)]["obs"].__delitem__("overhead_rgb"),
        "obs/overhead_rgb is missing",
    ),
    "a split": (
        lambda file: file["mask"].__setitem__("train", np.array(["demo_0"], dtype="S")),
        r"filter keys were added \(mask/train\)",
    ),
    "a mask less": (lambda file: file.__delitem__("mask/excluded"), r"filter keys are missing \(mask/excluded\)"),
    "a mask of strangers": (
        lambda file: replace(file, "mask/excluded", np.array(["demo_99"], dtype="S")),
        r"mask/excluded names demos that are not there \(demo_99\)",
    ),
    "who ran to the end": (
        lambda file: replace(file, "mask/labelled", np.array(["demo_0"], dtype="S")),
        "mask/labelled differs",
    ),
    "total": (lambda file: file["data"].attrs.__setitem__("total", 7), r"total is not \d\d demos"),
    "another group": (
        lambda file: file.move(demo_of(file, labelled=False), "data/" + min(file["unlabelled"])),
        r"demos of data and unlabelled changed places \(demo_\d+\)",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_no_decision_can_hold_is_refused_by_name(dataset: GraspDataset, tmp_path: Path, name: str) -> None:
    edit, message = REFUSED[name]
    export_dataset(dataset, tmp_path / "out", format="hdf5")
    with h5py.File(tmp_path / "out", "r+") as file:
        edit(file)
    with pytest.raises(InterchangeError, match=message):
        import_dataset(tmp_path / "out", tmp_path / "back", dry_run=True)


def test_filter_keys_may_be_strings_of_any_length(dataset: GraspDataset, tmp_path: Path) -> None:
    export_dataset(dataset, tmp_path / "out", format="hdf5")
    with h5py.File(tmp_path / "out", "r+") as file:
        names = file["mask/excluded"].asstr()[()].tolist()
        replace(file, "mask/excluded", names)
    assert import_dataset(tmp_path / "out", tmp_path / "back").transfer.edits == ()
