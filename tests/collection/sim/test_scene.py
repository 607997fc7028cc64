"""Objects dropped onto the table come to rest on it."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.household import SETS

from handsight.collection.sim.bullet import BulletClient
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.objects.catalogue import load_object_set
from handsight.collection.sim.randomization import Randomization
from handsight.collection.sim.scene import Scene
from handsight.collection.sim.table import add_table


@pytest.mark.parametrize("name", SETS)
def test_dropped_objects_come_to_rest(bullet: BulletClient, name: str) -> None:
    """Five of them from 0.15 m rest within 3 s, here in all of a few seeds; docs/objects.md has the share of many."""
    config = SimConfig(objects=name, settle_limit_s=3.0)
    models = load_object_set(name)
    for seed in range(6):
        rng = np.random.default_rng([5, seed])
        bullet.resetSimulation()
        bullet.setGravity(0, 0, -9.81)
        add_table(bullet)
        scene = Scene(bullet, config)
        scene.drop([models[index] for index in rng.choice(len(models), 5, replace=False)], rng, Randomization())
        assert scene.settle() <= 3.0 * config.physics_hz
        assert (scene.poses()[:, 2] > 0).all()
