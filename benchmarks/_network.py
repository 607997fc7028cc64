"""A network to time: weights of a fresh one take as long as those of a trained one."""

from __future__ import annotations

from collections.abc import Callable

import torch

from benchmarks import median_s
from handsight.training.gqn import GqnConfig, GraspQualityNetwork


def fresh_network(*, padded: bool = False) -> GraspQualityNetwork:
    """The default network, or its form with a border of zeros; the same weights every time."""
    with torch.random.fork_rng(devices=()):
        torch.manual_seed(0)
        return GraspQualityNetwork(GqnConfig(padded=padded)).eval()


def inference_ms(action: Callable[[], object], *, runs: int = 15, warm_up: bool = True) -> float:
    """Median duration of an action for which no gradients are kept [ms]."""
    return 1000 * median_s(torch.inference_mode()(action), runs=runs, warm_up=warm_up)
