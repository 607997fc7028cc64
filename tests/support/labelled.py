"""Rows of the attempts table as a review of labels reads them."""

from __future__ import annotations

import pandas as pd


def labelled_attempts(
    labels: list[bool], *, truth: list[bool | None] | None = None, scenes: list[str] | None = None
) -> pd.DataFrame:
    """Labelled attempts a00, a01, ..., each in a scene of its own unless scenes are given."""
    ids = [f"a{number:02}" for number in range(len(labels))]
    return pd.DataFrame(
        {
            "success": pd.array(labels, dtype="boolean"),
            "truth_held": pd.array([None] * len(labels) if truth is None else truth, dtype="boolean"),
            "target": pd.array(["cup"] + [None] * (len(labels) - 1), dtype="str"),
            "objects": [tuple(scene.split()) for scene in (ids if scenes is None else scenes)],
        },
        index=pd.Index(ids, name="attempt", dtype="str"),
    )
