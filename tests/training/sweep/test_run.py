"""A sweep goes on where it stopped, trains no cell twice, and keeps what failed apart."""

from __future__ import annotations

import errno
import json
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.swept import Threads, make_swept, swept_plan

from handsight.datasets.held import HeldFile, lock_of
from handsight.datasets.inputs.materialize import GraspInputs
from handsight.jobs.engine import LOCAL
from handsight.training.errors import DivergedError, SweepPlanError
from handsight.training.sweep import run as run_module
from handsight.training.sweep.cell import Cell
from handsight.training.sweep.folder import FAILURE, METRICS, SweepFolder
from handsight.training.sweep.plan import SweepPlan
from handsight.training.sweep.prepare import settle
from handsight.training.sweep.result import CellResult
from handsight.training.sweep.run import chosen_by, run_sweep
from handsight.training.sweep.work import CellTask, SweepContext, materialized, train_cell


@pytest.fixture(scope="module")
def grasps(tmp_path_factory: pytest.TempPathFactory) -> str:
    return make_swept(tmp_path_factory.mktemp("sweep") / "grasps")


@pytest.fixture(scope="module")
def plan(grasps: str) -> SweepPlan:
    return swept_plan(grasps)


def figures(folder: SweepFolder, plan: SweepPlan) -> dict[str, Any]:
    """What every cell found, without the time that it took."""
    return {
        cell.name: (result.tested, result.objects, result.kept_epoch, result.trained_on)
        for cell, result in folder.results(plan.cells()).items()
    }


@pytest.fixture(scope="module")
def whole(plan: SweepPlan, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = SweepFolder(tmp_path_factory.mktemp("whole") / "out")
    settle(folder.path, plan)
    report = run_sweep(plan, folder, workers=2, engine=Threads())
    assert (report.trained, report.failed, report.elsewhere) == (12, 0, 0)
    return figures(folder, plan)


def test_a_sweep_that_is_stopped_goes_on_and_ends_as_if_it_had_not(
    plan: SweepPlan, whole: dict[str, Any], tmp_path: Path
) -> None:
    folder, told = SweepFolder(tmp_path), Counter[str]()
    settle(tmp_path, plan)

    def stop_after(count: int) -> Callable[[Cell, CellResult | None], None]:
        def on_cell(cell: Cell, result: CellResult | None) -> None:
            told[cell.name] += 1
            if told.total() == count:
                raise KeyboardInterrupt

        return on_cell

    for count in (3, 7):
        with pytest.raises(KeyboardInterrupt):
            run_sweep(plan, folder, workers=1, engine=Threads(), on_cell=stop_after(count))
    run_sweep(plan, folder, workers=2, engine=Threads(), on_cell=stop_after(-1))
    assert told == Counter(whole.keys())
    assert figures(folder, plan) == whole
    assert not list(tmp_path.rglob("*.lock"))


def test_processes_of_this_machine_find_the_same(plan: SweepPlan, whole: dict[str, Any], tmp_path: Path) -> None:
    folder = SweepFolder(tmp_path)
    settle(tmp_path, plan)
    chosen = chosen_by(["rgb:20"], plan)
    report = run_sweep(plan, folder, workers=1, engine=LOCAL, chosen=chosen)
    assert report.trained == 3
    assert figures(folder, plan) == {name: found for name, found in whole.items() if name.startswith("rgb-20")}
    assert not list(tmp_path.rglob("*.ckpt"))


def test_workers_of_this_machine_open_no_dataset_where_its_inputs_are_open(
    plan: SweepPlan, whole: dict[str, Any], tmp_path: Path
) -> None:
    data = [materialized(dataset, plan) for dataset in plan.datasets]
    moved = replace(plan, datasets=tuple(replace(one, address="nowhere") for one in plan.datasets))
    folder = SweepFolder(tmp_path)
    settle(tmp_path, moved)
    chosen = chosen_by(["rgb:20:0"], moved)
    assert run_sweep(moved, folder, workers=1, data=data, chosen=chosen).trained == 1
    assert figures(folder, moved) == {"rgb-20-000": whole["rgb-20-000"]}


def test_more_trials_leave_those_that_are_there_as_they_are(
    grasps: str, plan: SweepPlan, whole: dict[str, Any], tmp_path: Path
) -> None:
    folder = SweepFolder(tmp_path)
    settle(tmp_path, plan)
    run_sweep(plan, folder, workers=1, engine=Threads())
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob(METRICS)}
    more = settle(tmp_path, swept_plan(grasps, trials=4))
    assert run_sweep(more, folder, workers=1, engine=Threads()).trained == 4
    assert {path: path.stat().st_mtime_ns for path in before} == before
    found = figures(folder, more)
    assert len(found) == 16
    assert {name: found[name] for name in whole} == whole


