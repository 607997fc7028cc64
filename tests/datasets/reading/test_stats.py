"""Counting labels: every labelled attempt is counted once, in the bin that holds it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import Curator, GraspAttempt, GraspDataset, GraspRepository, Outcome, Selection
from handsight.datasets.reading.stats import (
    ANGLE_BINS,
    BINS,
    FEWEST_IN_A_BIN,
    MAP_CELLS,
    Histogram,
    LabelStats,
    _by_quantile,
    _window_size,
    label_stats,
)


def placed(number: int, *, held: bool, force_n: float = 0.0, angle_rad: float = 0.0, x_m: float = 0.0) -> GraspAttempt:
    """A labelled attempt of which everything that is counted is known."""
    plain = make_attempt(make_header(), number, outcome=Outcome.HELD if held else Outcome.EMPTY)
    return replace(
        plain, contact_force_n=force_n, pregrasp_angle_rad=angle_rad, pregrasp_x_m=x_m, pregrasp_y_m=0.1 * (number % 3)
    )


def counted(repository: GraspRepository, *sessions: Iterable[GraspAttempt]) -> LabelStats:
    for seed, attempts in enumerate(sessions):
        record(repository, make_header(seed=seed), attempts, every=1000)
    return label_stats(GraspDataset(repository, ref="main"))


def total(histogram: Histogram) -> tuple[int, int]:
    return sum(histogram.attempts), sum(histogram.successes)


def test_all_counts_agree(repository: GraspRepository) -> None:
    attempts = [
        placed(n, held=n % 4 == 0, force_n=float(n // 2), angle_rad=0.3 * n, x_m=0.01 * n) for n in range(40)
    ] + [make_attempt(make_header(), 40 + n, outcome=Outcome.ABORTED) for n in range(3)]
    record(repository, make_header(), attempts, every=50)
    Curator(repository, author="jo").exclude(Selection(where="number < 2"), "dark")
    found = label_stats(GraspDataset(repository, ref="main"))
    assert (found.labelled, found.successes, found.excluded, found.unlabelled) == (38, 9, 2, 3)
    everything = (38, 9)
    assert total(found.angle_bins_rad) == total(found.width_bins_m) == everything
    met = total(found.contact_bins_n)
    assert (met[0] + found.no_contact.attempts, met[1] + found.no_contact.successes) == everything
    assert (np.sum(found.positions.attempts), np.sum(found.positions.successes)) == everything
    assert (sum(one.attempts for one in found.windows), sum(one.successes for one in found.windows)) == everything
    assert found.windows[0].first == 2


def test_angles_half_a_turn_apart_are_one(repository: GraspRepository) -> None:
    angles_rad = [math.radians(100.0), math.radians(-80.0), math.radians(280.0)]
    found = counted(repository, [placed(n, held=n == 0, angle_rad=angle) for n, angle in enumerate(angles_rad)])
    edges = found.angle_bins_rad.edges
    assert (edges[0], edges[-1], len(edges)) == (-math.pi / 2, math.pi / 2, ANGLE_BINS + 1)
    assert found.angle_bins_rad.attempts[0] == 3
    assert found.angle_bins_rad.successes[0] == 1


def test_contact_bins_hold_nearly_equal_counts(repository: GraspRepository) -> None:
    found = counted(repository, [placed(n, held=n < 20, force_n=max(0.0, n - 19.0) ** 3) for n in range(100)])
    assert (found.no_contact.attempts, found.no_contact.successes) == (20, 20)
    assert found.contact_bins_n.attempts == (10,) * 8
    assert total(found.contact_bins_n)[1] == 0
    assert (found.contact_bins_n.edges[0], found.contact_bins_n.edges[-1]) == (1.0, 80.0**3)


def test_cells_lie_where_the_grasps_were(repository: GraspRepository) -> None:
    found = counted(repository, [placed(n, held=n % 3 == 1, x_m=0.2) for n in range(30)]).positions
    assert len(found.x_edges_m) == 2
    assert len(found.y_edges_m) == MAP_CELLS[0] + 1
    assert found.x_edges_m[0] <= 0.2 <= found.x_edges_m[1]
    rows = np.searchsorted(found.y_edges_m, [0.0, 0.1, 0.2], side="right") - 1
    assert [found.attempts[0][row] for row in rows] == [10, 10, 10]
    assert [found.successes[0][row] for row in rows] == [0, 10, 0]
    assert np.sum(found.attempts) == 30


def test_windows_follow_the_sessions_without_small_remainders(repository: GraspRepository) -> None:
    found = counted(
        repository,
        [placed(n, held=n < 12) for n in range(53)],
        [placed(n, held=True) for n in range(4)],
        [placed(n, held=False) for n in range(30)],
    )
    assert found.window_attempts == 10
    sizes = [[one.attempts for one in found.windows if one.session == share.name] for share in found.sessions]
    assert sizes == [[11, 11, 11, 10, 10], [4], [10, 10, 10]]
    assert [(one.first, one.last) for one in found.windows[:2]] == [(0, 10), (11, 21)]
    assert [one.successes for one in found.windows] == [11, 1, 0, 0, 0, 4, 0, 0, 0]


def test_nothing_labelled_is_no_failure(repository: GraspRepository) -> None:
    found = counted(repository, [make_attempt(make_header(), n, outcome=Outcome.ABORTED) for n in range(3)])
    assert (found.labelled, found.unlabelled) == (0, 3)
    assert found.width_bins_m.edges == found.contact_bins_n.edges == ()
    assert found.positions.attempts == ()
    assert found.windows == ()
    assert total(found.angle_bins_rad) == (0, 0)


def test_equal_values_have_one_bin(repository: GraspRepository) -> None:
    found = counted(repository, [placed(n, held=True, force_n=7.0) for n in range(5)])
    assert (found.contact_bins_n.edges, found.contact_bins_n.attempts) == ((7.0, 7.0), (5,))
    assert found.no_contact.attempts == 0
    assert found.force_n[0].attempts == 5


@pytest.mark.parametrize(("attempts", "size"), [(8000, 1000), (7999, 500), (1600, 200), (80, 10), (3, 10)])
def test_smaller_versions_have_smaller_windows(attempts: int, size: int) -> None:
    assert _window_size(attempts) == size


def test_rows_hold_nearly_equal_counts_and_frequent_values_are_by_themselves(repository: GraspRepository) -> None:
    found = counted(repository, [placed(n, held=n >= 90, force_n=max(0.0, n - 89.0)) for n in range(130)])
    assert [(one.name, one.attempts, one.successes) for one in found.force_n[:2]] == [("0", 90, 0), ("1 to 6", 6, 6)]
    assert [one.attempts for one in found.force_n[1:]] == [6, 6, 6, 5, 6, 6, 5]
    assert found.force_n[-1].name == "36 to 40"


@given(values=st.lists(st.one_of(st.sampled_from([0.0, 1.0, 2.0]), st.floats(0, 9)), max_size=200))
def test_every_value_is_in_one_row(values: list[float]) -> None:
    rows = _by_quantile(np.array(values), np.array(values) > 1)
    assert sum(row.attempts for row in rows) == len(values)
    assert sum(row.successes for row in rows) == sum(value > 1 for value in values)
    assert all(row.attempts for row in rows)
    frequent = {value for value in values if values.count(value) * BINS > len(values)}
    assert {f"{value:.4g}" for value in frequent} <= {row.name for row in rows}
    spread = [row.attempts for row in rows if " to " in row.name]
    assert len(rows) <= BINS + len(frequent) + 1
    assert not spread or max(spread) <= max(2 * len(values) / BINS + 1, 2 * FEWEST_IN_A_BIN)


def test_values_that_are_not_numbers_are_left_out() -> None:
    rows = _by_quantile(np.array([math.nan, 1.0, math.inf]), np.array([True, True, False]))
    assert [(row.name, row.attempts, row.successes) for row in rows] == [("1", 1, 1)]
    assert _by_quantile(np.array([]), np.array([], dtype=bool)) == ()
