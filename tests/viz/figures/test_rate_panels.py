"""Panels of rates: which objects are shown, and how far the axis goes."""

from __future__ import annotations

from handsight.datasets.reading.stats import Share
from handsight.viz.figures.rate_panels import MOST_OBJECTS, object_rows


def test_all_objects_are_shown_where_they_fit_best_first() -> None:
    shares = [Share(name=f"o{at}", attempts=50, successes=at) for at in range(MOST_OBJECTS)]
    assert [share.successes for share in object_rows(shares) if share] == list(range(MOST_OBJECTS))[::-1]
    assert object_rows([]) == []
