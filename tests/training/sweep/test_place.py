"""Sweeps kept in a bucket, on a server of this machine that speaks S3."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.support.s3_server import empty_bucket, s3_server
from tests.support.swept import CELL, RESULT, make_swept, swept_plan

from handsight.datasets.address import S3Prefix
from handsight.datasets.errors import StorageError
from handsight.datasets.store.files import read_object, stored_files, write_object
from handsight.training.errors import SweepFolderError
from handsight.training.sweep.folder import CURVE, FAILURE, METRICS, PREDICTIONS, SweepFolder
from handsight.training.sweep.place import MARK, BucketPlace, SweepPlace, sweep_place
from handsight.training.sweep.plan import PLAN, read_plan
from handsight.training.sweep.prepare import settle

HERE = S3Prefix(bucket="lab", prefix="week/figure7")


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    with s3_server() as address:
        yield address


@pytest.fixture(autouse=True)
def bucket(server: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    empty_bucket(server, monkeypatch)
    on_machine("first", tmp_path, monkeypatch)


def on_machine(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What follows happens on a machine that knows nothing of others."""
    monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / name))


def begun(tmp_path: Path) -> SweepPlace:
    """A sweep of which nothing is trained yet."""
    place = sweep_place(HERE, begin=True)
    grasps = tmp_path / "grasps"
    plan = swept_plan(str(grasps) if grasps.exists() else make_swept(grasps))
    settle(place.folder, plan)
    place.keep_plan()
    return place


def train(place: SweepPlace, error: Exception | None = None) -> None:
    """What training leaves of the cell in the folder: a result, or why there is none."""
    folder = SweepFolder(place.folder)
    lock = folder.claim(CELL)
    assert lock is not None
    folder.write_config(CELL, {})
    if error is None:
        folder.write_result(CELL, RESULT)
    else:
        folder.write_failure(CELL, error)
    lock.release()


def test_what_is_done_on_one_machine_is_done_on_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = begun(tmp_path)
    train(place)
    place.keep_cell(CELL)
    assert {CURVE, METRICS, PREDICTIONS} <= stored_files(HERE, f"cells/{CELL.name}").keys()
    on_machine("second", tmp_path, monkeypatch)
    there = sweep_place(HERE, begin=False)
    assert there.folder != place.folder
    assert there.folder.name == place.folder.name
    assert read_plan(there.folder) == read_plan(place.folder)
    assert SweepFolder(there.folder).state(CELL) == "done"
    kept = SweepFolder(there.folder).results([CELL])[CELL]
    assert (kept.tested, kept.seconds) == (RESULT.tested, RESULT.seconds)


def test_a_failure_is_kept_until_the_cell_is_tried_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = begun(tmp_path)
    train(place, ValueError("the loss is nan"))
    place.keep_cell(CELL)
    on_machine("second", tmp_path, monkeypatch)
    there = sweep_place(HERE, begin=False)
    folder = SweepFolder(there.folder)
    assert folder.state(CELL) == "failed"
    assert "the loss is nan" in folder.failure(CELL)
    folder.forget_failure(CELL, restart=True)
    there.keep_cell(CELL)
    on_machine("third", tmp_path, monkeypatch)
    assert SweepFolder(sweep_place(HERE, begin=False).folder).state(CELL) == "left"


def test_a_bucket_out_of_reach_ends_nothing_and_is_made_up_for(
    tmp_path: Path, server: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = begun(tmp_path)
    train(place)
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    place.keep_cell(CELL)
    with pytest.raises(StorageError, match=r"all that is done is in .* the same call copies it"):
        place.keep_tables()
    monkeypatch.setenv("AWS_ENDPOINT_URL", server)
    place.keep_tables()
    assert METRICS in stored_files(HERE, f"cells/{CELL.name}")


def test_what_a_killed_call_left_in_the_folder_is_copied_by_the_next(tmp_path: Path) -> None:
    train(begun(tmp_path))
    assert not stored_files(HERE, "cells")
    sweep_place(HERE, begin=True).keep_tables()
    assert METRICS in stored_files(HERE, f"cells/{CELL.name}")


def test_a_cell_done_elsewhere_is_not_taken_for_one_that_failed_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = begun(tmp_path)
    train(place, ValueError("x"))
    on_machine("second", tmp_path, monkeypatch)
    there = sweep_place(HERE, begin=True)
    train(there)
    there.keep_cell(CELL)
    on_machine("first", tmp_path, monkeypatch)
    back = sweep_place(HERE, begin=True)
    back.keep_tables()
    assert SweepFolder(back.folder).state(CELL) == "done"
    assert FAILURE not in stored_files(HERE, f"cells/{CELL.name}")


def test_a_place_that_was_emptied_begins_anew(tmp_path: Path, server: str, monkeypatch: pytest.MonkeyPatch) -> None:
    place = begun(tmp_path)
    train(place)
    place.keep_cell(CELL)
    empty_bucket(server, monkeypatch)
    again = sweep_place(HERE, begin=True)
    assert again.folder != place.folder
    assert SweepFolder(again.folder).state(CELL) == "left"


def test_what_is_no_sweep_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SweepFolderError, match="s3://lab/week/figure7 holds no sweep"):
        sweep_place(HERE, begin=False)
    write_object(HERE, "thesis.tex", b"x")
    with pytest.raises(SweepFolderError, match="holds other files"):
        sweep_place(HERE, begin=True)
    for damaged in (b"", b"[]", b'{"folder": "../../x"}', b'{"folder": 3}', b"\xff"):
        write_object(HERE, MARK, damaged)
        with pytest.raises(SweepFolderError, match=rf"{MARK} of s3://lab/week/figure7 is damaged"):
            sweep_place(HERE, begin=True)


def test_a_look_at_a_bucket_writes_nothing_there(tmp_path: Path) -> None:
    place = sweep_place(HERE, begin=True)
    assert isinstance(place, BucketPlace)
    assert not place.folder.exists()
    assert not stored_files(HERE)
    begun(tmp_path)
    before = {name: read_object(HERE, name) for name in stored_files(HERE)}
    sweep_place(HERE, begin=False)
    assert {name: read_object(HERE, name) for name in stored_files(HERE)} == before
    assert set(before) == {MARK, PLAN}


def test_a_folder_is_worked_at_where_it_is(tmp_path: Path) -> None:
    place = sweep_place(tmp_path, begin=False)
    assert (place.folder, str(place)) == (tmp_path, str(tmp_path))
