"""A search goes on where it was stopped, begins with the usual recipe, and outlives what diverges."""

from __future__ import annotations

import importlib.util
import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from tests.support.swept import RECIPE, Threads, make_swept, swept_plan

from handsight.datasets.inputs.augmentation import Jitter
from handsight.training.errors import DivergedError, MissingExtraError, SweepFolderError, SweepPlanError
from handsight.training.metrics import Metrics
from handsight.training.search import run as run_module
from handsight.training.search import study as study_module
from handsight.training.search.plan import SPACE, SearchPlan, recipe_at, settle_search, values_of
from handsight.training.search.run import ProposalTask, run_search
from handsight.training.search.study import PROPOSALS, STUDY, SearchStudy, check_optuna
from handsight.training.search.table import BEST, TABLE, ProposalRow, best_row, proposal_rows, write_search
from handsight.training.settings import TrainSettings
from handsight.training.sweep.prepare import settle
from handsight.training.sweep.result import CellResult
from handsight.training.sweep.work import CellTask, SweepContext

USUAL = replace(RECIPE, batch=64)
TRIALS = 3
Judge = Callable[[float, int], float]


def search_plan(grasps: str, **changes: object) -> SearchPlan:
    axes = {"channels": ("rgbd",), "sizes": (20,), "recipe": USUAL, "trials": TRIALS}
    return SearchPlan(sweep=swept_plan(grasps, **{**axes, **changes}))


@pytest.fixture(scope="module")
def grasps(tmp_path_factory: pytest.TempPathFactory) -> str:
    return make_swept(tmp_path_factory.mktemp("search") / "grasps")


@pytest.fixture(scope="module")
def plan(grasps: str) -> SearchPlan:
    return search_plan(grasps)


def by_rate(rate: float, trial: int) -> float:
    """A loss that is lowest at a learning rate of 0.005."""
    return 0.4 + 0.1 * abs(math.log(rate / 5e-3)) + 0.01 * trial


@pytest.fixture
def judge(monkeypatch: pytest.MonkeyPatch) -> Callable[[Judge], None]:
    """Let losses come from a formula, where what matters is what becomes of them."""

    def by(formula: Judge) -> None:
        def train_cell(context: SweepContext, task: CellTask) -> CellResult:
            settings = task.cell.settings(context.plan.recipe, 0)
            loss = formula(settings.learning_rate, task.cell.trial)
            return CellResult(
                tested=Metrics(attempts=8, accuracy=0.75, auc=0.8, loss=loss),
                predictions=(),
                objects={},
                curve=(),
                epochs=2,
                kept_epoch=1,
                trained_on=20,
                held_out_attempts=20,
                pool=40,
                seconds=1.0,
                processor_s=1.0,
            )

        monkeypatch.setattr(run_module, "train_cell", train_cell)

    return by


def stop_after(count: int) -> Callable[[ProposalTask, CellResult | None], None]:
    told = []

    def on_cell(task: ProposalTask, _: CellResult | None) -> None:
        told.append(task)
        if len(told) == count:
            raise KeyboardInterrupt

    return on_cell


def searched(plan: SearchPlan, folder: Path, *, proposals: int, workers: int = 1, stop: int = -1) -> list[ProposalRow]:
    settle_search(folder, plan)
    run_search(plan, folder, proposals=proposals, workers=workers, engine=Threads(), on_cell=stop_after(stop))
    return proposal_rows(plan, folder)


def test_a_recipe_and_its_place_in_the_space_are_one() -> None:
    usual = TrainSettings()
    assert recipe_at(values_of(usual), usual) == usual
    assert values_of(usual).keys() == SPACE.keys()
    other = replace(
        usual,
        learning_rate=1e-3,
        weight_decay=0.1,
        average=0.99,
        mixup=0.5,
        batch=100,
        jitter=Jitter(turn_rad=0.1, shift=0.01, brightness=0.3),
    )
    assert recipe_at(values_of(other), usual) == other


def test_networks_are_trained_by_the_recipe_that_is_proposed(plan: SearchPlan, tmp_path: Path) -> None:
    """Without a formula: the usual recipe comes to what a sweep comes to, another one to something else."""
    from handsight.training.sweep.folder import SweepFolder
    from handsight.training.sweep.run import run_sweep

    rows = searched(plan, tmp_path / "search", proposals=2)
    swept = SweepFolder(tmp_path / "sweep")
    settle(swept.path, plan.sweep)
    run_sweep(plan.sweep, swept, workers=1, engine=Threads())
    losses = [result.tested.loss for result in swept.results(plan.sweep.cells()).values()]
    found = {row.number: row for row in rows}
    assert found[0].values == values_of(USUAL)
    assert found[0].recipe == USUAL
    assert found[0].loss == pytest.approx(sum(loss or 0.0 for loss in losses) / TRIALS, abs=1e-12)
    assert found[1].recipe != USUAL
    assert found[1].loss != found[0].loss
    assert found[1].difference is not None
    assert found[1].difference.mean == pytest.approx((found[1].loss or 0) - (found[0].loss or 0))
    assert found[1].difference.trials == TRIALS
    assert not list(tmp_path.rglob("*.ckpt"))


