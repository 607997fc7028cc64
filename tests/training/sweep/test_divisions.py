"""No attempt and no object is on both sides; training sets hold the smaller ones; test sets are balanced."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handsight.training.errors import SweepPlanError
from handsight.training.sweep.divisions import Division, divide, division_faults, group_names, refuse


def table(targets: list[str], successes: list[bool], *, first: int = 0) -> pd.DataFrame:
    ids = [f"a{first + number:03}" for number in range(len(targets))]
    return pd.DataFrame(
        {"target": pd.array(targets, dtype="str"), "success": pd.array(successes, dtype="boolean")},
        index=pd.Index(ids, name="attempt", dtype="str"),
    )


@st.composite
def tables(draw: st.DrawFn) -> pd.DataFrame:
    targets = draw(st.lists(st.sampled_from("abcdef"), min_size=2, max_size=60).filter(lambda some: len(set(some)) > 1))
    successes = draw(st.lists(st.booleans(), min_size=len(targets), max_size=len(targets)))
    return table(targets, successes)


def divided(rows: pd.DataFrame, trial: int = 0, *, held_out: float = 0.3, seed: int = 0) -> Division:
    return divide(rows, group_names([rows], "object"), by="object", held_out=held_out, seed=seed, trial=trial)


@given(rows=tables(), trial=st.integers(0, 50), held_out=st.floats(0.01, 0.99))
def test_nothing_is_on_both_sides(rows: pd.DataFrame, trial: int, held_out: float) -> None:
    division = divided(rows, trial, held_out=held_out)
    targets, labels = rows["target"].to_numpy(), rows["success"].to_numpy(dtype=bool)
    tested, learnt = set(targets[division.test]), set(targets[division.pool])
    assert tested <= set(division.held_out)
    assert not learnt & set(division.held_out)
    assert learnt | set(division.held_out) == set(targets)
    assert labels[division.test].sum() * 2 == len(division.test)
    assert len(set(division.test.tolist())) == len(division.test)
    assert division.held_out_attempts + len(division.pool) == len(rows)
    assert sorted(division.pool.tolist()) == np.flatnonzero(~np.isin(targets, division.held_out)).tolist()
    successes = labels[np.isin(targets, division.held_out)]
    assert len(division.test) == 2 * min(successes.sum(), (~successes).sum())


@given(rows=tables(), sizes=st.tuples(st.integers(1, 60), st.integers(1, 60)))
def test_a_larger_training_set_holds_the_smaller(rows: pd.DataFrame, sizes: tuple[int, int]) -> None:
    division = divided(rows)
    small, large = (division.trained_on(size) for size in sorted(sizes))
    np.testing.assert_array_equal(large[: len(small)], small)
    np.testing.assert_array_equal(division.trained_on(None), division.pool)


def test_trials_differ_and_follow_from_their_seed() -> None:
    rows = table(list("abcdef") * 10, [True, False, False] * 20)
    digests = [divided(rows, trial).digest(rows.index) for trial in range(10)]
    assert len(set(digests)) == 10
    assert digests == [divided(rows, trial).digest(rows.index) for trial in range(10)]
    assert digests[0] != divided(rows, seed=1).digest(rows.index)


def test_the_same_objects_are_held_out_of_several_datasets() -> None:
    """One of them lacks an object that the other has."""
    one, other = (
        table(list("abcdef") * 9, [True, False, False] * 18),
        table(list("abcde") * 9, [True, False, True] * 15),
    )
    groups = group_names([one, other], "object")
    assert groups == list("abcdef")
    for trial in range(8):
        first, second = (divide(rows, groups, by="object", held_out=0.34, seed=0, trial=trial) for rows in (one, other))
        assert first.held_out == second.held_out
        assert set(other["target"].iloc[second.pool]).isdisjoint(second.held_out)


def test_one_group_cannot_be_held_out() -> None:
    with pytest.raises(SweepPlanError, match=r"form 1 group by object, expected at least 2 .* see --by"):
        group_names([table(["cup"] * 4, [True, False] * 2)], "object")


def test_everything_that_a_trial_lacks_is_named() -> None:
    rows = table(list("aabb"), [True, True, False, False])
    divisions = [divided(rows, trial) for trial in range(2)]
    faults = division_faults(divisions, rows["success"].to_numpy(np.float32), [2, 9])
    with pytest.raises(SweepPlanError) as refused:
        refuse(faults)
    message = str(refused.value)
    for expected in (
        "trial 0: the 1 group held out",
        "trial 1: the 1 group held out",
        "lack successes or failures",
        "size is 9, expected at most 2, which are not held out",
        "of the first 2 attempts are successes, expected some of both",
    ):
        assert expected in message
