"""The range in which steps are drawn."""

from __future__ import annotations

import numpy as np
import torch
from tests.support.bumps import BEST_STEPS, bump

from handsight.servoing.methods.first_order import FirstOrder
from handsight.servoing.sampling import StepRange


def test_sampling_range_shrinks_with_the_score() -> None:
    """Section IV: the range is scaled by 1 - S_0."""
    step_range = StepRange(x_m=0.1, y_m=0.2, angle_rad=1.0)
    torch.testing.assert_close(step_range.scaled(0.0), torch.tensor([0.1, 0.2, 1.0]))
    torch.testing.assert_close(step_range.scaled(0.75), torch.tensor([0.1, 0.2, 1.0]) * 0.25)
    wide, fine = (
        FirstOrder().begin().propose(bump(BEST_STEPS[0]), here, np.random.default_rng(0)).samples.abs().max(0).values
        for here in (0.0, 0.8)
    )
    torch.testing.assert_close(fine, wide * 0.2)
