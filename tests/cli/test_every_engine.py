"""``handsight ablate`` on a Ray cluster of two nodes, between buckets, while one of the nodes is killed."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from ray.cluster_utils import Cluster
from tests.support.ray_cluster import ray_cluster
from tests.support.s3_server import empty_bucket, s3_server
from tests.support.swept import make_swept

from handsight.cli.app import run
from handsight.datasets.address import S3Prefix, location_of
from handsight.datasets.store.files import read_object, stored_files
from handsight.training.sweep.folder import METRICS, PREDICTIONS

HANDSIGHT = [sys.executable, "-P", "-c", "from handsight.cli.app import main; main()"]
LIMIT_S = 300.0
GRASPS, OUT = "s3://lab/week/grasps", "s3://lab/week/sweep"
CELLS = 16
AXES = ["--channels", "rgb,depth", "--sizes", "12,20", "--trials", "4", "--held-out", "0.34", "--epochs", "2"]


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch) -> Iterator[Cluster]:
    """Two nodes with one CPU each, and a bucket that both know; the second can be killed, as the first is the head."""
    with s3_server() as server:
        # Workers have the environment in which their node was started.
        empty_bucket(server, monkeypatch)
        with ray_cluster(nodes=2) as nodes:
            yield nodes


@contextmanager
def one_node_killed(cluster: Cluster, out: S3Prefix, *, done: int) -> Iterator[list[int]]:
    """Kill a node once so many cells are done; gives how many were."""
    seen: list[int] = []
    over = threading.Event()

    def watch() -> None:
        while not over.wait(0.1):
            there = sum(name.endswith(f"/{METRICS}") for name in stored_files(out))
            if there >= done:
                seen.append(there)
                cluster.remove_node(next(iter(cluster.worker_nodes)), allow_graceful=False)
                return

    watching = threading.Thread(target=watch)
    watching.start()
    try:
        yield seen
    finally:
        over.set()
        watching.join()


def test_a_sweep_between_buckets_is_finished_after_a_node_was_killed(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether its worker is replaced before the other one has done all that is left depends on the machine."""
    monkeypatch.setenv("HANDSIGHT_CACHE", str(tmp_path / "cache"))
    grasps, alone = make_swept(tmp_path / "grasps"), tmp_path / "alone"
    assert run(["dataset", "init", GRASPS]) == 0
    assert run(["dataset", "merge", grasps, GRASPS]) == 0
    words = ["ablate", GRASPS, *AXES, "--out", OUT, "--workers", "2", "--json"]
    out = location_of(OUT)
    assert isinstance(out, S3Prefix)
    words += ["--engine", "ray", "--ray-address", cluster.address]
    with one_node_killed(cluster, out, done=3) as seen:
        # In a process of its own: what Ray prints of a lost node must not get between the JSON.
        done = subprocess.run([*HANDSIGHT, *words], capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert not cluster.worker_nodes
    assert seen[0] < CELLS
    assert (told["trained"], told["states"]["done"]) == (CELLS, CELLS)
    assert run(["ablate", grasps, *AXES, "--out", str(alone), "--workers", "1"]) == 0
    found = sorted(path.parent.name for path in alone.glob(f"cells/*/{PREDICTIONS}"))
    assert len(found) == CELLS
    for cell in found:
        name = f"cells/{cell}/{PREDICTIONS}"
        assert read_object(out, name) == (alone / name).read_bytes()
