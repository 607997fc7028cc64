"""What a user changed in an export becomes decisions, or is refused by name."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import GraspDataset, GraspRepository, InterchangeError, Outcome, export_dataset, import_dataset
from handsight.datasets.curation.curator import Curator
from handsight.datasets.exchange.edits import Comparison, Edits, decisions_of
from handsight.datasets.format.decisions import Action, Overlay
from handsight.datasets.reading.selection import Selection

Ids = list[str]


def flip_hdf5(path: Path, ids: Ids) -> None:
    with h5py.File(path, "r+") as file:
        for demo in file["data"].values():
            if demo.attrs["attempt"] in ids:
                demo["rewards"][0] = 1 - demo["rewards"][0]


def flip_lerobot(path: Path, ids: Ids) -> None:
    """As one would with pandas, which writes all rows as one group."""
    file = path / "data/chunk-000/file-000.parquet"
    table = pd.read_parquet(file)
    rows = [attempts_of(path).index(one) for one in ids]
    table.loc[rows, "next.success"] = ~table.loc[rows, "next.success"]
    table.to_parquet(file)
    assert pq.ParquetFile(file).num_row_groups == 1


def attempts_of(path: Path) -> Ids:
    sessions = sorted(file.stem for file in (path / "meta/handsight").glob("*.npz"))
    sizes = [len(np.load(path / f"meta/handsight/{one}.npz")["attempts.number"]) for one in sessions]
    return [f"{one}-{number:06d}" for one, size in zip(sessions, sizes, strict=True) for number in range(size)]


FLIPS: dict[str, Callable[[Path, Ids], None]] = {"hdf5": flip_hdf5, "lerobot": flip_lerobot}


@pytest.mark.parametrize("name", FLIPS)
def test_a_changed_label_becomes_a_relabelling(dataset: GraspDataset, tmp_path: Path, name: str) -> None:
    table = dataset.attempts
    ids = [table.index[(table["outcome"] == "empty")][0], table.index[(table["outcome"] == "empty")][-1]]
    export_dataset(dataset, tmp_path / "out", format=name)
    FLIPS[name](tmp_path / "out", ids)
    planned = import_dataset(tmp_path / "out", tmp_path / "back", dry_run=True, author="jo").transfer
    assert [(one.action, one.value, one.attempts) for one in planned.edits] == [(Action.RELABEL, 1, tuple(ids))]
    assert not (tmp_path / "back").exists()
    report = import_dataset(tmp_path / "out", tmp_path / "back", author="jo").transfer
    back = GraspDataset.open(f"{tmp_path}/back")
    assert back.overlay.decisions == (*dataset.overlay.decisions, *report.edits)
    assert (report.edits[0].reason, report.edits[0].author) == ("changed in out", "jo")
    assert back.attempts.loc[ids, "success"].all()
    others = [one for one in back.attempts.index if one not in ids]
    assert back.attempts.loc[others].equals(table.loc[others])
    assert back.digest == dataset.digest


@pytest.mark.parametrize("name", FLIPS)
def test_changed_labels_reach_the_dataset_that_was_exported(dataset: GraspDataset, tmp_path: Path, name: str) -> None:
    """Its sessions are there already and left out; what was changed in them is not."""
    empty = dataset.attempts.index[dataset.attempts["outcome"] == "empty"][:1].tolist()
    export_dataset(dataset, tmp_path / "out", format=name)
    FLIPS[name](tmp_path / "out", empty)
    report = import_dataset(tmp_path / "out", dataset.repository.path).transfer
    assert (report.sessions, [one.attempts for one in report.edits]) == ((), [tuple(empty)])
    now = GraspDataset.open(str(dataset.repository.path))
    assert now.attempts.loc[empty, "success"].all()
    again = import_dataset(tmp_path / "out", dataset.repository.path).transfer
    assert (again.edits, again.snapshot) == ((), None)
    assert dataset.repository.resolve("main") == now.snapshot_id


def test_changed_labels_reach_attempts_of_another_id(dataset: GraspDataset, tmp_path: Path) -> None:
    other = GraspRepository.create(tmp_path / "other")
    for header, size in ((make_header(seed=1), 21), (make_header(seed=None, source="ur10", serials=None), 3)):
        record(other, header, [make_attempt(header, number) for number in range(size)])
    empty = dataset.attempts.index[dataset.attempts["outcome"] == "empty"][:1].tolist()
    export_dataset(dataset, tmp_path / "out", format="hdf5")
    flip_hdf5(tmp_path / "out", empty)
    report = import_dataset(tmp_path / "out", tmp_path / "other").transfer
    assert report.sessions == ()
    table = GraspDataset.open(f"{tmp_path}/other").attempts
    assert table.loc[list(report.edits[0].attempts), "success"].all()
    assert (
        table.loc[list(report.edits[0].attempts), "digest"].tolist() == dataset.attempts.loc[empty, "digest"].tolist()
    )


def test_an_export_without_one_of_its_sessions_is_refused(dataset: GraspDataset, tmp_path: Path) -> None:
    export_dataset(dataset, tmp_path / "out", format="zarr")
    shutil.rmtree(tmp_path / "out/sessions" / dataset.sessions[1].ulid)
    with pytest.raises(InterchangeError, match="21 attempts in 1 session are not those of the version"):
        import_dataset(tmp_path / "out", tmp_path / "back")


def test_only_what_changes_something_is_decided() -> None:
    overlay = Overlay()
    edits = Edits(file="f", labels={"a": True, "b": False}, excluded=("c",), restored=("d",))
    first = list(decisions_of(edits, overlay, author="jo"))
    assert [(one.number, one.action, one.value, one.attempts) for one in first] == [
        (0, Action.RELABEL, 1, ("a",)),
        (1, Action.RELABEL, 0, ("b",)),
        (2, Action.EXCLUDE, None, ("c",)),
    ]
    assert list(decisions_of(edits, Overlay(first), author="jo")) == []
    there = list(decisions_of(edits, Overlay(first), author="jo", ids_there={"c": "e"}))
    assert [(one.action, one.attempts) for one in there] == [(Action.EXCLUDE, ("e",))]


def test_the_message_names_a_few_places_of_every_fault() -> None:
    comparison = Comparison("f")
    places = [f"demo_{number}" for number in range(9)]
    comparison.same("actions", np.zeros((9, 3)), np.ones((9, 3)), places)
    comparison.same("angles", np.full(9, np.nan), np.full(9, np.nan), places)
    comparison.labels("rewards", np.full(9, 0.5), outcome=np.ones(9, np.uint8), ids=places, places=places)
    with pytest.raises(
        InterchangeError, match=r"actions .* \(demo_0, .*, demo_4 and 4 more\); rewards is neither"
    ) as caught:
        comparison.edits("rewards")
    assert "angles" not in str(caught.value)


def test_a_restored_mask_survives_its_own_curation(repository: GraspRepository, tmp_path: Path) -> None:
    header = make_header(seed=1)
    record(repository, header, [make_attempt(header, number, outcome=Outcome.HELD) for number in range(4)])
    ids = GraspDataset(repository, ref="main").attempts.index
    Curator(repository, author="jo").exclude(Selection(ids=tuple(ids[:2])), "dark")
    export_dataset(GraspDataset(repository, ref="main"), tmp_path / "out", format="hdf5")
    with h5py.File(tmp_path / "out", "r+") as file:
        del file["mask/excluded"]
        file["mask/excluded"] = np.array(["demo_1", "demo_3"], dtype="S")
    report = import_dataset(tmp_path / "out", tmp_path / "back").transfer
    assert [(one.action, one.attempts) for one in report.edits] == [
        (Action.EXCLUDE, (ids[3],)),
        (Action.RESTORE, (ids[0],)),
    ]
    assert GraspDataset.open(f"{tmp_path}/back").attempts["excluded"].tolist() == [False, True, False, True]
