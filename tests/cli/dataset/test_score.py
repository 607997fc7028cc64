"""``handsight dataset score`` and ``similar`` as their user meets them: columns to sort by, neighbours, refusals."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from tests.support.factories import make_attempt, make_header, record
from tests.support.refusals import check_refused
from tests.support.runs import save_untrained

from handsight.cli.app import run
from handsight.datasets import GraspDataset, GraspRepository, Outcome
from handsight.datasets.inputs.materialize import materialize
from handsight.training.prediction import predict
from handsight.training.run import load_run

OUTCOMES = (Outcome.HELD, Outcome.EMPTY, Outcome.ABORTED, Outcome.EMPTY)


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A dataset of 24 attempts, of which 18 have labels, and a run, in the working folder."""
    repository = GraspRepository.create(tmp_path / "grasps")
    header = make_header(width=16, height=12)
    record(repository, header, [make_attempt(header, number, outcome=OUTCOMES[number % 4]) for number in range(24)])
    save_untrained(tmp_path / "run")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def said(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    capsys.readouterr()
    assert run(["dataset", *words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_scores_are_those_of_the_network_and_sort_the_list(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = said(capsys, "score", "grasps", "net", "--model", "run", "--dry-run")
    assert (told["attempts"], told["stored"]) == (18, False)
    assert said(capsys, "score", "grasps") == []
    told = said(capsys, "score", "grasps", "net", "--model", "run")
    model, dataset = load_run(lab / "run"), GraspDataset.open("grasps")
    data = materialize(dataset, grid=model.grid)
    expected = predict(model.network, data.inputs, torch.arange(18))
    stored = dataset.table("score_net")["score_net"].reindex(data.attempts.index)
    np.testing.assert_allclose(stored, expected, atol=1e-6)
    labels = data.attempts["success"].astype(float)
    errors = (labels - expected).abs()
    assert told["wrong"] == int((errors > 0.5).sum())
    assert told["source"] == f"weights {model.weights_sha256}"
    rows = said(capsys, "ls", "grasps", "--sort", "error_net", "--reverse", "-n", "18")
    listed = [errors[row["attempt"]] for row in rows]
    assert listed == sorted(listed, reverse=True)
    stores = said(capsys, "score", "grasps")
    assert [(one["scores"], one["attempts"]) for one in stores] == [("net", 18)]


def test_scores_are_replaced_when_asked_and_forgotten(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["dataset", "score", "grasps", "net", "--model", "run"]) == 0
    shown = capsys.readouterr().out
    assert "scored 18 attempts" in shown
    assert "handsight dataset ls grasps --sort error_net --reverse -n 20" in shown
    again = ["dataset", "score", "grasps", "net", "--model", "run"]
    check_refused(capsys, again, "there are scores 'net' already: replace them")
    assert said(capsys, "score", "grasps", "net", "--model", "run", "--replace")["stored"]
    assert said(capsys, "score", "grasps", "net", "--delete", "--dry-run")["deleted"] is False
    assert run(["dataset", "score", "grasps"]) == 0
    assert "weights" in capsys.readouterr().out
    assert run(["dataset", "score", "grasps", "net", "--delete"]) == 0
    assert "net is forgotten" in capsys.readouterr().out
    assert said(capsys, "score", "grasps") == []


def test_folds_score_what_their_networks_never_saw(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["dataset", "folds", "grasps", "three", "--by", "object", "-k", "3"]) == 0
    told = said(capsys, "score", "grasps", "cv", "--folds", "three", "--epochs", "1")
    assert told["source"] == "out of folds 'three', 1 passes"
    assert told["attempts"] == 18


def test_neighbours_are_told_nearest_first_and_never_itself(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (asked, *_) = [str(key) for key in GraspDataset.open("grasps").attempts.index]
    told = said(capsys, "similar", "grasps", asked, "--model", "run", "-n", "5")
    likeness = [one["similarity"] for one in told["similar"]]
    assert len(likeness) == 5
    assert likeness == sorted(likeness, reverse=True)
    assert told["attempt"] == asked
    assert asked not in [one["attempt"] for one in told["similar"]]
    assert run(["dataset", "similar", "grasps", asked, "--model", "run", "-n", "2"]) == 0
    assert "likeness" in capsys.readouterr().out
    groups = said(capsys, "similar", "grasps", "--model", "run", "--groups", "--least", "0")["groups"]
    assert [len(group) for group in groups] == [18]  # Nothing is less alike than not at all.
    assert run(["dataset", "similar", "grasps", "--model", "run", "--groups", "--least", "0"]) == 0
    assert "1 group of near-duplicates" in capsys.readouterr().out


def test_attempt_without_a_label_has_no_neighbours(lab: Path, capsys: pytest.CaptureFixture[str]) -> None:
    aborted = [str(key) for key in GraspDataset.open("grasps").attempts.index][2]
    check_refused(capsys, ["dataset", "similar", "grasps", aborted, "--model", "run"], "has no label that counts")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["score", "grasps", "net"], "expected one of --model, --folds and --delete"),
        (["score", "grasps", "--model", "run"], "scores are given no name"),
        (["score", "grasps", "a b", "--model", "run"], "'a b'"),
        (["score", "grasps", "net", "--delete"], "net"),
        (["score", "grasps", "net", "--folds", "none"], "none"),
        (["similar", "grasps", "--model", "run"], "expected either an attempt to compare with, or --groups"),
        (["similar", "grasps", "--model", "nothing", "--groups"], "nothing"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(
    lab: Path, capsys: pytest.CaptureFixture[str], words: list[str], told: str
) -> None:
    check_refused(capsys, ["dataset", *words], told)
