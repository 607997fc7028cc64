from __future__ import annotations

from dataclasses import replace

import torch

from handsight.datasets.inputs.augmentation import FLIPS, Jitter, flipped


def _inputs(batch: int) -> torch.Tensor:
    return torch.rand(batch, 4, 8, 8, generator=torch.Generator().manual_seed(0))


def test_the_four_flips_are_those_of_a_rectangle() -> None:
    inputs = _inputs(1).expand(FLIPS, -1, -1, -1)
    as_recorded, left_right, top_bottom, both = flipped(inputs, torch.arange(FLIPS))
    torch.testing.assert_close(as_recorded, inputs[0])
    torch.testing.assert_close(left_right, inputs[0].flip(2))
    torch.testing.assert_close(top_bottom, inputs[0].flip(1))
    torch.testing.assert_close(both, inputs[0].rot90(2, (1, 2)))


def test_flipping_twice_is_nothing() -> None:
    inputs, which = _inputs(12), torch.arange(12) % FLIPS
    torch.testing.assert_close(flipped(flipped(inputs, which), which), inputs)


def test_jitter_varies_what_it_is_told_to_and_follows_its_generator() -> None:
    inputs = _inputs(5)
    still = Jitter(brightness=0, colour_noise=0, height_noise_m=0, turn_rad=0, shift=0)
    torch.testing.assert_close(still(inputs, torch.Generator().manual_seed(1)), inputs)
    brighter = replace(still, brightness=0.3)(inputs, torch.Generator().manual_seed(1))
    factors = (brighter[:, :3] / inputs[:, :3]).flatten(1)
    torch.testing.assert_close(factors, factors[:, :1].expand_as(factors))
    assert (factors[:, 0] - 1).abs().max() <= 0.3
    assert factors[:, 0].std() > 0.01
    torch.testing.assert_close(brighter[:, 3], inputs[:, 3])
    noisy = [Jitter()(inputs, torch.Generator().manual_seed(seed)) for seed in (1, 1, 2)]
    assert torch.equal(noisy[0], noisy[1])
    assert not torch.equal(noisy[0], noisy[2])


def test_moving_turns_about_the_grasp_point_and_never_far() -> None:
    """The middle of a cross stays the middle of a turned cross; a shift moves it by no more than it may."""
    cross = torch.zeros(64, 4, 33, 33)
    cross[:, :, 16, :] = cross[:, :, :, 16] = 1.0
    still = Jitter(brightness=0, colour_noise=0, height_noise_m=0, turn_rad=0, shift=0)
    turned = replace(still, turn_rad=0.3)(cross, torch.Generator().manual_seed(0))
    assert turned[:, 0, 16, 16].min() > 0.95
    assert not torch.allclose(turned, cross)
    shifted = replace(still, shift=3 / 33)(cross, torch.Generator().manual_seed(0))
    places = shifted[:, 0].sum(1).argmax(1) - 16
    assert places.abs().max() == 3
    assert len(places.unique()) > 3
