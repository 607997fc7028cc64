"""Folds: whole groups, even shares, the same for the same seed, and refused once they no longer fit."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import zarr
from hypothesis import given
from hypothesis import strategies as st
from tests.support.factories import make_attempt, make_header, make_scene, record
from tests.support.versions import opened

from handsight.datasets import (
    CorruptDataError,
    Curator,
    FoldsError,
    GraspRepository,
    Outcome,
    RefNameError,
    Selection,
    SessionWriter,
    UnknownNameError,
    make_folds,
    read_folds,
)
from handsight.datasets.curation.folds import GROUPINGS, assign_folds
from handsight.datasets.format.arrays import array_at, group_at


@pytest.fixture
def divided(repository: GraspRepository) -> GraspRepository:
    """Four sessions of 10 attempts, some of them without label."""
    for seed in range(4):
        header = make_header(seed=seed)
        record(repository, header, [make_attempt(header, number) for number in range(10)], every=10)
    return repository


@pytest.mark.parametrize("by", GROUPINGS)
def test_folds_cover_every_labelled_attempt_and_split_no_group(divided: GraspRepository, by: str) -> None:
    Curator(divided, author="anna").exclude(Selection(where="number == 3"), "x")
    made = make_folds(divided, "cv", by=by, count=3, seed=1, author="anna")  # type: ignore[arg-type]  # One of GROUPINGS.
    dataset = opened(divided)
    folds = read_folds(dataset, "cv")
    assert folds.fold.equals(made.fold)
    assert asdict(folds) | {"fold": None} == asdict(made) | {"fold": None}
    rows = dataset.attempts[dataset.attempts["success"].notna() & ~dataset.attempts["excluded"]]
    assert folds.fold.index.equals(rows.index)
    keys = {"object": rows["target"].fillna("?"), "session": rows["session"]}
    keys["scene"] = rows["objects"].map(lambda names: " ".join(sorted(names)))
    assert folds.fold.groupby(keys[by]).nunique().max() == 1
    assert sorted(folds.fold.unique()) == [0, 1, 2]
    for held_out in range(3):
        train, test = folds.split(held_out)
        assert sorted([*train, *test]) == sorted(rows.index)
        assert set(keys[by][train]).isdisjoint(keys[by][test])
    with pytest.raises(FoldsError, match="fold is 3, expected 0 to 2"):
        folds.split(3)


def test_the_same_seed_gives_the_same_folds_and_another_seed_others(divided: GraspRepository) -> None:
    first = make_folds(divided, "a", by="scene", count=4, seed=7, author="anna")
    assert make_folds(divided, "b", by="scene", count=4, seed=7, author="ben").fold.equals(first.fold)
    assert not make_folds(divided, "c", by="scene", count=4, seed=8, author="ben").fold.equals(first.fold)


@given(
    sizes=st.lists(st.tuples(st.integers(1, 20), st.integers(0, 20)), min_size=2, max_size=60),
    count=st.integers(2, 6),
    seed=st.integers(0, 2**32),
)
def test_any_groups_are_divided_whole_and_evenly(sizes: list[tuple[int, int]], count: int, seed: int) -> None:
    names = [f"g{at}" for at, (size, _) in enumerate(sizes) for _ in range(size)]
    labels = [number < successes for size, successes in sizes for number in range(size)]
    groups, success = pd.Series(names), pd.Series(labels, dtype=bool)
    if len(sizes) < count:
        with pytest.raises(FoldsError, match=f"{len(sizes)} groups, expected at least as many as folds"):
            assign_folds(groups, success, count, np.random.default_rng(seed))
        return
    fold = assign_folds(groups, success, count, np.random.default_rng(seed))
    assert fold.groupby(groups).nunique().max() == 1
    assert set(fold) == set(range(count))
    # No fold is off an even share by more than a largest group.
    for label in (True, False):
        per_group = (success == label).groupby(groups).sum()
        per_fold = (success == label).groupby(fold).sum()
        assert per_fold.sum() == per_group.sum()
    share = fold.value_counts(normalize=True)
    largest = max(size for size, _ in sizes) / len(names)
    assert share.max() - share.min() <= 2 * largest + 1 / count


def test_single_attempts_are_stratified_to_within_one() -> None:
    success = pd.Series([True] * 21 + [False] * 100)
    fold = assign_folds(pd.Series(range(121)), success, 5, np.random.default_rng(0))
    assert sorted(success.groupby(fold).sum()) == [4, 4, 4, 4, 5]
    assert sorted((~success).groupby(fold).sum()) == [20] * 5


def test_what_cannot_be_divided_is_refused(divided: GraspRepository) -> None:
    tip = divided.resolve("main")
    with pytest.raises(FoldsError, match=r"4 groups, expected at least as many as folds \(5\)"):
        make_folds(divided, "cv", by="session", count=5, seed=0, author="anna")
    for count, seed in ((1, 0), (101, 0), (3, -1)):
        with pytest.raises(FoldsError, match=f"count is {count} and seed {seed}"):
            make_folds(divided, "cv", by="session", count=count, seed=seed, author="anna")
    with pytest.raises(RefNameError, match="folds name is 'a b'"):
        make_folds(divided, "a b", by="session", count=2, seed=0, author="anna")
    assert divided.resolve("main") == tip
    make_folds(divided, "cv", by="session", count=2, seed=0, author="anna")
    with pytest.raises(RefNameError, match=r"folds 'cv' already"):
        make_folds(divided, "cv", by="session", count=3, seed=0, author="anna")
    assert make_folds(divided, "cv", by="session", count=3, seed=0, author="anna", replace=True).count == 3
    with pytest.raises(UnknownNameError, match=r"no folds 'vc' in main \(folds: cv\)"):
        read_folds(opened(divided), "vc")


def test_folds_are_refused_when_attempts_came_went_or_changed(divided: GraspRepository) -> None:
    make_folds(divided, "cv", by="session", count=2, seed=0, author="anna")
    good = opened(divided)
    anna = Curator(divided, author="anna")
    anna.relabel(Selection(where="success and seed == 0"), False, "x")
    with pytest.raises(FoldsError, match="content or labels of the attempts have changed"):
        read_folds(opened(divided), "cv")
    anna.exclude(Selection(where="seed == 1 and success.notna()"), "x")
    with SessionWriter.begin(divided, make_header(seed=9)) as writer:
        writer.append(make_attempt(writer.header, 0, outcome=Outcome.HELD))
    with pytest.raises(FoldsError, match=r"they lack 1 attempt, .*; they hold \d+ attempts excluded"):
        read_folds(opened(divided), "cv")
    assert read_folds(good, "cv").count == 2


def test_leaking_folds_are_refused(repository: GraspRepository) -> None:
    """As an editor that does not know of groups would leave them."""
    header = make_header()
    scene = make_scene(header, np.random.default_rng(0))
    attempts = [
        replace(
            make_attempt(header, number, outcome=Outcome.HELD),
            scene=replace(scene, catalogue_index=np.full_like(scene.catalogue_index, number % 3)),
        )
        for number in range(9)
    ]
    record(repository, header, attempts, every=9)
    folds = make_folds(repository, "cv", by="object", count=3, seed=0, author="anna")
    transaction = repository.writable("main")
    array = array_at(zarr.open_group(transaction.store, mode="r+"), "folds/cv/fold")
    array[0] = (folds.fold.iloc[0] + 1) % 3
    repository.commit(transaction, branch="main", message="tamper")
    with pytest.raises(FoldsError, match=r"they split 1 group over several folds \(object apple\)"):
        read_folds(opened(repository), "cv")


@pytest.mark.parametrize("attributes", [{"count": "two"}, {"by": "colour"}, {"seed": None}, {"more": 1}])
def test_folds_whose_description_is_damaged_are_made_anew(divided: GraspRepository, attributes: dict[str, Any]) -> None:
    make_folds(divided, "cv", by="session", count=2, seed=0, author="anna")
    transaction = divided.writable("main")
    group_at(zarr.open_group(transaction.store, mode="r+"), "folds/cv").update_attributes(attributes)
    divided.commit(transaction, branch="main", message="tamper")
    with pytest.raises(CorruptDataError, match=r"folds 'cv' are damaged: .*; make them anew with --replace"):
        read_folds(opened(divided), "cv")
    make_folds(divided, "cv", by="session", count=2, seed=0, author="anna", replace=True)
    assert read_folds(opened(divided), "cv").count == 2
