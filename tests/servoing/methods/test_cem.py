"""The cross-entropy method."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from tests.support.bumps import BEST_STEPS, bump

from handsight.servoing.errors import ServoSettingsError
from handsight.servoing.methods.cem import Cem


def test_cem_steps_to_the_best_pose_it_scored() -> None:
    proposal = Cem().begin().propose(bump(BEST_STEPS[0]), 0.3, np.random.default_rng(0))
    assert torch.equal(proposal.step, proposal.samples[proposal.scores.argmax()])
    assert len(proposal.samples) == Cem().samples + 1


@pytest.mark.parametrize("bad", [{"elite": 0}, {"elite": 1000}, {"iterations": 0}, {"max_steps": -1}])
def test_impossible_cem_settings(bad: dict[str, int]) -> None:
    with pytest.raises(ServoSettingsError):
        Cem(**bad)  # type: ignore[arg-type]  # only integers are in these dicts
