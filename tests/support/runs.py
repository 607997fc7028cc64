"""Runs of networks that nobody trained, with a record as if somebody had."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from tests.support.drawn import SMALL

from handsight.servoing.homography import InputGrid
from handsight.training.course import Epoch
from handsight.training.gqn import GraspQualityNetwork
from handsight.training.metrics import Metrics
from handsight.training.run import DataOrigin, save_run

ORIGIN = DataOrigin(
    dataset="lab/grasps@v1", ref="v1", snapshot="ABCDEFGH", digest="d" * 64, view="overhead", attempts=80
)


def save_untrained(
    folder: Path, *, seed: int = 0, origins: tuple[DataOrigin, ...] = (ORIGIN,), overwrite: bool = False, **changes: Any
) -> None:
    """Save a run of three passes, of which the second was kept; ``changes`` are of its settings."""
    settings = replace(SMALL, seed=seed, **changes)
    with torch.random.fork_rng(devices=()):
        torch.manual_seed(seed)
        network = GraspQualityNetwork(settings.network)
    losses = (0.7, 0.5, 0.6)
    history = [
        Epoch(
            number=number,
            train_loss=loss + 0.01,
            held_out=Metrics(attempts=20, accuracy=1 - loss / 2, auc=1 - loss / 4, loss=loss),
        )
        for number, loss in enumerate(losses, start=1)
    ]
    save_run(
        folder,
        network,
        origins=origins,
        grid=InputGrid(crop_px=100, size_px=settings.network.size_px),
        settings=settings,
        history=history,
        kept_epoch=2,
        overwrite=overwrite,
    )
