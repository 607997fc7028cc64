"""The same proposals judged on a Ray cluster. Sweeps there: ``tests/cli/test_every_engine.py``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest
from ray.cluster_utils import Cluster
from tests.support.ray_cluster import ray_cluster
from tests.support.swept import RECIPE, make_swept, swept_plan

from handsight.jobs.engine import LOCAL
from handsight.jobs.ray_engine import ray_engine
from handsight.training.search.plan import SearchPlan, settle_search
from handsight.training.search.run import run_search
from handsight.training.search.table import proposal_rows
from handsight.training.sweep.plan import SweepPlan


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> SweepPlan:
    return swept_plan(make_swept(tmp_path_factory.mktemp("sweep") / "grasps"), trials=4)


@pytest.fixture
def cluster() -> Iterator[Cluster]:
    with ray_cluster(nodes=1) as nodes:
        yield nodes


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