def test_what_a_process_left_that_was_killed_once_a_cell_was_done_is_taken_away(
    plan: SweepPlan, tmp_path: Path
) -> None:
    """Between the metrics and the end of the cell; another process that is just there is left alone."""
    folder = SweepFolder(tmp_path)
    settle(tmp_path, plan)
    chosen = chosen_by(["rgb:12"], plan)
    run_sweep(plan, folder, workers=1, engine=Threads(), chosen=chosen)
    killed, alive, _ = (cell for cell in plan.cells() if chosen(cell))
    for cell in (killed, alive):
        folder.checkpoint(cell).write_bytes(b"half")
        (folder.cell_folder(cell) / FAILURE).write_text("{}")
    lock_of(folder.cell_folder(killed)).touch()
    (folder.cell_folder(killed) / ".metrics.unfinished-2d23475c.json.lock").touch()
    held = HeldFile(lock_of(folder.cell_folder(alive)))
    assert run_sweep(plan, folder, workers=1, engine=Threads(), chosen=chosen).trained == 0
    assert [path.name for path in tmp_path.rglob("*.lock")] == [f"{alive.name}.lock"]
    assert [path.parent.name for path in tmp_path.rglob("*.ckpt")] == [alive.name]
    assert [path.parent.name for path in tmp_path.rglob(FAILURE)] == [alive.name]
    held.release()


def test_cells_of_other_processes_are_left_to_them(plan: SweepPlan, tmp_path: Path) -> None:
    folder = SweepFolder(tmp_path)
    settle(tmp_path, plan)
    cells = list(plan.cells())
    others = [SweepFolder(tmp_path).claim(cell) for cell in cells[:5]]
    report = run_sweep(plan, folder, workers=1, engine=Threads())
    assert (report.trained, report.elsewhere) == (7, 5)
    for lock in others:
        assert lock is not None
        lock.release()
    assert run_sweep(plan, folder, workers=1, engine=Threads()).trained == 5


