"""A servo run on the real simulated station, recorded once for all tests of the room."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from tests.support.scorers import FunctionScorer
from torch import Tensor

from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation
from handsight.evaluation.trial import TrialRecording, run_trial
from handsight.servoing.heatmap import Heatmap, grasp_heatmap
from handsight.servoing.loop import ServoSettings
from handsight.viz.examples import HeatmapExample
from handsight.viz.recordings.servo_trace import write_servo_trace

HEATMAP_SPACING_PX = 16


def score_clear_of_jaws(inputs: Tensor) -> Tensor:
    """Good where something stands between the fingers and nothing under them. (B, 4, 64, 64) -> (B,)."""
    height_m = -inputs[:, 3]
    between_m = height_m[:, 31:33, 30:34].mean((1, 2))
    under_left_m, under_right_m = height_m[:, 31:33, 22:25].mean((1, 2)), height_m[:, 31:33, 39:42].mean((1, 2))
    return torch.sigmoid(180 * (between_m - torch.maximum(under_left_m, under_right_m)) - 4)


CLEAR_OF_JAWS = FunctionScorer(score_clear_of_jaws)


@pytest.fixture(scope="session")
def trial() -> TrialRecording:
    """A run of single-iteration CEM with some moves in it."""
    station = SimStation(SimConfig(objects="blocks-train"))
    try:
        settings = ServoSettings(threshold=0.9)
        _, recording = run_trial(station, CLEAR_OF_JAWS, "cem-1", 4, seed=7, settings=settings)
    finally:
        station.close()
    assert recording is not None
    assert recording.trace.moves >= 2
    return recording


@pytest.fixture(scope="session")
def heatmaps(trial: TrialRecording) -> list[Heatmap]:
    """One map per step of the run."""
    return [grasp_heatmap(step.view, CLEAR_OF_JAWS, spacing_px=HEATMAP_SPACING_PX) for step in trial.trace.steps]


@pytest.fixture(scope="session")
def trace_path(trial: TrialRecording, heatmaps: list[Heatmap], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run as a recording."""
    path = tmp_path_factory.mktemp("trace") / "servo.rrd"
    write_servo_trace(path, trial, heatmaps)
    return path


@pytest.fixture(scope="session")
def examples(trial: TrialRecording, heatmaps: list[Heatmap]) -> list[HeatmapExample]:
    """The first and the last picture of the run, as examples."""
    return [
        HeatmapExample(view=trial.trace.steps[index].view, heatmap=heatmaps[index], title=title, held=held)
        for index, title, held in ((0, "before", None), (-1, "after", trial.trial.success))
    ]
