"""What expressions yield where values are missing, near a type's edge, or long."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from handsight.datasets.reading.where_tree import where_tree
from handsight.datasets.reading.where_values import value_of

TABLE = pd.DataFrame(
    {
        "success": pd.array([True, False, None, True], dtype="boolean"),
        "taken": [True, False, True, True],
        "width_m": [0.01, np.nan, 0.03, 0.0],
        "target": pd.array(["cup", "Mug", None, "tea cup"], dtype="str"),
        "started": pd.to_datetime(["2026-01-01", "2026-01-02", "2026-01-03", "2026-01-04"]),
    },
    index=list("abcd"),
)


@pytest.mark.parametrize(
    ("where", "expected"),
    [
        ("success", "ad"),
        ("not success", "b"),
        ("success == 1", "ad"),
        ("success == taken", "abd"),
        ("not width_m > 0.005", "bd"),
        ("0 <= width_m < 0.02", "ad"),
        ("width_m.between(0, 0.01)", "ad"),
        ("width_m in [0.01, 0]", "ad"),
        ("width_m not in [0.01]", "bcd"),
        ("width_m.isna() or target.isna()", "bc"),
        ("target in ['cup', 'Mug']", "ab"),
        ("target == ['cup']", "a"),
        ("not target.str.contains('cup')", "bc"),
        ("target.str.lower().str.contains('^(cup|mug)$')", "ab"),
        ("target.str.startswith('tea')", "d"),
        ("started >= '2026-01-03'", "cd"),
        ("started > '2026-01-03T00:00+05:00'", "cd"),
        ("'2026-01-03' > started", "ab"),
        ("started.between('2026-01-02', '2026-01-03')", "bc"),
        ("abs(width_m - 0.02) > 0.005 and 1 < 2", "acd"),
        ("not 1 > 2 and taken", "acd"),
    ],
)
def test_what_holds(where: str, expected: str) -> None:
    found = value_of(where_tree(where), TABLE)
    assert "".join(TABLE.index[found.fillna(False).astype(bool)]) == expected


def test_a_pattern_of_exponential_time_takes_none() -> None:
    table = pd.DataFrame({"failure": pd.array(["a" * 5000 + "é!"], dtype="str")})
    # Python's own engine would go on for longer than the universe.
    assert (
        value_of(where_tree("failure.str.contains('(a+)+$') or failure.str.contains('(\\\\w+)+ $')"), table).sum() == 0
    )
