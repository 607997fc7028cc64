from __future__ import annotations

import json
from pathlib import Path

import pytest
from tests.support.swept import CELL, HELD_OUT, RESULT

from handsight.datasets.held import lock_of
from handsight.training.errors import SweepFolderError, TrainingDataError
from handsight.training.sweep.folder import CURVE, FAILURE, METRICS, PREDICTIONS, SweepFolder


def test_a_cell_comes_from_left_by_running_to_done(tmp_path: Path) -> None:
    folder = SweepFolder(tmp_path)
    assert folder.state(CELL) == "left"
    lock = folder.claim(CELL)
    assert lock is not None
    assert folder.state(CELL) == "running"
    assert SweepFolder(tmp_path).claim(CELL) is None
    folder.checkpoint(CELL).write_bytes(b"x")
    folder.write_result(CELL, RESULT)
    lock.release()
    assert folder.state(CELL) == "done"
    assert folder.claim(CELL) is None
    kept = folder.results([CELL])[CELL]
    assert (kept.tested, kept.objects, kept.epochs, kept.seconds) == (HELD_OUT, RESULT.objects, 2, 1.5)
    lines = (folder.cell_folder(CELL) / CURVE).read_text().splitlines()
    assert lines == [
        "epoch,train_loss,held_out_loss,held_out_auc,held_out_accuracy",
        "1,0.5,0.5,0.9,0.75",
        "2,0.4,0.5,0.9,0.75",
    ]
    assert sorted(path.name for path in folder.cell_folder(CELL).iterdir()) == [CURVE, METRICS, PREDICTIONS]
    told = (folder.cell_folder(CELL) / PREDICTIONS).read_text()
    assert told == "attempt,group,success,score\na-1,cup,1,0.75\n"
    assert not lock_of(folder.cell_folder(CELL)).exists()


def test_a_cell_whose_process_is_gone_can_be_taken(tmp_path: Path) -> None:
    folder = SweepFolder(tmp_path)
    lock = lock_of(folder.cell_folder(CELL))
    lock.parent.mkdir()
    lock.write_text("")  # held by nobody
    assert folder.state(CELL) == "left"
    assert folder.claim(CELL) is not None


def test_a_failed_cell_says_why_and_can_be_tried_again(tmp_path: Path) -> None:
    folder = SweepFolder(tmp_path)
    lock = folder.claim(CELL)
    assert lock is not None
    folder.checkpoint(CELL).write_bytes(b"x")
    folder.write_failure(CELL, TrainingDataError("no successes"), "trace")
    lock.release()
    assert folder.state(CELL) == "failed"
    assert folder.failure(CELL) == "TrainingDataError: no successes"
    folder.forget_failure(CELL, restart=False)
    assert folder.state(CELL) == "left"
    assert folder.checkpoint(CELL).exists()
    folder.forget_failure(CELL, restart=True)
    assert not folder.checkpoint(CELL).exists()


def test_a_failure_that_cannot_be_read_is_still_one(tmp_path: Path) -> None:
    folder = SweepFolder(tmp_path)
    folder.cell_folder(CELL).mkdir(parents=True)
    (folder.cell_folder(CELL) / FAILURE).write_text("{")
    assert folder.state(CELL) == "failed"
    assert "cannot be read" in folder.failure(CELL)


@pytest.mark.parametrize("damage", ["", "[]", "{}", '{"cell": {}, "result": {}}'])
def test_damaged_metrics_are_refused(tmp_path: Path, damage: str) -> None:
    folder = SweepFolder(tmp_path)
    folder.cell_folder(CELL).mkdir(parents=True)
    (folder.cell_folder(CELL) / METRICS).write_text(damage)
    with pytest.raises(SweepFolderError, match=r"metrics.json is damaged .* delete its folder"):
        folder.results([CELL])


def test_metrics_of_another_cell_are_refused(tmp_path: Path) -> None:
    folder = SweepFolder(tmp_path)
    folder.cell_folder(CELL).mkdir(parents=True)
    folder.write_result(CELL, RESULT)
    path = folder.cell_folder(CELL) / METRICS
    said = json.loads(path.read_text())
    said["cell"]["trial"] = 4
    path.write_text(json.dumps(said))
    with pytest.raises(SweepFolderError, match="it is of cell rgb-5-004-mixup=0"):
        folder.results([CELL])
