"""The same cells on a Ray cluster of two nodes, one of which is killed in the middle."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest
from ray.cluster_utils import Cluster
from tests.support.swept import RECIPE, make_swept, swept_plan

from handsight.jobs.engine import LOCAL
from handsight.jobs.ray_engine import ray_engine
from handsight.training.search.plan import SearchPlan, settle_search
from handsight.training.search.run import run_search
from handsight.training.search.table import proposal_rows
from handsight.training.sweep.cell import Cell
from handsight.training.sweep.folder import SweepFolder
from handsight.training.sweep.plan import SweepPlan
from handsight.training.sweep.prepare import settle
from handsight.training.sweep.result import CellResult
from handsight.training.sweep.run import run_sweep

STORE_BYTES = 100 * 2**20


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> SweepPlan:
    return swept_plan(make_swept(tmp_path_factory.mktemp("sweep") / "grasps"), trials=4)


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch) -> Iterator[Cluster]:
    """Two nodes with one CPU each; the second can be killed, as the first is the head."""
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    nodes = Cluster()
    try:
        for _ in range(2):
            nodes.add_node(num_cpus=1, object_store_memory=STORE_BYTES, include_dashboard=False)
        nodes.wait_for_nodes(timeout=60)
        yield nodes
    finally:
        nodes.shutdown()


def test_a_grid_is_finished_after_a_node_was_killed(plan: SweepPlan, cluster: Cluster, tmp_path: Path) -> None:
    """Whether its worker is replaced before the other one has done all that is left depends on the machine."""
    folder, told = SweepFolder(tmp_path / "ray"), Counter[str]()
    settle(folder.path, plan)

    def kill_a_node(cell: Cell, result: CellResult | None) -> None:
        told[cell.name] += 1
        if told.total() == 3:
            cluster.remove_node(next(iter(cluster.worker_nodes)), allow_graceful=False)

    with ray_engine(cluster.address, workers=2) as engine:
        report = run_sweep(plan, folder, workers=2, engine=engine, on_cell=kill_a_node)
    assert not cluster.worker_nodes
    assert (report.trained, report.failed, report.elsewhere) == (16, 0, 0)
    assert set(told.values()) == {1}
    alone = SweepFolder(tmp_path / "alone")
    settle(alone.path, plan)
    run_sweep(plan, alone, workers=1)
    assert figures(folder, plan) == figures(alone, plan)


def test_a_search_is_judged_on_a_cluster_as_here(plan: SweepPlan, cluster: Cluster, tmp_path: Path) -> None:
    """With one worker, proposals follow from the plan alone. Workers of a cluster may not see the folder."""
    search = SearchPlan(sweep=replace(plan, channels=("depth",), sizes=(12,), recipe=replace(RECIPE, batch=50)))
    losses = []
    for name in ("ray", "alone"):
        settle_search(tmp_path / name, search)
        with ray_engine(cluster.address, workers=1) if name == "ray" else nullcontext(LOCAL) as engine:
            run_search(search, tmp_path / name, proposals=3, workers=1, engine=engine)
        losses.append([(row.number, row.state, row.loss) for row in proposal_rows(search, tmp_path / name)])
    assert losses[0] == losses[1]
    assert [state for _, state, _ in losses[0]] == ["done"] * 3
    assert not list(tmp_path.rglob("*.ckpt"))


def figures(folder: SweepFolder, plan: SweepPlan) -> dict[str, object]:
    """What every cell found, without the time that it took."""
    return {
        cell.name: (result.tested, result.objects, result.kept_epoch, result.trained_on)
        for cell, result in folder.results(plan.cells()).items()
    }
