"""Likeness is the cosine of features: the nearest first, and groups that pairs join."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from handsight.evaluation.similarity import most_similar, near_duplicate_groups


def unit(angles_rad: list[float]) -> NDArray[np.float32]:
    return np.stack([np.cos(angles_rad), np.sin(angles_rad)], axis=1).astype(np.float32)


def test_the_nearest_come_first_and_the_one_asked_about_before_its_copies() -> None:
    features = unit([0.0, 0.5, 0.0, 0.1, 3.0])
    found = most_similar(features, ["a", "b", "c", "d", "e"], "c")
    assert [one.attempt for one in found] == ["c", "a", "d", "b", "e"]
    assert [round(one.similarity, 3) for one in found] == [1.0, 1.0, 0.995, 0.878, -0.99]


@given(st.lists(st.floats(-3.1, 3.1), min_size=1, max_size=30), st.floats(0.5, 0.9999))
def test_groups_are_what_pairs_join(angles_rad: list[float], least: float) -> None:
    features = unit(angles_rad)
    ids = [str(number) for number in range(len(features))]
    group_of = {key: {key} for key in ids}
    for left, right in np.argwhere(features @ features.T >= least).tolist():
        merged = group_of[ids[left]] | group_of[ids[right]]
        for key in merged:
            group_of[key] = merged
    expected = {frozenset(group) for group in group_of.values() if len(group) > 1}
    found = near_duplicate_groups(features, ids, least=least)
    assert {frozenset(group) for group in found} == expected
    assert [len(group) for group in found] == sorted(map(len, found), reverse=True)


def test_groups_across_blocks_of_rows_are_found() -> None:
    rng = np.random.default_rng(0)
    features = rng.normal(size=(2500, 16)).astype(np.float32)
    features[2400] = features[3]
    features /= np.linalg.norm(features, axis=1, keepdims=True)
    ids = [str(number) for number in range(2500)]
    assert near_duplicate_groups(features, ids, least=0.9999) == [["3", "2400"]]
    assert near_duplicate_groups(features[:0], []) == []
