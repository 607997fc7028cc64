"""Folds for cross-validation: grouped, stratified, seeded, and kept in the version they belong to.

::

    /folds/<name>/          attrs: by, seed, count, attempts_digest, author, made
        attempt             u1 (N, 24), see keys.py
        fold                u1 (N,)

What shares a group is never split: attempts on one object, of one scene or of one session look too much alike for one
of them to test what was learned from the others. When folds are read they are checked against the version: every
labelled attempt that takes part has a fold, no group is in two, and the attempts still are those that were divided.
"""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

import numpy as np
import pandas as pd
import zarr

from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.errors import CorruptDataError, FoldsError, HeaderError, RefNameError, UnknownNameError, counted
from handsight.datasets.format.arrays import append_rows, array_at, group_at, read_all, read_range
from handsight.datasets.format.decisions import trainable
from handsight.datasets.format.keys import KEY_BYTES, ids_from_keys, keys_from_ids
from handsight.datasets.format.provenance import utc_now
from handsight.datasets.format.schema import create_array
from handsight.datasets.format.typed import typed
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.store.releases import check_name
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.writing.change import change_branch, preview_change

FOLDS = "folds"
"""Group that holds the folds; absent until the first."""

Grouping = Literal["object", "scene", "session"]
GROUPINGS: tuple[Grouping, ...] = get_args(Grouping)
"""``object``: the target; ``scene``: the set of objects on the table; ``session``: one run of a station."""

UNKNOWN_GROUP = "?"
"""Stands for every target or scene that is not known: such attempts count as one group."""

_MOST_FOLDS = 100
_CHUNK_ROWS = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Folds:
    """A division of the labelled attempts of a version."""

    name: str
    by: Grouping
    seed: int
    count: int
    """Number of folds."""
    attempts_digest: str
    """SHA-256 of the attempts divided: their content and their labels."""
    made: str
    """UTC, ISO 8601."""
    author: str
    fold: pd.Series[int]
    """Fold of each attempt, 0 to ``count`` - 1, by id."""

    def split(self, held_out: int) -> tuple[list[str], list[str]]:
        """Ids to train on and ids to test on when one fold is held out.

        Raises:
            FoldsError: There is no such fold.
        """
        if not 0 <= held_out < self.count:
            raise FoldsError(f"fold is {held_out}, expected 0 to {self.count - 1} of folds {self.name!r}")
        out = self.fold == held_out
        return self.fold.index[~out].tolist(), self.fold.index[out].tolist()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Said:
    """The attributes of folds as they are stored."""

    by: Grouping
    seed: int
    count: int
    attempts_digest: str
    made: str
    author: str


def make_folds(
    repository: GraspRepository,
    name: str,
    *,
    by: Grouping,
    count: int,
    seed: int,
    author: str,
    branch: str = DEFAULT_REF,
    replace: bool = False,
    dry_run: bool = False,
) -> Folds:
    """Divide the labelled attempts of a branch that are not excluded, and store the division in one commit.

    The same attempts, grouping, count and seed give the same folds. With ``dry_run`` they are not stored.

    Raises:
        RefNameError: The name is malformed or, without ``replace``, taken.
        FoldsError: The count is out of range, or there are fewer groups than folds.
        RefNotFoundError: There is no such branch.
    """
    check_name("folds", name)
    if not 2 <= count <= _MOST_FOLDS or seed < 0:
        raise FoldsError(f"count is {count} and seed {seed}, expected 2 to {_MOST_FOLDS} folds and a seed of 0 or more")

    def change(dataset: GraspDataset, root: zarr.Group) -> tuple[str | None, Folds]:
        if name in fold_names(root) and not replace:
            raise RefNameError(f"there are folds {name!r} already: replace them or choose another name")
        rows = _divided(dataset)
        fold = assign_folds(attempt_groups(rows, by), rows["success"].astype(bool), count, np.random.default_rng(seed))
        folds = Folds(
            name=name,
            by=by,
            seed=seed,
            count=count,
            attempts_digest=_digest(rows),
            made=utc_now(),
            author=author,
            fold=fold,
        )
        if dry_run:
            return None, folds
        _write(root, folds)
        return f"divide {counted(len(fold), 'attempt')} into {count} folds {name!r} by {by}", folds

    if dry_run:
        return preview_change(repository, branch, change)
    return change_branch(repository, branch, change).value


def read_folds(dataset: GraspDataset, name: str) -> Folds:
    """The folds of that name, checked against the version they are read from.

    Raises:
        UnknownNameError: There are no folds of that name.
        FoldsError: They leak or do not cover this version; every fault is in the message.
        CorruptDataError: Their bytes are damaged.
    """
    root = dataset.root
    names = fold_names(root)
    if name not in names:
        raise UnknownNameError(f"there are no folds {name!r} in {dataset.ref} (folds: {', '.join(names) or 'none'})")
    folds = load_folds(root, name)
    faults = fold_faults(dataset, folds)
    if faults:
        raise FoldsError(f"folds {name!r} do not fit {dataset.ref}: {'; '.join(faults)}; make them anew")
    return folds


def load_folds(root: zarr.Group, name: str) -> Folds:
    """Folds as they are stored, unchecked; :func:`read_folds` is for those who train on them.

    Raises:
        CorruptDataError: There are none of that name, or their bytes are damaged.
    """
    group = group_at(root, f"{FOLDS}/{name}")
    try:
        said = typed(_Said, group.attrs.asdict())
    except HeaderError as error:
        raise CorruptDataError(f"folds {name!r} are damaged: {error}; make them anew with --replace") from error
    ids = ids_from_keys(read_all(array_at(group, "attempt")))
    index = pd.Index(ids, dtype="str", name="attempt")
    numbers = read_range(array_at(group, "fold"), 0, len(ids))
    fold: pd.Series[int] = pd.Series(numbers, index=index, dtype="int64", name="fold")
    return Folds(name=name, fold=fold, **asdict(said))


