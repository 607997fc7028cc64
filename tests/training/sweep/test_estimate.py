from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from tests.support.swept import Threads, make_swept, swept_plan

from handsight.training.sweep.estimate import ASSUMED_PASSES, estimate, measured_speeds
from handsight.training.sweep.folder import SweepFolder
from handsight.training.sweep.plan import SweepPlan
from handsight.training.sweep.prepare import settle
from handsight.training.sweep.run import run_sweep
from handsight.training.sweep.work import materialized


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> SweepPlan:
    return swept_plan(make_swept(tmp_path_factory.mktemp("estimate") / "grasps"))


def of_epochs(plan: SweepPlan, epochs: int) -> SweepPlan:
    return replace(plan, recipe=replace(plan.recipe, epochs=epochs))


def test_every_channel_set_takes_its_own_time(plan: SweepPlan) -> None:
    plan = of_epochs(plan, 40)
    speeds = {"rgb": 10.0, "depth": 40.0}
    cells = [cell for cell in plan.cells() if cell.size == 20]
    found = estimate(plan, cells, {}, workers=2, speeds=speeds)
    samples = 4 * 0.9 * ASSUMED_PASSES * 20
    assert found.samples == pytest.approx(6 * samples)
    assert found.seconds == pytest.approx(3 * (samples / 10 + samples / 40) / 2)
    assert found.samples_per_s == pytest.approx(16)
    alone = estimate(plan, cells[:1], {}, workers=2, speeds=speeds)
    assert alone.seconds == pytest.approx(samples / speeds[cells[0].channels])
    assert estimate(plan, [], {}, workers=2, speeds=speeds).seconds == 0


def test_no_cell_is_thought_to_take_more_passes_than_its_recipe_allows(plan: SweepPlan) -> None:
    short = of_epochs(plan, 5)
    cells = [cell for cell in short.cells() if cell.size == 20]
    found = estimate(short, cells, {}, workers=1, speeds={"rgb": 10.0, "depth": 40.0})
    assert found.passes == 5
    assert found.samples == pytest.approx(len(cells) * 4 * 0.9 * 5 * 20)


def test_speeds_are_measured_for_every_channel_set_with_all_workers(plan: SweepPlan) -> None:
    speeds = measured_speeds(plan, [materialized(one, plan) for one in plan.datasets], 2)
    assert speeds.keys() == {"rgb", "depth"}
    assert min(speeds.values()) > 0


def test_cells_that_are_done_tell_how_long_the_others_take(plan: SweepPlan, tmp_path: Path) -> None:
    folder = SweepFolder(tmp_path)
    settle(tmp_path, plan)
    run_sweep(plan, folder, workers=1, engine=Threads(), chosen=lambda cell: cell.trial == 0)
    results = folder.results(plan.cells())
    done = {
        cell: replace(result, epochs=10, processor_s=2.0 if cell.channels == "rgb" else 1.0)
        for cell, result in results.items()
    }
    left = [cell for cell in plan.cells() if cell not in done]
    found = estimate(of_epochs(plan, 40), left, done, workers=1, speeds=None)
    assert found.passes == 10
    # Two trials more of the four cells that took 2 + 2 + 1 + 1 s.
    assert found.seconds == pytest.approx(12)
