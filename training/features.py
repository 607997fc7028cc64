"""What a network makes of its inputs before it decides: vectors that lie near each other for grasps that look alike."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from handsight.datasets.inputs.mixture import InputRows
from handsight.training.gqn import GraspQualityNetwork

FEATURE_BATCH = 512


def network_features(network: GraspQualityNetwork, inputs: InputRows, rows: NDArray[np.int64]) -> NDArray[np.float32]:
    """The last hidden layer for some rows of materialized inputs, each of length one. Shape (len(rows), D).

    Their scalar products are cosines: 1 for what the network cannot tell apart.
    """
    network.eval()
    vectors = []
    with torch.inference_mode():
        for start in range(0, len(rows), FEATURE_BATCH):
            batch = np.asarray(inputs[rows[start : start + FEATURE_BATCH]], dtype=np.float32)
            hidden = network.hidden(torch.from_numpy(batch).to(network.device))
            vectors.append(torch.nn.functional.normalize(hidden, dim=1).cpu().numpy())
    return np.concatenate(vectors) if vectors else np.empty((0, 0), np.float32)
