"""Event files are read by TensorBoard itself, and their absence is refused by name."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tests.support.drawn import SMALL, drawn_inputs

from handsight.training import event_files as module
from handsight.training.course import Epoch
from handsight.training.errors import MissingExtraError
from handsight.training.event_files import EventFiles, check_tensorboard, event_files
from handsight.training.metrics import Metrics
from handsight.training.run_folder import EVENTS
from handsight.training.trainer import train


def curves(folder: Path) -> dict[str, list[tuple[int, float]]]:
    read = EventAccumulator(str(folder))
    read.Reload()
    return {name: [(one.step, one.value) for one in read.Scalars(name)] for name in read.Tags()["scalars"]}


def test_every_pass_is_written_when_it_ends(tmp_path: Path) -> None:
    seen: list[int] = []
    with event_files(tmp_path, wanted=True) as files:
        assert files is not None
        assert not (tmp_path / EVENTS).exists()

        def on_epoch(epoch: Epoch) -> None:
            files.add(epoch)
            (folder,) = (tmp_path / EVENTS).iterdir()
            seen.append(len(curves(folder)["loss/train"]))

        trained = train(drawn_inputs(80, seed=0), SMALL, on_epoch=on_epoch)
    assert seen == list(range(1, len(trained.history) + 1))
    (folder,) = (tmp_path / EVENTS).iterdir()
    found = curves(folder)
    assert set(found) == {"loss/train", "loss/held_out", "held_out/auc", "held_out/balanced_accuracy"}
    for epoch, (step, value) in zip(trained.history, found["loss/held_out"], strict=True):
        assert step == epoch.number
        assert value == pytest.approx(epoch.held_out.loss)


def test_a_figure_that_is_none_is_left_out(tmp_path: Path) -> None:
    files = EventFiles(tmp_path)
    nothing = Metrics(attempts=0, accuracy=None, auc=None, loss=None)
    files.add(Epoch(number=1, train_loss=0.5, held_out=nothing))
    files.close()
    (folder,) = (tmp_path / EVENTS).iterdir()
    assert curves(folder) == {"loss/train": [(1, 0.5)]}


def test_nothing_is_written_where_nothing_is_wanted(tmp_path: Path) -> None:
    with event_files(tmp_path, wanted=False) as files:
        assert files is None
    assert list(tmp_path.iterdir()) == []


def test_without_tensorboard_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(module, "find_spec", lambda name: None if name == "tensorboard" else find(name))
    with pytest.raises(MissingExtraError, match=r"pip install 'handsight\[tensorboard\]'"):
        check_tensorboard()
