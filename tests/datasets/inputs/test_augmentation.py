from __future__ import annotations

from dataclasses import replace

import torch

from handsight.datasets.inputs.augmentation import FLIPS, InputForm, Jitter, flipped

_STILL = Jitter(brightness=0, colour_noise=0, height_noise_m=0, turn_rad=0, shift=0, flips=False)


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
    torch.testing.assert_close(_STILL(inputs, torch.Generator().manual_seed(1)), inputs)
    brighter = replace(_STILL, brightness=0.3)(inputs, torch.Generator().manual_seed(1))
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
    turned = replace(_STILL, turn_rad=0.3)(cross, torch.Generator().manual_seed(0))
    assert turned[:, 0, 16, 16].min() > 0.95
    assert not torch.allclose(turned, cross)
    shifted = replace(_STILL, shift=3 / 33)(cross, torch.Generator().manual_seed(0))
    places = shifted[:, 0].sum(1).argmax(1) - 16
    assert places.abs().max() == 3
    assert len(places.unique()) > 3


def test_inputs_are_flipped_at_random_into_all_four() -> None:
    inputs = _inputs(64)
    only_flips = Jitter(brightness=0, colour_noise=0, height_noise_m=0, turn_rad=0, shift=0)
    varied = only_flips(inputs.half(), torch.Generator().manual_seed(0))
    every = torch.stack([flipped(inputs.half().float(), torch.full((64,), which)) for which in range(FLIPS)])
    same = (every == varied).flatten(2).all(2)  # (4, 64)
    assert same.sum(0).tolist() == [1] * 64
    assert (same.sum(1) >= 8).all()


def test_what_is_varied_is_a_copy() -> None:
    """Inputs that lie in memory as the varied ones do are not written to."""
    inputs = _inputs(5).contiguous(memory_format=torch.channels_last)
    before = inputs.clone()
    replace(_STILL, brightness=0.3, height_noise_m=0.1)(inputs, torch.Generator().manual_seed(1))
    assert torch.equal(inputs, before)


def test_noise_has_the_strength_of_its_channel() -> None:
    inputs = torch.zeros(200, 4, 64, 64)
    noisy = replace(_STILL, colour_noise=0.02, height_noise_m=0.001)(inputs, torch.Generator().manual_seed(1))
    sigma = noisy.std(dim=(0, 2, 3))
    torch.testing.assert_close(sigma, torch.tensor([0.02, 0.02, 0.02, 0.001]), rtol=0.02, atol=0)
    again = replace(_STILL, colour_noise=0.02)(inputs, torch.Generator().manual_seed(2))
    assert not torch.equal(noisy[:, 0], again[:, 0])


def test_a_form_is_what_the_varied_inputs_would_be_brought_to_afterwards() -> None:
    inputs = torch.rand(20, 4, 12, 12, generator=torch.Generator().manual_seed(0)).half()
    form = InputForm(size_px=9, first=1, shift=(0.5, 0.2, 0.0), scale=(0.25, 0.5, 0.03))
    jitter = Jitter(colour_noise=0, height_noise_m=0)
    as_recorded = jitter(inputs, torch.Generator().manual_seed(1))
    expected = (as_recorded[:, 1:, :9, :9] - torch.tensor(form.shift)[:, None, None]) / torch.tensor(form.scale)[
        :, None, None
    ]
    formed = jitter(inputs, torch.Generator().manual_seed(1), form)
    torch.testing.assert_close(formed, expected)
    assert formed.is_contiguous(memory_format=torch.channels_last)
    rounded = jitter(inputs, torch.Generator().manual_seed(1), replace(form, dtype=torch.bfloat16))
    assert torch.equal(rounded, formed.bfloat16())
    noisy = Jitter(colour_noise=0.1)(inputs, torch.Generator().manual_seed(1), form) - formed
    assert noisy[:, 0].std() > noisy[:, 1].std() > 0  # the same noise in colours of other scales
