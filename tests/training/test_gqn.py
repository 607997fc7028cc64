from __future__ import annotations

from typing import Any

import pytest
import torch

from handsight.servoing.homography import InputGrid
from handsight.training.errors import NetworkSettingsError
from handsight.training.gqn import CHANNEL_SETS, GqnConfig, GraspQualityNetwork, Scorer


@pytest.mark.parametrize("channels", CHANNEL_SETS)
def test_scores_are_probabilities_of_the_right_shape(channels: str) -> None:
    network = GraspQualityNetwork(GqnConfig(channels=channels))
    scores = Scorer(network, InputGrid())(torch.rand(5, 4, 64, 64))
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


@pytest.mark.parametrize(
    ("settings", "fault"),
    [
        ({"size_px": 0}, "size_px is 0"),
        ({"size_px": -16}, "size_px is -16"),
        ({"size_px": 16 * 10**8}, "size_px is 1600000000"),
        ({"size_px": 64.0}, "size_px is 64.0"),
        ({"widths": (0, 8, 8, 8)}, "widths are"),
        ({"widths": (16, 32, 48, 10**9)}, "widths are"),
        ({"widths": (8,) * 40, "kernels": (3,) * 40}, "40 widths"),
        ({"kernels": (-1, 3, 3, 3)}, "kernels are"),
        ({"dense": (True,)}, "dense are"),
        ({"dense": (4096,) * 8}, "parameters, expected at most"),
    ],
)
def test_a_network_of_impossible_size_is_refused_before_it_is_built(settings: dict[str, Any], fault: str) -> None:
    with pytest.raises(NetworkSettingsError, match=fault):
        GqnConfig(**settings)


@pytest.mark.parametrize(
    "config",
    [
        GqnConfig(),
        GqnConfig(channels="depth", widths=(4,), kernels=(1,), dense=(), size_px=2),
        GqnConfig(channels="rgb", widths=(8, 4), kernels=(3, 5), dense=(16,), size_px=16),
    ],
    ids=["default", "smallest", "other"],
)
def test_what_a_network_keeps_is_known_before_it_is_built(config: GqnConfig) -> None:
    network = GraspQualityNetwork(config)
    assert {name: tuple(tensor.shape) for name, tensor in network.state_dict().items()} == config.shapes
    assert config.parameters == sum(parameter.numel() for parameter in network.parameters())


def test_a_scorer_knows_its_grid_and_refuses_that_of_another_network() -> None:
    network = GraspQualityNetwork(GqnConfig())
    assert Scorer(network, InputGrid(crop_px=300)).grid.crop_px == 300
    with pytest.raises(NetworkSettingsError, match="inputs of 32 px, expected 64 px"):
        Scorer(network, InputGrid(size_px=32))


def test_gradients_reach_inputs_that_ask_for_them_and_nothing_is_kept_otherwise() -> None:
    torch.manual_seed(0)
    scorer = Scorer(GraspQualityNetwork(GqnConfig()), InputGrid())
    inputs = torch.rand(3, 4, 64, 64)
    plain = scorer(inputs)
    assert not plain.requires_grad
    asking = inputs.clone().requires_grad_()
    scores = scorer(asking)
    assert torch.equal(scores.detach(), plain)
    (gradient,) = torch.autograd.grad(scores.sum(), asking)
    assert gradient.abs().sum() > 0
    with torch.no_grad():
        assert not scorer(asking).requires_grad
