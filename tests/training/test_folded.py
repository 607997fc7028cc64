from __future__ import annotations

import pytest
import torch
from tests.support.networks import trained_looking

from handsight.training.folded import folded
from handsight.training.gqn import GqnConfig


@pytest.mark.parametrize(
    "config",
    [
        GqnConfig(),
        GqnConfig(padded=True),
        GqnConfig(channels="rgb"),
        GqnConfig(channels="depth", widths=(3,), kernels=(1,), dense=(), size_px=5),
    ],
    ids=["default", "padded", "rgb", "smallest"],
)
def test_the_same_function_is_computed(config: GqnConfig) -> None:
    network = trained_looking(config)
    inputs = torch.rand(6, 4, config.size_px, config.size_px, generator=torch.Generator().manual_seed(2))
    inputs[:, 3] = 0.1 * inputs[:, 3] - 0.05
    expected = network(inputs).detach()
    torch.testing.assert_close(folded(network).logits(inputs), expected, atol=2e-5, rtol=1e-5)


def test_inputs_are_read_as_they_are_where_that_is_exact() -> None:
    """At a border of zeros the network sees a grey picture after its normalisation, and another before."""
    assert folded(trained_looking(GqnConfig())).normalisation is None
    assert folded(trained_looking(GqnConfig(padded=True))).normalisation is not None
    assert folded(trained_looking(GqnConfig()), dtype=torch.bfloat16).normalisation is not None


def test_a_network_in_training_is_folded_as_in_inference_and_left_in_training() -> None:
    network = trained_looking(GqnConfig())
    inputs = torch.rand(3, 4, 64, 64)
    expected = folded(network).logits(inputs)
    network.train()
    assert torch.equal(folded(network).logits(inputs), expected)
    assert network.training


@pytest.mark.parametrize(
    "config",
    [GqnConfig(), GqnConfig(kernels=(4, 3, 3, 3)), GqnConfig(widths=(4, 4), kernels=(3, 2), size_px=20)],
    ids=str,
)
def test_pixels_beyond_the_reach_change_nothing_and_the_last_within_does(config: GqnConfig) -> None:
    network = folded(trained_looking(config))
    inputs = torch.rand(1, 4, config.size_px, config.size_px, generator=torch.Generator().manual_seed(2))
    for changed_px, equal in ((config.reach_px, True), (config.reach_px - 1, False)):
        other = inputs.clone()
        other[..., changed_px:] = 3.0
        assert torch.equal(network.logits(other), network.logits(inputs)) == (equal or changed_px == config.size_px)
