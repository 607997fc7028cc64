"""Scores written back to where they belong: what a network expects of attempts, as columns to sort and filter by."""

from __future__ import annotations

import re

import pandas as pd
import zarr

from handsight.datasets.address import DEFAULT_REF
from handsight.datasets.errors import AttemptNotFoundError, RefNameError, UnknownNameError, counted
from handsight.datasets.format.arrays import group_at
from handsight.datasets.format.provenance import utc_now
from handsight.datasets.format.scores import SCORES, ScoreOrigin, StoredScores, score_names, write_scores
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.writing.change import change_branch, preview_change

_NAME = re.compile(r"[a-z][a-z0-9_]{0,47}")


def check_score_name(name: str) -> None:
    """Refuse a name that no column can have.

    Raises:
        RefNameError: It is one.
    """
    if not _NAME.fullmatch(name):
        raise RefNameError(
            f"the name of the scores is {name!r}, expected up to 48 small letters, digits and underscores, a letter "
            "first: the columns score_NAME and error_NAME are called by it"
        )


def save_scores(
    repository: GraspRepository,
    name: str,
    score: pd.Series[float],
    *,
    source: str,
    author: str,
    branch: str = DEFAULT_REF,
    replace: bool = False,
    dry_run: bool = False,
) -> None:
    """Store scores of attempts in one commit. With ``dry_run`` nothing is committed.

    Args:
        repository: The dataset.
        name: Of the scores.
        score: In [0, 1], by id.
        source: What made them.
        author: Who had them made.
        branch: Which moves.
        replace: Whether scores of that name are replaced.
        dry_run: Whether it is only tried.

    Raises:
        RefNameError: The name is malformed or, without ``replace``, taken.
        AttemptNotFoundError: The branch lacks an attempt that is scored.
        RefNotFoundError: There is no such branch.
    """
    check_score_name(name)

    def change(dataset: GraspDataset, root: zarr.Group) -> tuple[str | None, None]:
        if name in score_names(root) and not replace:
            raise RefNameError(f"there are scores {name!r} already: replace them or choose another name")
        missing = score.index[~score.index.isin(dataset.tail(_all(dataset), ("number",)).index)]
        if len(missing):
            raise AttemptNotFoundError(
                f"{dataset.ref} lacks {counted(len(missing), 'attempt')} that is scored, {missing[0]} the first"
            )
        if dry_run:
            return None, None
        origin = ScoreOrigin(source=source, author=author, made=utc_now())
        write_scores(root, StoredScores(name=name, origin=origin, score=score))
        return f"score {counted(len(score), 'attempt')} as {name!r}", None

    if dry_run:
        preview_change(repository, branch, change)
    else:
        change_branch(repository, branch, change)


def forget_scores(repository: GraspRepository, name: str, *, branch: str = DEFAULT_REF, dry_run: bool = False) -> None:
    """Drop scores, in one commit; earlier versions keep them. With ``dry_run`` nothing is committed.

    Raises:
        UnknownNameError: There are none of that name.
        RefNotFoundError: There is no such branch.
    """

    def change(dataset: GraspDataset, root: zarr.Group) -> tuple[str | None, None]:
        names = score_names(root)
        if name not in names:
            raise UnknownNameError(f"there are no scores {name!r} (scores: {', '.join(names) or 'none'})")
        if dry_run:
            return None, None
        del group_at(root, SCORES)[name]
        return f"forget scores {name}", None

    if dry_run:
        preview_change(repository, branch, change)
    else:
        change_branch(repository, branch, change)


def _all(dataset: GraspDataset) -> int:
    return sum(session.attempts for session in dataset.sessions)
