"""Training on drawn inputs whose rule is known."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd
import pytest
import torch
from tests.support.drawn import SMALL, drawn_inputs

from handsight.datasets.inputs.augmentation import AS_RECORDED, InputForm, Jitter
from handsight.datasets.inputs.materialize import GraspInputs
from handsight.datasets.inputs.mixture import mixed
from handsight.servoing.errors import ScoreError
from handsight.training import trainer
from handsight.training.errors import DivergedError, TrainerSettingsError, TrainingDataError
from handsight.training.gqn import GqnConfig, GraspQualityNetwork
from handsight.training.passes import mixed_up
from handsight.training.precision import Precision
from handsight.training.prediction import predict, predict_with_flips
from handsight.training.settings import TrainSettings
from handsight.training.trainer import train


def test_training_learns_the_rule_and_it_carries_over() -> None:
    trained = train(drawn_inputs(300, seed=0), SMALL)
    network, history = trained.network, trained.history
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
    first = train(data, quick).network.state_dict()
    assert torch.equal(torch.rand(1), expected_draw)
    second = train(data, quick).network.state_dict()
    other = train(data, replace(quick, seed=2)).network.state_dict()
    assert all(torch.equal(first[name], second[name]) for name in first)
    assert not all(torch.equal(first[name], other[name]) for name in first)


def test_a_training_that_begins_in_another_thread_changes_no_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    data, quick = drawn_inputs(80, seed=0), replace(SMALL, epochs=1)
    expected = train(data, quick).network.state_dict()
    found: list[dict[str, torch.Tensor]] = []
    other = threading.Thread(target=lambda: found.append(train(data, quick).network.state_dict()))

    second_begins, first_ends = threading.Event(), threading.Event()

    def built(config: GqnConfig) -> GraspQualityNetwork:
        if threading.current_thread() is other:
            second_begins.set()
            first_ends.wait(timeout=10)
            return GraspQualityNetwork(config)
        other.start()
        second_begins.wait(timeout=1)  # Not in vain where it need not wait for its turn.
        network = GraspQualityNetwork(config)
        first_ends.set()
        return network

    monkeypatch.setattr(trainer, "GraspQualityNetwork", built)
    found.append(train(data, quick).network.state_dict())
    other.join()
    assert len(found) == 2
    for weights in found:
        assert all(torch.equal(expected[name], weights[name]) for name in expected)


def test_scores_with_flips_are_the_mean_over_the_flips_of_each_input() -> None:
    data = drawn_inputs(50, seed=0)
    network = train(data, replace(SMALL, epochs=1)).network
    rows = torch.tensor([3, 40, 8])
    turned = [data.inputs[rows.numpy()][..., ::down, ::across] for down in (1, -1) for across in (1, -1)]
    expected = np.mean([predict(network, inputs.copy(), torch.arange(3)) for inputs in turned], axis=0)
    np.testing.assert_allclose(predict_with_flips(network, data.inputs, rows), expected, atol=1e-6)


@dataclass(frozen=True, slots=True, kw_only=True)
class Watched(Jitter):
    """Keeps every batch it is given."""

    batches: list[torch.Tensor] = field(default_factory=list)

    def __call__(self, inputs: torch.Tensor, generator: torch.Generator, form: InputForm = AS_RECORDED) -> torch.Tensor:
        self.batches.append(inputs)
        return Jitter.__call__(self, inputs, generator, form)


def passes_of(data: GraspInputs, settings: TrainSettings) -> list[list[bytes]]:
    """The inputs that the network learnt from, pass by pass, in their order."""
    watched = Watched()
    train(data, replace(settings, jitter=watched))
    inputs = [one.numpy().tobytes() for batch in watched.batches for one in batch]
    size = len(inputs) // settings.epochs
    return [inputs[start : start + size] for start in range(0, len(inputs), size)]


def test_every_pass_sees_every_attempt_four_times_and_in_an_order_of_its_own() -> None:
    data, settings = drawn_inputs(30, seed=0), replace(SMALL, epochs=2, holdout=0)
    expected = sorted(one.tobytes() for one in data.inputs for _ in range(4))
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
    trained = train(drawn_inputs(20, seed=0), replace(SMALL, epochs=1, seed=seed))
    assert np.isfinite(trained.history[0].train_loss)


def test_one_class_alone_teaches_nothing() -> None:
    data = drawn_inputs(20, seed=0)
    same = GraspInputs(inputs=data.inputs, attempts=data.attempts.assign(success=False))
    with pytest.raises(TrainingDataError, match="0 of 20"):
        train(same, SMALL)


def test_bad_settings_report_every_fault() -> None:
    with pytest.raises(TrainerSettingsError) as caught:
        TrainSettings(epochs=0, batch=1, learning_rate=-1, holdout=1.0, patience=0, average=1, mixup=-0.1)
    faults = ("0 epochs", "learning rate is -1", "holdout is 1.0", "patience is 0", "average 1", "mixup is -0.1")
    assert all(part in str(caught.value) for part in faults)


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


def unlearnable(count: int) -> GraspInputs:
    """Labels that have nothing to do with the pictures: what is learnt from them does not carry over."""
    data = drawn_inputs(count, seed=0)
    return GraspInputs(inputs=data.inputs, attempts=data.attempts.sample(frac=1, random_state=1).reset_index(drop=True))


def test_training_ends_where_the_held_out_loss_no_longer_falls_and_keeps_what_was_best() -> None:
    data, settings = unlearnable(120), replace(SMALL, epochs=60, least_epochs=1, patience=2, warmup_steps=0)
    trained = train(data, settings)
    losses = [epoch.held_out.loss or 0.0 for epoch in trained.history]
    assert trained.kept.number == 1 + int(np.argmin(losses))
    assert len(losses) == trained.kept.number + 2 < 60
    shorter = train(data, replace(settings, epochs=trained.kept.number)).network.state_dict()
    kept = trained.network.state_dict()
    assert all(torch.equal(kept[name], shorter[name]) for name in kept)


def test_without_held_out_attempts_all_passes_are_made_and_the_last_is_kept() -> None:
    trained = train(unlearnable(40), replace(SMALL, epochs=5, least_epochs=1, patience=1, holdout=0))
    assert len(trained.history) == trained.kept.number == 5


def test_no_pass_before_the_least_is_kept() -> None:
    settings = replace(SMALL, epochs=60, least_epochs=1, patience=2, warmup_steps=0)
    early = train(unlearnable(120), settings).kept.number
    later = train(unlearnable(120), replace(settings, least_epochs=early + 4)).kept.number
    assert later >= early + 4
    short = train(unlearnable(120), replace(settings, epochs=2, least_epochs=9))
    assert short.kept.number == len(short.history) == 2


def test_both_pictures_of_an_attempt_are_held_out_together() -> None:
    overhead, pregrasp = drawn_inputs(40, seed=0), drawn_inputs(40, seed=5)
    both = mixed([overhead, replace(pregrasp, attempts=overhead.attempts)])
    watched = Watched()
    trained = train(both, replace(SMALL, epochs=1, jitter=watched, precision="float32"))
    assert trained.history[0].held_out.attempts == 20
    seen = {one.numpy().tobytes() for batch in watched.batches for one in batch}
    learnt = [
        {row for row, inputs in enumerate(part.inputs) if inputs.tobytes() in seen} for part in (overhead, pregrasp)
    ]
    assert learnt[0] == learnt[1]
    assert len(learnt[0]) == 30


def test_a_grasp_that_was_recorded_twice_is_held_out_whole() -> None:
    exact, noisy = (with_grasps(drawn_inputs(40, seed=seed), session) for seed, session in ((0, "a"), (5, "b")))
    watched = Watched()
    trained = train(mixed([exact, noisy]), replace(SMALL, epochs=1, jitter=watched, precision="float32"))
    assert trained.history[0].held_out.attempts == 20
    seen = {one.numpy().tobytes() for batch in watched.batches for one in batch}
    learnt = [{row for row, inputs in enumerate(part.inputs) if inputs.tobytes() in seen} for part in (exact, noisy)]
    assert learnt[0] == learnt[1]
    assert len(learnt[0]) == 30


def with_grasps(data: GraspInputs, session: str) -> GraspInputs:
    """The same inputs, as if a session with seed 3 had recorded them."""
    count = len(data.attempts)
    attempts = data.attempts.assign(seed=pd.array([3] * count, dtype="Int64"), number=np.arange(count))
    return replace(data, attempts=attempts.set_index(pd.Index([f"{session}-{n}" for n in range(count)])))


def test_mixed_inputs_and_labels_have_the_same_share_of_the_same_others() -> None:
    inputs, labels = torch.rand(6, 4, 2, 2), torch.tensor([0.0, 1.0, 0.0, 1.0, 1.0, 0.0])
    others = torch.tensor([2, 0, 1, 3, 5, 4])
    varied, shares = mixed_up(inputs, labels, others, 0.75)
    torch.testing.assert_close(varied, 0.75 * inputs + 0.25 * inputs[others])
    torch.testing.assert_close(shares, 0.75 * labels + 0.25 * labels[others])


def test_who_learns_from_mixtures_is_less_sure() -> None:
    data, settings = drawn_inputs(200, seed=0), replace(SMALL, holdout=0, mixup=0)
    plain, mixing = (train(data, replace(settings, mixup=mixup)) for mixup in (0.0, 1.0))
    assert mixing.kept.train_loss > plain.kept.train_loss + 0.02
    rows = torch.arange(200)
    sure, unsure = (np.abs(predict(one.network, data.inputs, rows) - 0.5).mean() for one in (plain, mixing))
    assert unsure < sure


def test_the_kept_weights_are_a_running_mean() -> None:
    """After one step they are a tenth of the way back to the first weights, and then ever nearer to the last ones."""
    data = drawn_inputs(30, seed=0)
    settings = replace(SMALL, batch=240, epochs=1, holdout=0, warmup_steps=0, precision="float32", seed=4)
    torch.manual_seed(4)
    start = GraspQualityNetwork(settings.network).state_dict()
    last = train(data, replace(settings, average=0)).network.state_dict()
    mean = train(data, replace(settings, average=0.999)).network.state_dict()
    for name in ("features.0.weight", "head.1.bias", "features.1.running_var"):
        torch.testing.assert_close(mean[name], 0.1 * start[name] + 0.9 * last[name])


@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
def test_a_rule_is_learnt_in_either_precision(precision: Precision) -> None:
    trained = train(drawn_inputs(300, seed=0), replace(SMALL, precision=precision))
    assert (trained.kept.held_out.auc or 0) > 0.95
    assert all(parameter.dtype == torch.float32 for parameter in trained.network.parameters())
