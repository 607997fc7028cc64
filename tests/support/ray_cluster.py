"""Ray clusters of this machine."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from ray.cluster_utils import Cluster

STORE_BYTES = 100 * 2**20


@contextmanager
def ray_cluster(*, nodes: int) -> Iterator[Cluster]:
    """Nodes with one CPU each, the first of them the head; workers have the environment of now."""
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("RAY_USAGE_STATS_ENABLED", "0")
        cluster = Cluster()
        try:
            for _ in range(nodes):
                cluster.add_node(num_cpus=1, object_store_memory=STORE_BYTES, include_dashboard=False)
            cluster.wait_for_nodes(timeout=60)
            yield cluster
        finally:
            cluster.shutdown()
