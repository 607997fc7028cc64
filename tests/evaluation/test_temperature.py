"""A temperature is found again from outcomes drawn with it, and says what it was fitted on."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from handsight.evaluation.temperature import LEAST, Temperature, fit_temperature
from handsight.servoing.errors import ScoreError


def sigmoid(logits: NDArray[np.float64]) -> NDArray[np.float32]:
    return np.asarray(1 / (1 + np.exp(-logits)), dtype=np.float32)


@pytest.mark.parametrize("truth", [0.6, 1.0, 2.5, 6.0])
def test_the_temperature_of_a_network_that_is_too_sure_is_found(truth: float) -> None:
    rng = np.random.default_rng(0)
    logits = rng.normal(0, 1.5, 4000)
    labels = (rng.random(4000) < sigmoid(logits)).astype(np.float32)
    # Where the network's logits are cut off, nothing is learnt of them.
    temperature = fit_temperature(sigmoid(truth * logits), labels, source="drawn")
    assert temperature.value == pytest.approx(truth, rel=0.12)
    assert temperature.fitted
    told = np.abs(truth * logits) < 9
    calibrated = temperature(sigmoid(truth * logits[told]))
    np.testing.assert_allclose(calibrated, sigmoid(truth * logits[told] / temperature.value), atol=1e-2)
    assert "fitted on 4000 attempts drawn" in str(temperature)


@given(st.lists(st.floats(0, 1, width=32), min_size=1, max_size=30), st.floats(0.3, 10))
def test_no_two_scores_change_places(scores: list[float], value: float) -> None:
    given_scores = np.array(scores, np.float32)
    calibrated = Temperature(value=value, attempts=20, source="x")(given_scores)
    assert ((calibrated >= 0) & (calibrated <= 1)).all()
    assert (np.diff(calibrated[np.argsort(given_scores, kind="stable")]) >= 0).all()


def test_what_is_not_fitted_leaves_scores_and_says_why() -> None:
    scores = np.array([0.0, 0.3, 1.0], np.float32)
    for labels in (np.ones(50, np.float32), np.zeros(50, np.float32), np.resize([0, 1], LEAST - 1).astype(np.float32)):
        temperature = fit_temperature(np.full(len(labels), 0.7, np.float32), labels, source="held out")
        assert not temperature.fitted
        np.testing.assert_array_equal(temperature(scores), scores)
        assert "not calibrated" in str(temperature)
        assert "too few" in str(temperature)


def test_scores_that_are_none_are_refused() -> None:
    with pytest.raises(ScoreError):
        fit_temperature(np.array([0.1, np.nan], np.float32), np.array([0, 1], np.float32), source="x")
