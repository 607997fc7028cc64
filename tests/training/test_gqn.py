from __future__ import annotations

from typing import Any

import pytest
import torch

from handsight.training.errors import NetworkSettingsError
from handsight.training.gqn import CHANNEL_SETS, GqnConfig, GraspQualityNetwork


@pytest.mark.parametrize("channels", CHANNEL_SETS)
def test_there_is_a_logit_for_each_input(channels: str) -> None:
    logits = GraspQualityNetwork(GqnConfig(channels=channels))(torch.rand(5, 4, 64, 64))
    assert logits.shape == (5,)
    assert torch.isfinite(logits).all()


@pytest.mark.parametrize(("channels", "blind_to"), [("rgb", slice(3, 4)), ("depth", slice(0, 3))])
def test_a_variant_reads_only_its_channels(channels: str, blind_to: slice) -> None:
    torch.manual_seed(0)
    network = GraspQualityNetwork(GqnConfig(channels=channels)).eval()
    inputs = torch.rand(2, 4, 64, 64)
    other = inputs.clone()
    other[:, blind_to] = 0.3
    torch.testing.assert_close(network(inputs), network(other))
    assert not torch.allclose(network(inputs), network(1 - inputs))


@pytest.mark.parametrize(("padded", "side", "most"), [(False, 2, 90_000), (True, 4, 190_000)])
def test_every_layer_halves_and_the_network_stays_small(padded: bool, side: int, most: int) -> None:
    """Section III-B: stride 2 instead of pooling; light enough for a laptop."""
    network = GraspQualityNetwork(GqnConfig(padded=padded))
    convolutions = [layer for layer in network.features if isinstance(layer, torch.nn.Conv2d)]
    assert [layer.stride for layer in convolutions] == [(2, 2)] * 4
    assert {layer.padding == (0, 0) for layer in convolutions} == {not padded}
    assert network.features(torch.rand(2, 4, 64, 64)).shape == (2, 64, side, side)
    assert sum(parameter.numel() for parameter in network.parameters()) < most
    kinds = {type(layer).__name__ for layer in network.modules()}
    assert {"ELU", "BatchNorm2d", "SELU"} <= kinds


def test_every_parameter_learns() -> None:
    network = GraspQualityNetwork(GqnConfig())
    torch.autograd.backward(network(torch.rand(8, 4, 64, 64)).square().sum())
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in network.parameters())


def test_bad_shapes_report_every_fault() -> None:
    with pytest.raises(NetworkSettingsError) as caught:
        GqnConfig(channels="rgbx", widths=(8,), kernels=(4, 3), size_px=33, padded=True)
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
        ({"padded": 1}, "padded is 1, expected true or false"),
        ({"kernels": (4, 3, 4, 4), "padded": True}, "expected odd sizes"),
        ({"size_px": 72, "padded": True}, "size_px is 72, expected a multiple of 16"),
        ({"size_px": 4}, "size_px is 4, which leaves 4 px to convolution 1 with its kernel of 5"),
        (
            {"size_px": 30},
            "size_px is 30, which leaves 2 px to convolution 4 with its kernel of 3, expected at least 3",
        ),
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
        GqnConfig(channels="rgb", widths=(8, 4), kernels=(3, 5), dense=(16,), size_px=16, padded=True),
        GqnConfig(widths=(8, 4), kernels=(4, 3), dense=(16,), size_px=33),
    ],
    ids=["default", "smallest", "padded", "other"],
)
def test_what_a_network_keeps_is_known_before_it_is_built(config: GqnConfig) -> None:
    network = GraspQualityNetwork(config)
    assert {name: tuple(tensor.shape) for name, tensor in network.state_dict().items()} == config.shapes
    assert config.parameters == sum(parameter.numel() for parameter in network.parameters())


@pytest.mark.parametrize("config", [GqnConfig(channels="rgb"), GqnConfig(channels="depth", padded=True)], ids=str)
def test_inputs_in_the_networks_form_have_the_same_logits(config: GqnConfig) -> None:
    """With what is beyond the reach left out, which no score depends on."""
    torch.manual_seed(0)
    network = GraspQualityNetwork(config).eval()
    inputs = torch.rand(3, 4, 64, 64)
    form = network.form()
    side = form.size_px
    shift, scale = (torch.tensor(values)[:, None, None] for values in (form.shift, form.scale))
    formed = (inputs[:, form.channels, :side, :side] - shift) / scale
    assert side == (64 if config.padded else 49)
    torch.testing.assert_close(network.logits_of(formed), network(inputs))
    whole = network.head(network.features((inputs[:, form.channels] - shift) / scale))[:, 0]
    torch.testing.assert_close(network(inputs), whole)
