"""Predictions do not depend on the batch they are made in."""

from __future__ import annotations

import numpy as np
import torch
from tests.support.drawn_table import BRIGHTNESS, START, DrawnTable

from handsight.servoing.objective import Objective


def test_predictions_do_not_depend_on_the_batch() -> None:
    view, _ = DrawnTable(START).look()
    objective = Objective(view, BRIGHTNESS)
    steps = torch.from_numpy(np.random.default_rng(0).normal(size=(9, 3)).astype(np.float32) * 0.05)
    alone = torch.stack([objective(step[None])[0] for step in steps])
    torch.testing.assert_close(objective(steps), alone)
