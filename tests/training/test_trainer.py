"""Training on drawn inputs whose rule is known."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
import torch
from tests.support.drawn import SMALL, drawn_inputs

from handsight.datasets.inputs.augmentation import Jitter
from handsight.datasets.inputs.materialize import GraspInputs
from handsight.servoing.errors import ScoreError
from handsight.training.errors import DivergedError, TrainerSettingsError, TrainingDataError
from handsight.training.gqn import GraspQualityNetwork
from handsight.training.trainer import TrainSettings, predict, predict_with_flips, train


def test_training_learns_the_rule_and_it_carries_over() -> None:
    network, history = train(drawn_inputs(300, seed=0), SMALL)
    assert history[-1].train_loss < 0.5 * history[0].train_loss
    assert history[-1].held_out.attempts == 75
    assert (history[-1].held_out.auc or 0) > 0.95
    fresh = drawn_inputs(100, seed=9)
    scores = predict(network, fresh.inputs, torch.arange(100))
    assert scores[fresh.labels == 1].mean() > scores[fresh.labels == 0].mean() + 0.4


def test_equal_seeds_give_equal_weights_and_leave_torch_alone() -> None:
    data, quick = drawn_inputs(80, seed=0), replace(SMALL, epochs=2)
    torch.manual_seed(3)
    expected_draw = torch.rand(1)
    torch.manual_seed(3)
    first = train(data, quick)[0].state_dict()
    assert torch.equal(torch.rand(1), expected_draw)
    second = train(data, quick)[0].state_dict()
    other = train(data, replace(quick, seed=2))[0].state_dict()
    assert all(torch.equal(first[name], second[name]) for name in first)
    assert not all(torch.equal(first[name], other[name]) for name in first)


def test_scores_with_flips_are_the_mean_over_the_flips_of_each_input() -> None:
    data = drawn_inputs(50, seed=0)
    network, _ = train(data, replace(SMALL, epochs=1))
    rows = torch.tensor([3, 40, 8])
    turned = [data.inputs[rows.numpy()][..., ::down, ::across] for down in (1, -1) for across in (1, -1)]
    expected = np.mean([predict(network, inputs.copy(), torch.arange(3)) for inputs in turned], axis=0)
    np.testing.assert_allclose(predict_with_flips(network, data.inputs, rows), expected, atol=1e-6)


@dataclass(frozen=True, slots=True, kw_only=True)
class Watched(Jitter):
    """Varies nothing and keeps every batch it is given."""

    batches: list[torch.Tensor] = field(default_factory=list)

    def __call__(self, inputs: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
        self.batches.append(inputs)
        return inputs


def passes_of(data: GraspInputs, settings: TrainSettings) -> list[list[bytes]]:
    """The inputs that the network learnt from, pass by pass, in their order."""
    watched = Watched()
    train(data, replace(settings, jitter=watched))
    inputs = [one.numpy().tobytes() for batch in watched.batches for one in batch]
    size = len(inputs) // settings.epochs
    return [inputs[start : start + size] for start in range(0, len(inputs), size)]


def test_every_pass_sees_every_attempt_in_all_flips_once_and_in_an_order_of_its_own() -> None:
    data, settings = drawn_inputs(30, seed=0), replace(SMALL, epochs=2, holdout=0)
    inputs = data.inputs.astype(np.float32)
    flips = [inputs[..., ::down, ::across] for down in (1, -1) for across in (1, -1)]
    expected = sorted(one.tobytes() for flip in flips for one in flip)
    first, second = passes_of(data, settings)
    assert sorted(first) == sorted(second) == expected
    assert first != second
    assert passes_of(data, settings) == [first, second]
    assert passes_of(data, replace(settings, seed=7))[0] != first


def test_a_batch_of_one_is_left_out() -> None:
    """Over one input of which one pixel is left, batch normalisation has no variance, and torch refuses."""
    data = drawn_inputs(10, seed=0)
    small = GraspInputs(inputs=data.inputs[:, :, 6:10, 6:10].copy(), attempts=data.attempts)
    settings = replace(SMALL, network=replace(SMALL.network, size_px=4, padded=True), epochs=1, holdout=0, batch=13)
    (seen,) = passes_of(small, settings)
    assert len(seen) == 39


@pytest.mark.parametrize("seed", [-1, 2**40])
def test_any_seed_that_torch_takes_will_do(seed: int) -> None:
    _, history = train(drawn_inputs(20, seed=0), replace(SMALL, epochs=1, seed=seed))
    assert np.isfinite(history[0].train_loss)


def test_one_class_alone_teaches_nothing() -> None:
    data = drawn_inputs(20, seed=0)
    same = GraspInputs(inputs=data.inputs, attempts=data.attempts.assign(success=False))
    with pytest.raises(TrainingDataError, match="0 of 20"):
        train(same, SMALL)


def test_bad_settings_report_every_fault() -> None:
    with pytest.raises(TrainerSettingsError) as caught:
        TrainSettings(epochs=0, batch=1, learning_rate=-1, holdout=1.0)
    for part in ("0 epochs", "learning rate is -1", "holdout is 1.0"):
        assert part in str(caught.value)


def test_training_that_diverges_says_so_instead_of_ending_in_a_network() -> None:
    data = drawn_inputs(40, seed=0)
    spoilt = data.inputs.copy()
    spoilt[3] = np.nan
    with pytest.raises(DivergedError, match="the loss is nan in epoch 1, expected a number"):
        train(GraspInputs(inputs=spoilt, attempts=data.attempts), replace(SMALL, epochs=2, holdout=0))


def test_scores_that_are_none_are_not_compared_with_labels() -> None:
    data = drawn_inputs(20, seed=0)
    network = GraspQualityNetwork(SMALL.network)
    with torch.no_grad():
        list(network.parameters())[-1].fill_(torch.nan)
    for judge in (predict, predict_with_flips):
        with pytest.raises(ScoreError, match="20 of 20 scores"):
            judge(network, data.inputs, torch.arange(20))