def fold_names(root: zarr.Group) -> list[str]:
    """Names of the folds stored in a version, sorted."""
    return sorted(group_at(root, FOLDS).group_keys()) if FOLDS in root else []


def fold_faults(dataset: GraspDataset, folds: Folds) -> list[str]:
    """What is wrong with folds as a division of this version; empty when nothing is."""
    rows = _divided(dataset)
    faults = []
    if folds.fold.index.has_duplicates:
        twice = int(folds.fold.index.duplicated().sum())
        faults.append(f"they hold {counted(twice, 'attempt')} twice")
    if not folds.fold.between(0, folds.count - 1).all():
        faults.append(
            f"fold numbers run from {folds.fold.min()} to {folds.fold.max()}, expected 0 to {folds.count - 1}"
        )
    uncovered = rows.index[~rows.index.isin(folds.fold.index)]
    if len(uncovered):
        faults.append(f"they lack {counted(len(uncovered), 'attempt')}, {uncovered[0]} the first")
    gone = folds.fold.index[~folds.fold.index.isin(rows.index)]
    if len(gone):
        faults.append(f"they hold {counted(len(gone), 'attempt')} excluded, unlabelled or missing, {gone[0]} the first")
    known = folds.fold[folds.fold.index.isin(rows.index)]
    groups = attempt_groups(rows.loc[known.index], folds.by)
    leaking = known.groupby(groups).nunique()
    leaking = leaking[leaking > 1]
    if len(leaking):
        names = ", ".join(map(str, leaking.index[:5]))
        faults.append(f"they split {counted(len(leaking), 'group')} over several folds ({folds.by} {names})")
    if not faults and _digest(rows) != folds.attempts_digest:
        faults.append("content or labels of the attempts have changed since they were divided")
    return faults


def assign_folds(
    groups: pd.Series[Any], labels: pd.Series[bool], count: int, generator: np.random.Generator
) -> pd.Series[int]:
    """A fold for each attempt: whole groups, folds of like size and like share of successes.

    Greedy: the largest groups go first, in random order among equals, each into the fold where size and successes
    stay closest to even.

    Raises:
        FoldsError: There are fewer groups than folds.
    """
    table = pd.DataFrame({"group": groups.astype(str), "success": labels})
    sizes = table.groupby("group")["success"].agg(["size", "sum"]).sort_index()
    if len(sizes) < count:
        raise FoldsError(
            f"the attempts form {counted(len(sizes), 'group')}, expected at least as many as folds ({count}): "
            "use fewer folds"
        )
    sizes = sizes.iloc[generator.permutation(len(sizes))].sort_values("size", ascending=False, kind="stable")
    figures = np.stack([sizes["sum"], sizes["size"] - sizes["sum"]], axis=1).astype(np.float64)  # (groups, 2)
    # Successes and failures weigh alike, however rare one of them is.
    figures /= np.maximum(figures.sum(axis=0), 1)
    loads = np.zeros((count, 2))
    chosen = np.empty(len(sizes), np.int64)
    for at, figure in enumerate(figures):
        # What the squares of the loads would add up to: least where the fold lacks most of what the group has.
        cost = 2 * loads @ figure
        empty = ~loads.any(axis=1)
        cost[empty] = -1.0
        best = np.flatnonzero(cost == cost.min())
        chosen[at] = generator.choice(best)
        loads[chosen[at]] += figure
    by_group = pd.Series(chosen, index=sizes.index)
    return table["group"].map(by_group).astype("int64").rename("fold")


def _divided(dataset: GraspDataset) -> pd.DataFrame:
    """The attempts that training can see."""
    return dataset.attempts[trainable(dataset.attempts)]


def attempt_groups(rows: pd.DataFrame, by: Grouping) -> pd.Series[Any]:
    """What each attempt must not be parted from; ``UNKNOWN_GROUP`` where its target or scene is not known."""
    if by == "object":
        return rows["target"].fillna(UNKNOWN_GROUP)
    if by == "session":
        return rows["session"]
    return rows["objects"].map(lambda names: " ".join(sorted(names)) or UNKNOWN_GROUP).astype("str")


def _digest(rows: pd.DataFrame) -> str:
    lines = [f"{content} {int(label)}\n" for content, label in zip(rows["digest"], rows["success"], strict=True)]
    return hashlib.sha256("".join(sorted(lines)).encode()).hexdigest()


def _write(root: zarr.Group, folds: Folds) -> None:
    parent = group_at(root, FOLDS) if FOLDS in root else root.create_group(FOLDS)
    if folds.name in parent:
        del parent[folds.name]
    attributes = {
        "by": folds.by,
        "seed": folds.seed,
        "count": folds.count,
        "attempts_digest": folds.attempts_digest,
        "made": folds.made,
        "author": folds.author,
    }
    group = parent.create_group(folds.name, attributes=attributes)
    create_array(group, "attempt", dtype="uint8", row=(KEY_BYTES,), axes=("member", "key_byte"), rows=_CHUNK_ROWS)
    create_array(group, "fold", dtype="uint8", row=(), axes=("member",), rows=_CHUNK_ROWS)
    append_rows(array_at(group, "attempt"), keys_from_ids(folds.fold.index.tolist()))
    append_rows(array_at(group, "fold"), folds.fold.to_numpy(np.uint8))