def test_a_cell_that_fails_stops_no_other_and_is_trained_again_when_asked(
    plan: SweepPlan, whole: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = SweepFolder(tmp_path)
    settle(tmp_path, plan)
    cells = list(plan.cells())

    def diverging(context: SweepContext, task: CellTask) -> CellResult:
        if task.cell == cells[4]:
            raise DivergedError("the loss is nan in epoch 1, expected a number")
        return train_cell(context, task)

    with monkeypatch.context() as patched:
        patched.setattr(run_module, "train_cell", diverging)
        report = run_sweep(plan, folder, workers=2, engine=Threads())
    assert (report.trained, report.failed) == (11, 1)
    assert folder.failure(cells[4]).startswith("DivergedError: the loss is nan")
    assert run_sweep(plan, folder, workers=1, engine=Threads()).trained == 0
    folder.forget_failure(cells[4], restart=True)
    assert run_sweep(plan, folder, workers=1, engine=Threads()).trained == 1
    assert figures(folder, plan) == whole


def test_a_cell_whose_loss_is_no_number_is_named_and_the_rest_is_kept(
    plan: SweepPlan, whole: dict[str, Any], tmp_path: Path
) -> None:
    """A height that is none: who reads colours alone never sees it, and a training set without it is fine."""
    (data,) = (materialized(dataset, plan) for dataset in plan.datasets)
    spoilt = np.array(data.inputs)
    row = SweepContext(plan, [data]).division(0, 1).trained_on(20)[15]
    spoilt[row, 3, 0, 0] = np.nan
    np.save(tmp_path / "inputs.npy", spoilt)
    mapped = GraspInputs(inputs=np.load(tmp_path / "inputs.npy", mmap_mode="r"), attempts=data.attempts)
    folder = SweepFolder(tmp_path / "out")
    settle(folder.path, plan)
    chosen = chosen_by(["rgb:20:1", "depth:20:1", "depth:12:1"], plan)
    report = run_sweep(plan, folder, workers=1, data=[mapped], chosen=chosen)
    assert (report.trained, report.failed) == (2, 1)
    states = {cell.name: folder.state(cell) for cell in plan.cells() if chosen(cell)}
    assert states == {"rgb-20-001": "done", "depth-20-001": "failed", "depth-12-001": "done"}
    (failed,) = (cell for cell in plan.cells() if cell.name == "depth-20-001")
    assert folder.failure(failed).startswith("DivergedError: the loss is nan in epoch 1, expected a number")
    assert figures(folder, plan)["rgb-20-001"] == whole["rgb-20-001"]


def test_a_full_disk_ends_the_sweep_names_the_cell_and_keeps_the_rest(
    plan: SweepPlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = SweepFolder(tmp_path)
    settle(tmp_path, plan)
    written: list[str] = []
    write_result = SweepFolder.write_result

    def full(self: SweepFolder, cell: Cell, result: CellResult) -> None:
        if len(written) == 2:
            raise OSError(errno.ENOSPC, "No space left on device")
        written.append(cell.name)
        write_result(self, cell, result)

    monkeypatch.setattr(SweepFolder, "write_result", full)
    with pytest.raises(OSError, match=r"No space left on device, over cell \S+-\d+-\d+; all that is done is kept"):
        run_sweep(plan, folder, workers=1, engine=Threads())
    assert sorted(cell.name for cell in folder.results(plan.cells())) == sorted(written)
    assert not list(tmp_path.rglob("*.lock"))


def test_two_datasets_are_compared_on_the_same_objects(grasps: str, tmp_path: Path) -> None:
    other = make_swept(tmp_path / "other", attempts=48, seed=5)
    plan = swept_plan(grasps, other, channels=("depth",), sizes=(12,), trials=2)
    folder = SweepFolder(tmp_path / "out")
    settle(folder.path, plan)
    assert run_sweep(plan, folder, workers=1, engine=Threads()).trained == 4
    found = folder.results(plan.cells())
    assert {cell.series(("clean", "noisy")) for cell in found} == {"depth clean", "depth noisy"}
    for trial in range(2):
        first, second = ({*result.objects} for cell, result in found.items() if cell.trial == trial)
        assert first == second


def test_a_dataset_that_has_changed_is_noticed(grasps: str, plan: SweepPlan, tmp_path: Path) -> None:
    said = plan.to_json()
    said["datasets"][0]["digest"] = "f" * 64
    changed = SweepPlan.from_json(json.loads(json.dumps(said)))
    settle(tmp_path, changed)
    with pytest.raises(SweepPlanError, match="it is another dataset"):
        run_sweep(changed, SweepFolder(tmp_path), workers=1, engine=Threads())


@pytest.mark.parametrize("texts", [["rgbd"], ["rgb:13"], ["rgb:12:7"], ["rgb:12:1:x"], [""]])
def test_a_choice_that_names_no_cell_is_refused(plan: SweepPlan, texts: list[str]) -> None:
    with pytest.raises(SweepPlanError, match="names no cell of the plan"):
        chosen_by(texts, plan)


def test_a_choice_can_name_a_series_of_one_of_several_datasets(plan: SweepPlan) -> None:
    noisy = replace(plan.datasets[0], address="s3://lab/noisy@v1")
    both = replace(plan, datasets=(*plan.datasets, noisy), divisions=plan.divisions * 2)
    chosen = chosen_by(["depth noisy@v1:20", "rgb:12:0"], both)
    names = {cell.name for cell in both.cells() if chosen(cell)}
    depth = {f"depth-20-00{trial}-data=1" for trial in range(3)}
    assert names == {*depth, "rgb-12-000", "rgb-12-000-data=1"}
    with pytest.raises(SweepPlanError, match=r"for CHANNELS one of its series: depth .*, depth noisy@v1, rgb "):
        chosen_by(["depth later@v1"], both)


def test_choices_add_up(plan: SweepPlan) -> None:
    chosen = chosen_by(["rgb:12", "depth:20:1"], plan)
    names = {cell.name for cell in plan.cells() if chosen(cell)}
    assert names == {"rgb-12-000", "rgb-12-001", "rgb-12-002", "depth-20-001"}
