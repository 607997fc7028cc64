from __future__ import annotations

import pytest

from handsight.evaluation.errors import EvaluationSettingsError
from handsight.evaluation.evaluate import EvaluationSettings
from handsight.evaluation.results import result_rows, why_nothing_counts, wilson_95
from handsight.evaluation.trial import Trial


def trial(
    method: str, success: bool, moves: int = 0, compute_s: float = float("nan"), *, abort: str | None = None
) -> Trial:
    return Trial(
        number=0,
        method=method,
        success=success,
        failure=abort or "",
        moves=moves,
        compute_s=compute_s,
        truth_held=success,
        aborted=abort is not None,
    )


def test_wilson_interval_against_published_values() -> None:
    """Newcombe (1998), Statistics in Medicine 17, table I: 81 of 263 and 0 of 20 by method 3."""
    assert wilson_95(81, 263) == pytest.approx((0.2553, 0.3662), abs=5e-5)
    assert wilson_95(0, 20) == pytest.approx((0.0, 0.1611), abs=5e-5)


def test_no_trials_say_nothing() -> None:
    assert wilson_95(0, 0) == (0.0, 1.0)


def test_rows_summarise_each_method() -> None:
    trials = [
        trial("random", False),
        trial("cem-1", True, moves=2, compute_s=0.010),
        trial("random", True),
        trial("cem-1", True, moves=4, compute_s=0.030),
    ]
    random, cem = result_rows(trials, objects="blocks-test", methods=["random", "cem-1"])
    assert (random["trials"], random["successes"], random["rate"]) == (2, 1, 0.5)
    assert random["step_ms"] is None
    assert random["mean_steps"] is None
    assert (cem["successes"], cem["mean_steps"]) == (2, 3.0)
    assert cem["step_ms"] == pytest.approx(20.0)
    assert cem["ci95"] == wilson_95(2, 2)


def test_aborted_trials_are_in_no_rate_and_no_mean() -> None:
    trials = [trial("cem-1", True, moves=4, compute_s=0.01), trial("cem-1", False, abort="look: no picture")]
    (row,) = result_rows(trials, objects="blocks-test", methods=["cem-1"])
    assert (row["trials"], row["aborted"], row["successes"], row["rate"]) == (1, 1, 1, 1.0)
    assert row["mean_steps"] == 4
    assert row["ci95"] == wilson_95(1, 1)


def test_nothing_counts_only_where_every_trial_was_aborted() -> None:
    lost = [trial("cem-1", False, abort=reason) for reason in ("reach: far", "look: lost", "look: lost")]
    assert why_nothing_counts([*lost, trial("cem-1", False)]) is None
    assert why_nothing_counts([]) is None
    assert "3 trials" in (said := why_nothing_counts(lost) or "")
    assert "look: lost, 2 times" in said


def test_bad_settings_report_every_fault() -> None:
    with pytest.raises(EvaluationSettingsError) as caught:
        EvaluationSettings(methods=("random",), trials=-3, workers=0, seed=-1)
    for part in ("trials is -3", "workers is 0", "seed is -1"):
        assert part in str(caught.value)
