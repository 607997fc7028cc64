from __future__ import annotations

import pytest
import torch

from handsight.training.errors import NetworkSettingsError
from handsight.training.gqn import CHANNEL_SETS, GqnConfig, GraspQualityNetwork, Scorer


@pytest.mark.parametrize("channels", CHANNEL_SETS)
def test_scores_are_probabilities_of_the_right_shape(channels: str) -> None:
    network = GraspQualityNetwork(GqnConfig(channels=channels))
    scores = Scorer(network)(torch.rand(5, 4, 64, 64))
    assert scores.shape == (5,)
    assert ((scores > 0) & (scores < 1)).all()


@pytest.mark.parametrize(("channels", "blind_to"), [("rgb", slice(3, 4)), ("depth", slice(0, 3))])
def test_a_variant_reads_only_its_channels(channels: str, blind_to: slice) -> None:
    torch.manual_seed(0)
    network = GraspQualityNetwork(GqnConfig(channels=channels)).eval()
    inputs = torch.rand(2, 4, 64, 64)
    other = inputs.clone()
    other[:, blind_to] = 0.3
    torch.testing.assert_close(network(inputs), network(other))
    assert not torch.allclose(network(inputs), network(1 - inputs))


def test_every_layer_halves_and_the_network_stays_small() -> None:
    """Section III-B: stride 2 instead of pooling; light enough for a laptop."""
    network = GraspQualityNetwork(GqnConfig())
    convolutions = [layer for layer in network.features if isinstance(layer, torch.nn.Conv2d)]
    assert [layer.stride for layer in convolutions] == [(2, 2)] * 4
    assert network.features(torch.rand(2, 4, 64, 64)).shape == (2, 64, 4, 4)
    assert sum(parameter.numel() for parameter in network.parameters()) < 300_000
    kinds = {type(layer).__name__ for layer in network.modules()}
    assert {"ELU", "BatchNorm2d", "SELU"} <= kinds


def test_every_parameter_learns() -> None:
    network = GraspQualityNetwork(GqnConfig())
    torch.autograd.backward(network(torch.rand(8, 4, 64, 64)).square().sum())
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in network.parameters())


def test_bad_shapes_report_every_fault() -> None:
    with pytest.raises(NetworkSettingsError) as caught:
        GqnConfig(channels="rgbx", widths=(8,), kernels=(4, 3), size_px=33)
    for part in ("rgbx", "1 widths and 2 kernels", "odd", "33"):
        assert part in str(caught.value)
