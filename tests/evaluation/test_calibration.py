from __future__ import annotations

import pytest
from tests.support.trials import make_trial

from handsight.evaluation.calibration import SCORE_EDGES, calibration_rows
from handsight.evaluation.results import wilson_95


def test_scores_are_binned_with_what_came_of_them() -> None:
    trials = [
        make_trial(0, score=0.95),
        make_trial(1, score=0.96, success=False),
        make_trial(2, score=0.96),
        make_trial(3, score=1.0),
        make_trial(4, score=0.0, success=False),
        make_trial(5, score=0.96, success=False, aborted=True, failure="look: lost"),
        make_trial(6, "random"),
    ]
    first, middle, last = calibration_rows(trials, objects="o", methods=("random", "cem-1"))
    assert (first["low"], first["high"], first["trials"], first["rate"]) == (0.0, 0.2, 1, 0.0)
    assert (middle["low"], middle["high"], middle["trials"], middle["successes"]) == (0.95, 0.97, 3, 2)
    assert middle["mean_score"] == pytest.approx(2.87 / 3)
    assert middle["ci95"] == wilson_95(2, 3)
    assert (last["high"], last["mean_score"]) == (1.0, 1.0)


def test_every_score_is_in_one_bin() -> None:
    scores = [*SCORE_EDGES, *(0.001 * step for step in range(1001))]
    trials = [make_trial(number, score=score) for number, score in enumerate(scores)]
    assert sum(row["trials"] for row in calibration_rows(trials, objects="o", methods=("cem-1",))) == len(scores)
