"""Attempts that are one grasp recorded twice, such as with exact and with noisy depth."""

from __future__ import annotations

import pandas as pd

TWIN_COLUMNS = ("seed", "number")


def grasp_keys(attempts: pd.DataFrame) -> pd.Index[str]:
    """What only attempts at the same grasp share, shape (N,): a network that learnt from one knows the others.

    In simulation everything random follows from the session's seed and the attempt's number: the scene, and where
    chance grasps. An attempt of a session without a seed is its own.

    Args:
        attempts: Rows of attempts tables, indexed by attempt id; without the columns of a seed each is its own.
    """
    if not set(TWIN_COLUMNS) <= set(attempts.columns):
        return attempts.index
    rows = zip(attempts.index, attempts["seed"], attempts["number"], attempts["seed"].isna(), strict=True)
    return pd.Index([own if unknown else f"{seed}/{number}" for own, seed, number, unknown in rows], dtype="str")
