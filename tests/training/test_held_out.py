"""What a run held out is drawn again, and is what its training judged itself by."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import torch
from tests.support.drawn import SMALL
from tests.support.factories import make_attempt, make_header, record

from handsight.cli.train import train_to_folder
from handsight.datasets import GraspDataset, GraspRepository, Outcome
from handsight.datasets.inputs.materialize import materialize
from handsight.servoing.homography import InputGrid
from handsight.training.data_selection import DataSelection
from handsight.training.errors import HeldOutError
from handsight.training.held_out import held_out_attempts
from handsight.training.metrics import evaluate_scores
from handsight.training.prediction import predict
from handsight.training.run import load_run

SETTINGS = replace(SMALL, epochs=1, least_epochs=1, batch=8)
LABELS = (Outcome.HELD, Outcome.EMPTY)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("held-out")


@pytest.fixture(scope="module")
def dataset(folder: Path) -> GraspDataset:
    repository = GraspRepository.create(folder / "grasps")
    for seed in (1, 2):
        header = make_header(seed=seed, width=16, height=12)
        record(repository, header, [make_attempt(header, number, outcome=LABELS[number % 2]) for number in range(12)])
    repository.release("v1", message="all")
    return GraspDataset.open(f"{folder / 'grasps'}@v1")


def train(dataset: GraspDataset, out: Path, **options: Any) -> dict[str, Any]:
    name = f"{dataset.repository.path}@{dataset.ref}"
    train_to_folder({name: dataset}, out, SETTINGS, viewpoints=["overhead"], **options)
    return load_run(out).record


@pytest.mark.parametrize("selection", [None, DataSelection(where="number < 9"), DataSelection(size=16)])
def test_the_network_is_as_good_on_them_as_its_record_says(
    dataset: GraspDataset, folder: Path, selection: DataSelection | None
) -> None:
    out = folder / f"run-{selection is not None and (selection.where or selection.size)}".replace(" ", "").replace(
        "<", ""
    )
    recorded = train(dataset, out, selection=selection)
    (part,) = held_out_attempts(recorded, beside=dataset)
    data = materialize(dataset, grid=InputGrid(size_px=16))
    rows = torch.from_numpy(data.attempts.index.get_indexer(pd.Index(part.attempts)).astype(np.int64))
    found = evaluate_scores(predict(load_run(out).network, data.inputs, rows), data.labels[rows.numpy()])
    assert found.loss == pytest.approx(recorded["history"][0]["held_out"]["loss"], rel=1e-5)
    assert found.attempts == recorded["history"][0]["held_out"]["attempts"]
    assert not set(part.attempts) & set(part.learnt)
    assert len(part.attempts) + len(part.learnt) == recorded["origins"][0]["attempts"]


def test_twins_are_drawn_again_as_the_record_says_that_they_were(folder: Path) -> None:
    repository = GraspRepository.create(folder / "twins")
    for noise in (False, True):
        header = replace(make_header(seed=1, width=16, height=12), config={"noise": noise})
        record(repository, header, [make_attempt(header, number, outcome=LABELS[number % 2]) for number in range(20)])
    repository.release("v1", message="all")
    twins = GraspDataset.open(f"{folder / 'twins'}@v1")
    recorded = train(twins, folder / "of-twins")
    (part,) = held_out_attempts(recorded, beside=twins)
    assert sorted(count for _, count in Counter(twins.attempts["number"].loc[list(part.attempts)]).items()) == [2] * 5
    before = {name: value for name, value in recorded.items() if name != "twins_together"}
    (apart,) = held_out_attempts(before, beside=twins)  # As records were before there was a choice.
    assert len(apart.attempts) == len(part.attempts)
    assert set(Counter(twins.attempts["number"].loc[list(apart.attempts)]).values()) != {2}


def test_a_dataset_that_was_moved_is_found_beside_the_one_at_hand(dataset: GraspDataset, folder: Path) -> None:
    recorded = train(dataset, folder / "moved")
    elsewhere = {**recorded, "origins": [{**recorded["origins"][0], "dataset": "/nowhere/grasps@v1"}]}
    assert held_out_attempts(elsewhere, beside=dataset)[0].attempts
    gone = {**elsewhere, "origins": [{**elsewhere["origins"][0], "snapshot": "0" * 20}]}
    with pytest.raises(HeldOutError, match="cannot be read again"):
        held_out_attempts(gone, beside=dataset)


def test_what_cannot_be_told_is_said(dataset: GraspDataset, folder: Path) -> None:
    recorded = train(dataset, folder / "said")
    none = {**recorded, "settings": {**recorded["settings"], "holdout": 0.0}}
    with pytest.raises(HeldOutError, match="held no attempts out"):
        held_out_attempts(none, beside=dataset)
    other = {**recorded, "settings": {**recorded["settings"], "holdout": 0.5}}
    with pytest.raises(HeldOutError, match=r"12 inputs would be held out, expected 6"):
        held_out_attempts(other, beside=dataset)
