"""A dataset of everything that screens show: two sessions, decisions, branches, a release, a filter, folds."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import Curator, GraspRepository, Outcome, Selection, create_branch
from handsight.datasets.curation.folds import make_folds
from handsight.datasets.curation.saved_filters import save_filter

OUTCOMES = (Outcome.HELD, Outcome.EMPTY, Outcome.ABORTED, Outcome.EMPTY)
WHERE = "width_final_m < 0.004 and not success and (target == 'cup' or target == 'household/toy-screwdriver')"


def make_lab(path: Path) -> GraspRepository:
    """12 and 6 attempts; the second session varied nothing. Attempts of both are excluded, one is relabelled.

    Each process makes it once, and copies it from then on.
    """
    shutil.copytree(_template(), path)
    return GraspRepository.open(path)


@cache
def _template() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="lab-"))
    atexit.register(shutil.rmtree, folder)
    _make(folder / "lab")
    return folder / "lab"


def _make(path: Path) -> None:
    repository = GraspRepository.create(path)
    for seed, count in ((1, 12), (2, 6)):
        objects = ("apple", "household/toy-screwdriver", "[b]cup[/b]", "duck", "egg")
        conditions = ("table_friction", "light_ambient") if seed == 1 else ()
        header = make_header(seed=seed, width=16, height=12, objects=objects, conditions=conditions)
        attempts = [make_attempt(header, number, outcome=OUTCOMES[number % 4]) for number in range(count)]
        attempts[0] = replace(attempts[0], contact_force_n=40.0)
        record(repository, header, attempts, every=count)
    curator = Curator(repository, author="[i]anna[/i]")
    curator.exclude(Selection(where="number == 1"), "camera moved, because somebody stumbled over its [bold]tripod[/]")
    curator.relabel(Selection(where="number == 3 and seed == 1"), True, "it was held")
    repository.release("v1", message="first [u]week[/u]")
    create_branch(repository, "trial")
    Curator(repository, author="jo", branch="trial").exclude(Selection(where="number == 5"), "dark")
    save_filter(repository, "slips", WHERE, author="jo")
    make_folds(repository, "cv2", by="session", count=2, seed=0, author="jo")
