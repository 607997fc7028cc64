"""Predicted success of materialized inputs, a batch at a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from handsight.datasets.inputs.augmentation import FLIPS, flipped
from handsight.datasets.inputs.mixture import InputRows
from handsight.servoing.scores import check_scores
from handsight.training.folded import folded
from handsight.training.gqn import GraspQualityNetwork

SCORE_BATCH = 512


def predict(network: GraspQualityNetwork, inputs: InputRows, rows: Tensor) -> NDArray[np.float32]:
    """Predicted success of some rows of materialized inputs. Shape (len(rows),).

    Raises:
        ScoreError: A score is not in [0, 1].
    """
    judge = folded(network)
    return _scores(lambda batch: torch.sigmoid(judge.logits(batch.to(network.device))), inputs, rows)


def predict_with_flips(network: GraspQualityNetwork, inputs: InputRows, rows: Tensor) -> NDArray[np.float32]:
    """As :func:`predict`, with test-time augmentation: the mean over the four flips of each input."""
    judge = folded(network)

    def mean_over_flips(batch: Tensor) -> Tensor:
        batch = batch.to(network.device)
        which = torch.arange(FLIPS, device=network.device)[:, None].expand(-1, len(batch))
        flips = [torch.sigmoid(judge.logits(flipped(batch, one))) for one in which]
        return torch.stack(flips).mean(dim=0)

    return _scores(mean_over_flips, inputs, rows)


def _scores(score: Callable[[Tensor], Tensor], inputs: InputRows, rows: Tensor) -> NDArray[np.float32]:
    """What ``score`` makes of the rows, a batch at a time. Shape (len(rows),)."""
    with torch.inference_mode():
        batches = [score(_read(inputs, batch)) for batch in rows.split(SCORE_BATCH) if len(batch)]
    scores = torch.cat(batches).cpu().numpy() if batches else np.empty(0, np.float32)
    check_scores(scores, len(rows))
    return scores


def _read(inputs: InputRows, rows: Tensor) -> Tensor:
    """As they are kept: the network makes float32 of what it reads of them."""
    return torch.from_numpy(np.asarray(inputs[rows.numpy()]))
