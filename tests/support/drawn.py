"""Network inputs whose rule is known, and a network small enough to learn it in a second."""

from __future__ import annotations

import numpy as np
import pandas as pd

from handsight.datasets.inputs.materialize import GraspInputs
from handsight.training.gqn import GqnConfig
from handsight.training.settings import TrainSettings

SMALL = TrainSettings(
    network=GqnConfig(widths=(8, 8), kernels=(3, 3), dense=(16,), size_px=16), epochs=8, batch=32, holdout=0.25, seed=1
)


def drawn_inputs(count: int, seed: int) -> GraspInputs:
    """A grasp succeeds where something high stands in the middle, whatever the colours."""
    rng = np.random.default_rng(seed)
    labels = rng.random(count) < 0.3
    inputs = rng.random((count, 4, 16, 16)).astype(np.float16)
    inputs[:, 3] *= 0.01
    inputs[labels, 3, 6:10, 6:10] -= 0.05
    attempts = pd.DataFrame({"success": pd.array(labels, dtype="boolean")})
    return GraspInputs(inputs=inputs, attempts=attempts)
