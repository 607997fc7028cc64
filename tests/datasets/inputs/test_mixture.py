"""Several arrays of inputs read as one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support.drawn import drawn_inputs

from handsight.datasets.inputs.mixture import StackedInputs, mixed


@given(sizes=st.lists(st.integers(0, 5), min_size=1, max_size=5), data=st.data())
def test_rows_are_those_of_the_arrays_put_together(sizes: list[int], data: st.DataObject) -> None:
    rng = np.random.default_rng(0)
    parts = [rng.random((size, 4, 2, 2)).astype(np.float16) for size in sizes]
    whole, stacked = np.concatenate(parts), StackedInputs(parts)
    assert stacked.shape == whole.shape
    positions = st.lists(st.integers(0, len(whole) - 1), max_size=12) if len(whole) else st.just([])
    rows = np.array(data.draw(positions), dtype=np.int64)
    np.testing.assert_array_equal(stacked[rows], whole[rows])
    assert stacked[rows].dtype == np.float16


def test_a_mixture_has_the_labels_and_attempts_of_its_parts_in_order() -> None:
    first, second = drawn_inputs(20, seed=0), drawn_inputs(7, seed=1)
    both = mixed([first, second])
    np.testing.assert_array_equal(both.labels, np.concatenate([first.labels, second.labels]))
    assert list(both.attempts.index) == [*range(20), *range(7)]
    np.testing.assert_array_equal(both.inputs[np.array([3, 24])], np.stack([first.inputs[3], second.inputs[4]]))
    assert both.file is None


def test_one_part_is_left_as_it_is() -> None:
    part = drawn_inputs(5, seed=0)
    assert mixed([part]) is part


def test_parts_of_different_sizes_are_refused() -> None:
    part = drawn_inputs(5, seed=0)
    smaller = type(part)(inputs=part.inputs[:, :, :8, :8], attempts=part.attempts)
    with pytest.raises(ValueError, match="2 sizes"):
        mixed([part, smaller])
    with pytest.raises(ValueError, match="0 sizes"):
        mixed([])
