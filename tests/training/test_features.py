"""Features are what the last layer sees, of length one."""

from __future__ import annotations

import numpy as np
import torch
from tests.support.drawn import SMALL, drawn_inputs

from handsight.training.features import FEATURE_BATCH, network_features
from handsight.training.gqn import GraspQualityNetwork


def test_the_last_layer_makes_the_logit_of_them() -> None:
    torch.manual_seed(0)
    network = GraspQualityNetwork(SMALL.network).eval()
    data = drawn_inputs(FEATURE_BATCH + 3, seed=0)
    rows = np.arange(len(data.attempts))[::-1].copy()
    features = network_features(network, data.inputs, rows)
    assert features.shape == (FEATURE_BATCH + 3, SMALL.network.dense[-1])
    np.testing.assert_allclose(np.linalg.norm(features, axis=1), 1.0, rtol=1e-5)
    inputs = torch.from_numpy(np.asarray(data.inputs[rows], dtype=np.float32))
    with torch.inference_mode():
        hidden, last = network.hidden(inputs), network.head[-1]
        torch.testing.assert_close(last(hidden)[:, 0], network(inputs))
        torch.testing.assert_close(torch.nn.functional.normalize(hidden, dim=1), torch.from_numpy(features))


def test_of_nothing_there_are_none() -> None:
    network = GraspQualityNetwork(SMALL.network)
    assert len(network_features(network, drawn_inputs(3, seed=0).inputs, np.empty(0, np.int64))) == 0