def test_a_search_that_is_stopped_again_and_again_ends_as_if_it_had_not(
    plan: SearchPlan, judge: Callable[[Judge], None], tmp_path: Path
) -> None:
    judge(by_rate)
    whole = searched(plan, tmp_path / "whole", proposals=16)
    for stop in (1, 5, 6, 3):
        with pytest.raises(KeyboardInterrupt):
            searched(plan, tmp_path / "stopped", proposals=16, stop=stop)
        assert not list((tmp_path / "stopped").rglob("*.lock"))
    stopped = searched(plan, tmp_path / "stopped", proposals=16)
    assert stopped == whole
    assert len(whole) == 16
    assert len({row.values["learning_rate"] for row in whole}) == 16
    assert "pruned" in {row.state for row in whole}
    for folder in ("whole", "stopped"):
        write_search(plan, tmp_path / folder, whole)
    assert (tmp_path / "whole" / TABLE).read_text().count("\n") == 17
    best = json.loads((tmp_path / "whole" / BEST).read_text())
    assert best["number"] == min((row for row in whole if row.state == "done"), key=lambda row: row.loss or 0).number
    assert recipe_at(best["values"], USUAL).learning_rate == best["settings"]["learning_rate"]
    # More can be asked for, and a search that has them all does nothing but clear up behind a process that was killed.
    (tmp_path / "stopped" / PROPOSALS / "0003.lock").touch()
    assert len(searched(plan, tmp_path / "whole", proposals=17)) == 17
    assert searched(plan, tmp_path / "stopped", proposals=16, stop=1) == whole
    assert not list((tmp_path / "stopped").rglob("*.lock"))


def test_another_seed_proposes_something_else(
    grasps: str, plan: SearchPlan, judge: Callable[[Judge], None], tmp_path: Path
) -> None:
    judge(by_rate)
    first = searched(plan, tmp_path / "a", proposals=3)
    second = searched(search_plan(grasps, seed=1), tmp_path / "b", proposals=3)
    values = [{row.number: row.values for row in rows} for rows in (first, second)]
    assert values[0][0] == values[1][0]
    assert values[0][1] != values[1][1]


def test_a_search_finds_what_is_better(plan: SearchPlan, judge: Callable[[Judge], None], tmp_path: Path) -> None:
    judge(by_rate)
    rows = searched(plan, tmp_path, proposals=25, workers=2)
    best = best_row(rows)
    assert best is not None
    assert best.number > 0
    assert best.difference is not None
    assert best.difference.mean < 0
    assert [row.loss for row in rows if row.state == "done"] == sorted(
        row.loss or 0 for row in rows if row.state == "done"
    )


def test_what_is_hopeless_is_given_up_and_the_usual_recipe_never(
    plan: SearchPlan, judge: Callable[[Judge], None], tmp_path: Path
) -> None:
    """It is the worst of all here and judged after the others, and has to be compared with nonetheless."""
    judge(lambda rate, trial: 9.0 if rate == USUAL.learning_rate else by_rate(rate, trial))
    settle_search(tmp_path, plan)
    first = SearchStudy(tmp_path, plan).claim(1)
    assert first is not None
    searched(plan, tmp_path, proposals=16)
    first[1].release()
    rows = {row.number: row for row in searched(plan, tmp_path, proposals=16)}
    assert (rows[0].state, rows[0].trials) == ("done", TRIALS)
    pruned = [row for row in rows.values() if row.state == "pruned"]
    assert pruned
    assert min(row.number for row in pruned) >= study_module.BEFORE_PRUNING
    assert {row.trials for row in pruned} <= set(range(1, TRIALS))


def test_what_diverges_has_failed_and_the_search_goes_on(
    plan: SearchPlan, judge: Callable[[Judge], None], tmp_path: Path
) -> None:
    def formula(rate: float, trial: int) -> float:
        if rate > USUAL.learning_rate and trial == 1:
            raise DivergedError(f"the loss is nan at {rate}")
        return by_rate(rate, trial)

    judge(formula)
    rows = searched(plan, tmp_path, proposals=8)
    failed = [row for row in rows if row.state == "failed"]
    assert failed
    assert len(failed) < 8
    assert all(row.values["learning_rate"] > USUAL.learning_rate for row in failed)
    assert all("DivergedError: the loss is nan" in row.why for row in failed)
    assert all(row.values["learning_rate"] <= USUAL.learning_rate for row in rows if row.state == "done")
    assert rows[-1].state == "failed"


def test_a_full_disk_ends_the_call_and_is_no_fault_of_the_proposal(
    plan: SearchPlan, judge: Callable[[Judge], None], tmp_path: Path
) -> None:
    def full(rate: float, trial: int) -> float:
        if trial == 1:
            raise OSError(28, "No space left on device", "checkpoint.ckpt")
        return by_rate(rate, trial)

    judge(full)
    with pytest.raises(OSError, match="cell rgbd-20-001"):
        searched(plan, tmp_path, proposals=2)
    assert [row.state for row in proposal_rows(plan, tmp_path)] == ["running"]
    judge(by_rate)
    assert [row.state for row in searched(plan, tmp_path, proposals=2)] == ["done", "done"]


