from __future__ import annotations

import math

import pytest

from handsight.evaluation.pixel_faults import PixelFaults
from handsight.evaluation.prediction_error import PredictionError
from handsight.evaluation.prediction_rows import prediction_rows, why_nothing_was_seen
from handsight.evaluation.prediction_survey import Kind, PredictionSample, SceneSurvey


def sample(kind: Kind, size: float, height_m: float, *, score: float = 0.5, true: float = 0.5) -> PredictionSample:
    faults = PixelFaults(extrapolated=0.1, occluded=0.02, displaced=0.01)
    error = PredictionError(
        colour_rms=0.05,
        height_rms_m=0.002,
        predicted_score=score,
        true_score=true,
        faults=faults,
        points_height_rms_m=0.001,
        points_score=true - 0.05,
    )
    return PredictionSample(kind=kind, size=size, height_m=height_m, error=error)


def test_steps_are_binned_by_size_and_by_height() -> None:
    samples = (
        sample("move", 0.005, -0.001),
        sample("move", 0.01, 0.02, score=0.9, true=0.5),
        sample("move", 0.019, 0.2, score=0.2, true=0.4),
        sample("turn", math.radians(45), 0.05),
    )
    rows = prediction_rows([SceneSurvey(number=0, samples=samples, unreachable=0)])
    bins = [(row["kind"], row["low"], row["high"], row["height_low_mm"], row["height_high_mm"]) for row in rows]
    assert bins == [
        ("move", 0.0, 10.0, None, None),
        ("move", 0.0, 10.0, 0.0, 10.0),
        ("move", 10.0, 20.0, None, None),
        ("move", 10.0, 20.0, 10.0, 30.0),
        ("move", 10.0, 20.0, 60.0, None),
        ("turn", 30.0, 60.0, None, None),
        ("turn", 30.0, 60.0, 30.0, 60.0),
    ]
    both = rows[2]
    assert both["steps"] == 2
    assert both["score_bias"] == pytest.approx(0.1)
    assert both["score_error"] == pytest.approx(0.3)
    assert both["points_score_error"] == pytest.approx(0.05)
    assert both["points_height_rms_mm"] == pytest.approx(1.0)
    assert both["score_error_90"] == pytest.approx(0.38)
    assert both["score_error_se"] == pytest.approx(0.1 / math.sqrt(2))
    assert both["height_rms_mm"] == pytest.approx(2.0)


def test_where_nothing_was_seen_the_reason_is_told() -> None:
    seen = SceneSurvey(number=0, samples=(sample("move", 0.01, 0.0),), unreachable=0)
    blind = SceneSurvey(number=1, samples=(), unreachable=0, failure="look: the camera is gone")
    assert why_nothing_was_seen([seen, blind]) is None
    said = why_nothing_was_seen([blind])
    assert said is not None
    assert "in 1 scene, expected at least one: look: the camera is gone" in said
