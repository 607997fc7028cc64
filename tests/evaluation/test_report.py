from __future__ import annotations

from tests.support.trials import make_trial

from handsight.evaluation.report import evaluation_report


def test_every_table_goes_over_sets_and_methods() -> None:
    trials = {
        "blocks": [make_trial(0, "random", success=False, closed_m=0.0), make_trial(0, score=0.96)],
        "cups": [make_trial(0, "random"), make_trial(0, score=0.99, moves=1)],
    }
    report = evaluation_report(trials, methods=("random", "cem-1"), closed_width_m=0.002, threshold=0.95)
    order = [("random", "blocks"), ("cem-1", "blocks"), ("random", "cups"), ("cem-1", "cups")]
    assert [(row["method"], row["objects"]) for row in report["rows"]] == order
    assert [(row["method"], row["objects"]) for row in report["causes"]] == order
    assert [(row["against"], row["objects"]) for row in report["comparisons"]] == [
        ("cem-1", "blocks"),
        ("random", "cups"),
    ]
    assert [row["objects"] for row in report["calibration"]] == ["blocks", "cups"]
    assert [row["objects"] for row in report["durations"] if row["trials"]] == ["blocks", "cups"]
    assert report["fault"] is None


def test_the_fault_is_that_of_all_sets_together() -> None:
    lost = make_trial(0, success=False, aborted=True, failure="look: lost")
    trials = {"blocks": [lost], "cups": [lost]}
    fault = evaluation_report(trials, methods=("cem-1",), closed_width_m=0.002, threshold=0.95)["fault"]
    assert fault is not None
    assert "2 trials" in fault
    trials["cups"] = [make_trial(0)]
    assert evaluation_report(trials, methods=("cem-1",), closed_width_m=0.002, threshold=0.95)["fault"] is None
