"""Scorers against the networks they are made of, and maps against windows scored one by one."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.networks import blobs, trained_looking

from handsight.servoing.homography import InputGrid
from handsight.servoing.scorer import PartScorer
from handsight.training.errors import NetworkSettingsError, PictureError
from handsight.training.gqn import CHANNEL_SETS, GqnConfig
from handsight.training.scorer import Scorer


@pytest.mark.parametrize("channels", CHANNEL_SETS)
@pytest.mark.parametrize("padded", [False, True])
def test_scores_are_those_of_the_network(channels: str, padded: bool) -> None:
    network = trained_looking(GqnConfig(channels=channels, padded=padded))
    inputs = blobs(5)
    scores = Scorer(network, InputGrid())(inputs)
    expected = torch.sigmoid(network(inputs)).detach()
    assert expected.std() > 1e-2
    torch.testing.assert_close(scores, expected, atol=1e-5, rtol=0)


@pytest.mark.parametrize("padded", [False, True])
def test_what_a_scorer_does_not_read_need_not_be_made(padded: bool) -> None:
    scorer = Scorer(trained_looking(GqnConfig(padded=padded)), InputGrid())
    assert isinstance(scorer, PartScorer)
    assert scorer.reach_px == (64 if padded else 49)
    inputs = blobs(5)
    torch.testing.assert_close(scorer(inputs[..., : scorer.reach_px, : scorer.reach_px]), scorer(inputs))


def test_training_a_network_further_changes_no_score() -> None:
    network = trained_looking(GqnConfig())
    scorer, inputs = Scorer(network, InputGrid()), torch.rand(3, 4, 64, 64)
    before = scorer(inputs)
    with torch.no_grad():
        for tensor in network.parameters():
            tensor.mul_(2)
    assert torch.equal(scorer(inputs), before)


@pytest.mark.parametrize("padded", [False, True])
def test_bfloat16_moves_scores_by_little_of_their_range(padded: bool) -> None:
    network = trained_looking(GqnConfig(padded=padded))
    inputs = blobs(64)
    exact = Scorer(network, InputGrid())(inputs)
    coarse = Scorer(network, InputGrid(), precision="bfloat16")(inputs)
    assert coarse.dtype == torch.float32
    assert not torch.equal(coarse, exact)
    assert exact.std() > 0.1
    assert (coarse - exact).abs().max() < 2e-2
    assert (coarse - exact).abs().mean() < 3e-3


def test_a_scorer_knows_its_grid_and_refuses_that_of_another_network() -> None:
    network = trained_looking(GqnConfig())
    assert Scorer(network, InputGrid(crop_px=300)).grid.crop_px == 300
    with pytest.raises(NetworkSettingsError, match="inputs of 32 px, expected 64 px"):
        Scorer(network, InputGrid(size_px=32))


@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
def test_gradients_reach_inputs_that_ask_for_them_and_nothing_is_kept_otherwise(precision: str) -> None:
    scorer = Scorer(trained_looking(GqnConfig()), InputGrid(), precision=precision)  # type: ignore[arg-type]
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


def test_a_network_is_scored_where_it_lies() -> None:
    """On the meta device nothing has values, so whatever would be copied to the processor fails."""
    scorer = Scorer(trained_looking(GqnConfig()).to("meta"), InputGrid(), precision="auto")
    assert scorer(torch.empty(5, 4, 64, 64, device="meta")).shape == (5,)
    assert scorer.score_map(torch.empty(4, 70, 80, device="meta"), every=2).device.type == "meta"


SHAPES = (
    GqnConfig(widths=(4, 6), kernels=(3, 3), dense=(8,), size_px=16),
    GqnConfig(channels="rgb", widths=(4, 6, 5), kernels=(4, 3, 2), dense=(8, 3), size_px=21),
    GqnConfig(channels="depth", widths=(3,), kernels=(1,), dense=(), size_px=5),
    GqnConfig(channels="depth", widths=(4, 6), kernels=(5, 3), dense=(8,), size_px=16, padded=True),
    GqnConfig(widths=(4, 4, 4, 4), size_px=64),
)


@settings(deadline=None, max_examples=60)
@given(
    config=st.sampled_from(SHAPES),
    every=st.integers(1, 9),
    beyond_px=st.tuples(st.integers(0, 25), st.integers(0, 25)),
    seed=st.integers(0, 2**31),
)
def test_a_map_holds_the_score_of_every_window(
    config: GqnConfig, every: int, beyond_px: tuple[int, int], seed: int
) -> None:
    scorer = Scorer(trained_looking(config, seed=seed), InputGrid(size_px=config.size_px))
    size = config.size_px
    generator = torch.Generator().manual_seed(seed)
    picture = torch.rand(4, size + beyond_px[0], size + beyond_px[1], generator=generator)
    scores = scorer.score_map(picture, every=every)
    rows, columns = range(0, beyond_px[0] + 1, every), range(0, beyond_px[1] + 1, every)
    assert scores.shape == (len(rows), len(columns))
    windows = torch.stack([picture[:, row : row + size, column : column + size] for row in rows for column in columns])
    torch.testing.assert_close(scores.ravel(), scorer(windows), atol=1e-4, rtol=0)


@pytest.mark.parametrize("padded", [False, True])
def test_gradients_reach_a_picture_that_asks_for_them(padded: bool) -> None:
    scorer = Scorer(trained_looking(GqnConfig(padded=padded)), InputGrid())
    picture = torch.rand(4, 66, 66, requires_grad=True)
    (gradient,) = torch.autograd.grad(scorer.score_map(picture).sum(), picture)
    assert gradient.abs().sum() > 0
    assert not scorer.score_map(picture.detach()).requires_grad


@pytest.mark.parametrize(
    ("shape", "every"), [((4, 63, 80), 1), ((4, 80, 63), 1), ((3, 80, 80), 1), ((4, 80), 1), ((4, 80, 80), 0)]
)
def test_a_picture_without_a_window_is_refused(shape: tuple[int, ...], every: int) -> None:
    scorer = Scorer(trained_looking(GqnConfig()), InputGrid())
    with pytest.raises(PictureError, match="sides of at least 64 px, and a step of at least 1 px"):
        scorer.score_map(torch.rand(shape), every=every)
