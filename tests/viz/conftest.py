"""A servo run on the real simulated station, recorded once for all tests of the room."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from tests.support.scorers import FunctionScorer
from torch import Tensor

from handsight.collection.sim.arm_shape import Ur10Shape
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation
from handsight.evaluation.foresight import Foresight
from handsight.evaluation.temperature import Temperature
from handsight.evaluation.trial import TrialRecording, run_trial
from handsight.servoing.angle_maps import angle_maps
from handsight.servoing.heatmap import Heatmap, grasp_heatmap
from handsight.servoing.loop import ServoSettings
from handsight.viz.examples import HeatmapExample
from handsight.viz.recordings.servo_trace import write_servo_trace

HEATMAP_SPACING_PX = 16
ANGLES = 6
THRESHOLD = 0.8


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
def arm() -> Ur10Shape:
    """The arm of the simulated station."""
    return Ur10Shape()


@pytest.fixture(scope="session")
def trace_path(
    trial: TrialRecording, heatmaps: list[Heatmap], arm: Ur10Shape, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """The run as a recording."""
    path = tmp_path_factory.mktemp("trace") / "servo.rrd"
    write_servo_trace(path, trial, heatmaps, arm=arm)
    return path


@pytest.fixture(scope="session")
def examples(trial: TrialRecording) -> list[HeatmapExample]:
    """The first and the last picture of the run, as examples; the last with calibrated scores."""
    views = [trial.trace.steps[index].view for index in (0, -1)]
    before, after = (angle_maps(view, CLEAR_OF_JAWS, angles=ANGLES, spacing_px=HEATMAP_SPACING_PX) for view in views)
    softer = Temperature(value=2.0, attempts=50, source="made up")
    held = trial.trial.success
    seen = Foresight(attempt="0-0", target="block", held=held, raw=0.9, score=float(softer(0.9)))
    return [
        HeatmapExample(view=views[0], maps=before, title="before", threshold=THRESHOLD),
        HeatmapExample(
            view=views[1],
            maps=replace(after, scores=softer(after.scores)),
            title="after",
            held=held,
            grasp=(0.02, -0.01, 0.3),
            foresight=seen,
            temperature=softer,
            threshold=THRESHOLD,
        ),
    ]