def test_proposals_in_other_hands_are_left_to_them(
    plan: SearchPlan, judge: Callable[[Judge], None], tmp_path: Path
) -> None:
    judge(by_rate)
    settle_search(tmp_path, plan)
    claimed = SearchStudy(tmp_path, plan).claim(2)
    assert claimed is not None
    proposal, lock = claimed
    assert proposal.number == 0
    assert {row.number: row.state for row in searched(plan, tmp_path, proposals=2)} == {0: "running", 1: "done"}
    lock.release()
    assert {row.number: row.state for row in searched(plan, tmp_path, proposals=2)} == {0: "done", 1: "done"}


@pytest.mark.parametrize("kept", [1, 2, 3, 5, 7])
def test_a_journal_that_ends_anywhere_is_gone_on_with(
    plan: SearchPlan, judge: Callable[[Judge], None], tmp_path: Path, kept: int
) -> None:
    """As a process leaves it that is killed while it proposes, with half a line as a power cut leaves it."""
    judge(by_rate)
    whole = searched(plan, tmp_path / "whole", proposals=2)
    lines = (tmp_path / "whole" / STUDY).read_bytes().splitlines(keepends=True)
    settle_search(tmp_path / "cut", plan)
    (tmp_path / "cut" / STUDY).write_bytes(b"".join(lines[:kept]) + lines[kept][:9])
    assert searched(plan, tmp_path / "cut", proposals=2) == whole


def test_a_damaged_journal_is_refused(plan: SearchPlan, tmp_path: Path) -> None:
    settle_search(tmp_path, plan)
    (tmp_path / STUDY).write_text("no journal\n" * 3)
    with pytest.raises(SweepFolderError, match=r"study\.log is damaged"):
        SearchStudy(tmp_path, plan)


def test_another_plan_is_refused_with_all_that_differs(grasps: str, plan: SearchPlan, tmp_path: Path) -> None:
    settle_search(tmp_path, plan)
    before = (tmp_path / "plan.json").read_bytes()
    settle_search(tmp_path, plan)
    other = search_plan(grasps, trials=2, seed=3, recipe=replace(USUAL, epochs=1))
    with pytest.raises(SweepPlanError) as refused:
        settle_search(tmp_path, other)
    for part in ("trials 3, now 2", "seed 0, now 3", "recipe.epochs 2, now 1", "divisions"):
        assert part in str(refused.value)
    assert "channels" not in str(refused.value)
    assert (tmp_path / "plan.json").read_bytes() == before


def test_a_dataset_that_was_moved_is_the_same_and_another_is_not(plan: SearchPlan, tmp_path: Path) -> None:
    settle_search(tmp_path, plan)
    (dataset,) = plan.sweep.datasets
    settle_search(tmp_path, SearchPlan(sweep=replace(plan.sweep, datasets=(replace(dataset, address="elsewhere"),))))
    changed = replace(dataset, digest="0" * 64)
    with pytest.raises(SweepPlanError, match=r"datasets\.0\.digest"):
        settle_search(tmp_path, SearchPlan(sweep=replace(plan.sweep, datasets=(changed,))))


def test_a_folder_of_something_else_is_refused(plan: SearchPlan, tmp_path: Path) -> None:
    settle(tmp_path / "sweep", plan.sweep)
    with pytest.raises(SweepFolderError, match="folder of a sweep, not of a search"):
        settle_search(tmp_path / "sweep", plan)
    with pytest.raises(SweepFolderError, match="holds other files"):
        settle_search(tmp_path, plan)
    settle_search(tmp_path / "dry", plan, dry_run=True)
    assert not (tmp_path / "dry").exists()
    for content, said in (("{", "is damaged"), ("[]", "is damaged"), ('{"search_version": 9}', "newer handsight")):
        (tmp_path / "sweep" / "plan.json").write_text(content)
        with pytest.raises(SweepFolderError, match=said):
            settle_search(tmp_path / "sweep", plan)


def test_a_plan_that_is_no_search_is_refused(grasps: str) -> None:
    with pytest.raises(SweepPlanError, match="2 of channel set, expected one; there are 2 of size"):
        search_plan(grasps, channels=("rgb", "depth"), sizes=(12, 20))
    with pytest.raises(SweepPlanError, match="mixup is varied"):
        search_plan(grasps, varied={"mixup": ("0", "0.2")})
    with pytest.raises(SweepPlanError, match="batch is 16, expected 50 to 500"):
        search_plan(grasps, recipe=RECIPE)


def test_nothing_is_said_on_the_way(
    plan: SearchPlan, judge: Callable[[Judge], None], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    judge(by_rate)
    searched(plan, tmp_path, proposals=12)
    assert capfd.readouterr() == ("", "")


def test_without_optuna_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(study_module, "find_spec", lambda name: None if name == "optuna" else find(name))
    with pytest.raises(MissingExtraError, match=r"pip install 'handsight\[tune\]'"):
        check_optuna()
