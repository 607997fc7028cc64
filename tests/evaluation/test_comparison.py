from __future__ import annotations

import pytest
from tests.support.trials import make_trial

from handsight.evaluation.comparison import check_reference, comparison_rows, mcnemar_p
from handsight.evaluation.errors import EvaluationSettingsError
from handsight.evaluation.trial import Trial

METHODS = ("random", "cem-1", "first-order")


def trials(method: str, results: str) -> list[Trial]:
    """``+`` held, ``-`` missed, ``x`` aborted; in the order of their numbers."""
    return [
        make_trial(number, method, success=one == "+", aborted=one == "x", failure="look: lost" if one == "x" else "")
        for number, one in enumerate(results)
    ]


@pytest.mark.parametrize(("won", "lost", "p"), [(0, 0, 1.0), (1, 1, 1.0), (12, 1, 28 / 2**13), (0, 5, 2 / 2**5)])
def test_p_is_the_share_of_splits_as_uneven(won: int, lost: int, p: float) -> None:
    """By hand: for 12 of 13, twice 1 + 13 of 2^13."""
    assert mcnemar_p(won, lost) == pytest.approx(p)
    assert mcnemar_p(lost, won) == pytest.approx(p)


def test_each_method_is_paired_with_the_best_by_number() -> None:
    everything = trials("random", "+--+-") + trials("cem-1", "++++-") + trials("first-order", "-++--")
    random, first_order = comparison_rows(everything[::-1], objects="blocks-test", methods=METHODS)
    assert (random["method"], random["against"], random["objects"]) == ("random", "cem-1", "blocks-test")
    assert (random["pairs"], random["won"], random["lost"], random["p"]) == (5, 0, 2, 0.5)
    assert (first_order["won"], first_order["lost"]) == (0, 2)


def test_a_pair_counts_only_where_both_trials_do() -> None:
    everything = trials("random", "x-+-") + trials("cem-1", "+x++")
    (row,) = comparison_rows(everything, objects="o", methods=("random", "cem-1"))
    assert (row["pairs"], row["won"], row["lost"]) == (2, 0, 1)


def test_a_reference_can_be_named() -> None:
    everything = trials("random", "--") + trials("cem-1", "++")
    (row,) = comparison_rows(everything, objects="o", methods=("random", "cem-1"), against="random")
    assert (row["method"], row["against"], row["won"], row["lost"]) == ("cem-1", "random", 2, 0)


def test_a_method_without_a_trial_that_counts_is_no_reference() -> None:
    everything = trials("random", "xx") + trials("cem-1", "--")
    (row,) = comparison_rows(everything, objects="o", methods=("random", "cem-1"))
    assert (row["against"], row["pairs"], row["p"]) == ("cem-1", 0, 1.0)


def test_a_reference_is_one_of_the_methods() -> None:
    check_reference(None, METHODS)
    check_reference("cem-1", METHODS)
    with pytest.raises(EvaluationSettingsError, match=r"against is 'luck', expected one of .*: random, cem-1"):
        check_reference("luck", METHODS)
