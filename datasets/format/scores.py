"""Scores of attempts as they are stored: what networks expect of the grasps that were attempted.

::

    /scores/<name>/         attrs: source, author, made
        attempt             u1 (N, 24), see keys.py
        score               f4 (N,), in [0, 1]

They are columns of the attempts table: ``score_<name>``, and ``error_<name>``, how far the score is from the label.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
import pandas as pd
import zarr

from handsight.datasets.errors import CorruptDataError, HeaderError
from handsight.datasets.format.arrays import append_rows, array_at, group_at, read_all, read_range
from handsight.datasets.format.keys import KEY_BYTES, ids_from_keys, keys_from_ids
from handsight.datasets.format.schema import create_array
from handsight.datasets.format.typed import typed

SCORES = "scores"
"""Group that holds them; absent until the first."""
SCORE_PREFIX, ERROR_PREFIX = "score_", "error_"

_CHUNK_ROWS = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoreOrigin:
    """Where scores come from."""

    source: str
    """What made them: the hash of a network's weights, or the folds whose networks never saw what they scored."""
    author: str
    made: str
    """UTC, ISO 8601."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredScores:
    """Scores of some attempts of a version."""

    name: str
    origin: ScoreOrigin
    score: pd.Series[float]
    """In [0, 1], by id."""


def score_names(root: zarr.Group) -> list[str]:
    """Names of the scores stored in a version, sorted."""
    return sorted(group_at(root, SCORES).group_keys()) if SCORES in root else []


def score_columns(root: zarr.Group) -> list[str]:
    """The columns that scores are in the attempts table."""
    return [f"{prefix}{name}" for name in score_names(root) for prefix in (SCORE_PREFIX, ERROR_PREFIX)]


def read_scores(root: zarr.Group, name: str) -> StoredScores:
    """Scores of that name.

    Raises:
        CorruptDataError: There are none, or their bytes are damaged.
    """
    group = group_at(root, f"{SCORES}/{name}")
    try:
        origin = typed(ScoreOrigin, group.attrs.asdict())
    except HeaderError as error:
        raise CorruptDataError(f"scores {name!r} are damaged: {error}; make them anew with --replace") from error
    ids = ids_from_keys(read_all(array_at(group, "attempt")))
    values = read_range(array_at(group, "score"), 0, len(ids)).astype(np.float64)
    if not ((values >= 0) & (values <= 1)).all():
        raise CorruptDataError(
            f"scores {name!r} run from {values.min()} to {values.max()}, expected 0 to 1; make them anew with --replace"
        )
    score: pd.Series[float] = pd.Series(values, index=pd.Index(ids, dtype="str", name="attempt"), dtype="float64")
    return StoredScores(name=name, origin=origin, score=score)


def write_scores(root: zarr.Group, scores: StoredScores) -> None:
    """Store scores; those of the same name are replaced."""
    parent = group_at(root, SCORES) if SCORES in root else root.create_group(SCORES)
    if scores.name in parent:
        del parent[scores.name]
    group = parent.create_group(scores.name, attributes=asdict(scores.origin))
    create_array(group, "attempt", dtype="uint8", row=(KEY_BYTES,), axes=("member", "key_byte"), rows=_CHUNK_ROWS)
    create_array(group, "score", dtype="float32", row=(), axes=("member",), rows=_CHUNK_ROWS)
    append_rows(array_at(group, "attempt"), keys_from_ids(scores.score.index.tolist()))
    append_rows(array_at(group, "score"), scores.score.to_numpy(np.float32))


def scored(table: pd.DataFrame, root: zarr.Group, names: list[str]) -> pd.DataFrame:
    """The attempts table with columns of scores behind it; missing where an attempt has none.

    Args:
        table: With ``success`` as it counts.
        root: Of the version.
        names: Which columns, of :func:`score_columns`.
    """
    stored = {name: read_scores(root, name).score for name in dict.fromkeys(one.partition("_")[2] for one in names)}
    label = table["success"].astype("float64")
    columns = {}
    for column in names:
        prefix, _, name = column.partition("_")
        score = stored[name].reindex(table.index).to_numpy()
        columns[column] = score if f"{prefix}_" == SCORE_PREFIX else np.abs(score - label.to_numpy(na_value=np.nan))
    return table.assign(**columns)
