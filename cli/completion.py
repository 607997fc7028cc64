"""What a shell offers when Tab is pressed: datasets, their versions, attempts and names, and sets of words.

Nothing is said about what goes wrong: there is then nothing to offer. Datasets in buckets are not asked, because nobody
waits for a network there; and everything is bounded, so that a dataset of a million attempts answers as well.
"""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    # These take a second to import; nobody pays for them who presses no Tab.
    from handsight.datasets.reading.reader import GraspDataset

MOST = 50
"""Candidates that are offered at most."""
_MOST_LOOKED_AT = 2000
"""Names in a folder, or numbers of attempts in a session, that are looked at for them."""

Completer = Callable[[typer.Context, str], list[str]]


def _offered(find: Callable[[typer.Context, str], Iterable[str]]) -> Completer:
    """A completer that never fails, never prints, and offers few words that begin as what is typed."""

    def complete(ctx: typer.Context, incomplete: str) -> list[str]:
        try:
            with redirect_stderr(StringIO()):
                fitting = (word for word in find(ctx, incomplete) if word.startswith(incomplete))
                return list(islice(filter(_typable, fitting), MOST))
        except Exception:
            return []

    return complete


def _typable(word: str) -> bool:
    """Whether a shell takes the word as it is: bash inserts it without quoting what has to be quoted."""
    return shlex.quote(word) == word or not os.environ.get("_HANDSIGHT_COMPLETE", "").endswith("bash")


def words(*known: str) -> Completer:
    """Offers some words, and after a comma the others."""

    def find(ctx: typer.Context, incomplete: str) -> Iterator[str]:
        before, comma, _ = incomplete.rpartition(",")
        return (f"{before}{comma}{word}" for word in known if word not in before.split(","))

    return _offered(find)


def _versions(ctx: typer.Context, incomplete: str) -> Iterable[str]:
    """Datasets in the folder that is typed or, behind the name of one and an ``@``, its releases and branches."""
    path, at, _ = incomplete.rpartition("@")
    if at and "/" not in incomplete[len(path) :]:
        return (f"{path}@{ref}" for ref in _refs(path))
    return _datasets(ctx, incomplete)


def _branches(ctx: typer.Context, incomplete: str) -> Iterable[str]:
    path, at, _ = incomplete.rpartition("@")
    if at and "/" not in incomplete[len(path) :]:
        return (f"{path}@{ref}" for ref in _refs(path, releases=False))
    return _datasets(ctx, incomplete)


def _datasets(ctx: typer.Context, incomplete: str) -> Iterable[str]:
    """Datasets, and the folders beside them; nothing where there is no dataset, so that the shell offers its files."""
    from handsight.datasets.address import looks_like_dataset

    folder, slash, beginning = incomplete.rpartition("/")
    start = Path(folder + slash or ".").expanduser()
    hidden = beginning.startswith(".")
    names = [
        entry.name
        for entry in islice(os.scandir(start), _MOST_LOOKED_AT)
        if entry.name.startswith(beginning) and entry.is_dir() and (hidden or not entry.name.startswith("."))
    ]
    datasets = {name for name in names if looks_like_dataset(start / name)}
    if not datasets:
        return []
    return (f"{folder}{slash}{name}{'' if name in datasets else '/'}" for name in sorted(names))


def _runs(ctx: typer.Context, incomplete: str) -> Iterable[str]:
    """Runs, and the folders beside them; nothing where there is neither, so that the shell offers its files."""
    from handsight.training.run_folder import RUN_RECORD

    folder, slash, beginning = incomplete.rpartition("/")
    start = Path(folder + slash or ".").expanduser()
    names = sorted(
        entry.name
        for entry in islice(os.scandir(start), _MOST_LOOKED_AT)
        if entry.name.startswith(beginning)
        and entry.is_dir()
        and entry.name.startswith(".") == beginning.startswith(".")
    )
    return (f"{folder}{slash}{name}{'' if (start / name / RUN_RECORD).is_file() else '/'}" for name in names)


def _refs(path: str, *, releases: bool = True) -> list[str]:
    repository = _version(path).repository
    return [*(repository.releases() if releases else ()), *repository.branches()]


def _version(text: str) -> GraspDataset:
    """The version that is meant, unless it is in a bucket.

    Raises:
        DatasetError: There is none.
        ValueError: It is in a bucket.
    """
    from handsight.datasets.address import DatasetAddress, S3Prefix, check_dataset_folder

    address = DatasetAddress.parse(text)
    if isinstance(address.path, S3Prefix):
        raise ValueError(text)
    check_dataset_folder(address.path)
    from handsight.datasets.reading.reader import GraspDataset

    return GraspDataset.open(address)


def _named(ctx: typer.Context, *arguments: str) -> GraspDataset:
    """The version that the words before name: the first that is given of some arguments."""
    # Where the last word is an option that waits for its value, nothing has been given its name yet.
    positional = [one.name for one in ctx.command.params if one.param_type_name == "argument"]
    given: dict[str, Any] = {
        **dict(zip(positional, ctx.args, strict=False)),
        **{k: v for k, v in ctx.params.items() if v},
    }
    return _version(next(str(given[name]) for name in arguments or ("dataset", "before") if given.get(name)))


def _refs_there(ctx: typer.Context, incomplete: str) -> Iterable[str]:
    repository = _named(ctx).repository
    return [*repository.releases(), *repository.branches()]


def _branches_there(ctx: typer.Context, incomplete: str) -> Iterable[str]:
    return _named(ctx).repository.branches()


def _other_versions(ctx: typer.Context, incomplete: str) -> Iterable[str]:
    """Refs of the dataset at hand, and other datasets."""
    return [*_refs_there(ctx, incomplete), *_versions(ctx, incomplete)]


def _attempts(ctx: typer.Context, incomplete: str) -> Iterator[str]:
    """Ids of attempts as ``ls`` prints them: short while what is typed is short, the newest sessions first."""
    from handsight.datasets.format.schema import attempt_id
    from handsight.datasets.reading.attempt_ids import short_id

    version = _named(ctx)
    shortened = short_id(version)
    ulid = incomplete.partition("-")[0]
    for session in reversed(version.sessions):
        if not session.ulid.startswith(ulid):
            continue
        for number in range(min(session.attempts, _MOST_LOOKED_AT)):
            whole = attempt_id(session.ulid, number)
            short = shortened(whole)
            yield short if short.startswith(incomplete) else whole


def _sessions(ctx: typer.Context, incomplete: str) -> Iterable[str]:
    return (session.ulid for session in _named(ctx, "source").sessions)


def _filters(ctx: typer.Context, incomplete: str) -> Iterable[str]:
    from handsight.datasets.format.saved_filters import read_filters

    return read_filters(_named(ctx).root)


def _folds(ctx: typer.Context, incomplete: str) -> Iterable[str]:
    from handsight.datasets.curation.folds import fold_names

    return fold_names(_named(ctx).root)


def _columns(ctx: typer.Context, incomplete: str) -> Iterable[str]:
    """Columns of the attempts table, also behind a comma."""
    before, comma, _ = incomplete.rpartition(",")
    return (f"{before}{comma}{name}" for name in _named(ctx).rows([]).columns if name not in before.split(","))


def _object_sets(ctx: typer.Context, incomplete: str) -> Iterable[str]:
    from handsight.collection.sim.objects.catalogue import list_object_sets

    return (one.name for one in list_object_sets())


def _several_object_sets(ctx: typer.Context, incomplete: str) -> Iterable[str]:
    """Object sets, also behind a comma."""
    before, comma, _ = incomplete.rpartition(",")
    return (f"{before}{comma}{name}" for name in _object_sets(ctx, "") if name not in before.split(","))


complete_version = _offered(_versions)
complete_branch = _offered(_branches)
complete_dataset = _offered(_datasets)
complete_run = _offered(_runs)
complete_other_version = _offered(_other_versions)
complete_ref = _offered(_refs_there)
complete_branch_name = _offered(_branches_there)
complete_attempt = _offered(_attempts)
complete_session = _offered(_sessions)
complete_filter = _offered(_filters)
complete_folds = _offered(_folds)
complete_columns = _offered(_columns)
complete_objects = _offered(_object_sets)
complete_object_sets = _offered(_several_object_sets)


def rejoined(typed: Sequence[str], current: int) -> tuple[list[str], int]:
    """The words of a line as its shell sees them, from those of bash, which also ends words at an ``@``.

    Args:
        typed: As bash has them: ``["ls", "lab", "@", "v"]``.
        current: Which of them the cursor is in.

    Returns:
        The words, ``["ls", "lab@v"]``, and which of them the cursor is in.
    """
    whole: list[str] = []
    place = 0
    glue = False
    for at, word in enumerate(typed):
        if whole and (glue or word == "@"):
            whole[-1] += word
        else:
            whole.append(word)
        glue = word == "@"
        if at == current:
            place = len(whole) - 1
    return whole, place


@contextmanager
def bash_words() -> Iterator[None]:
    """While a command answers bash: it is asked for whole words, and bash is given the ends that it replaces."""
    typed, current = os.environ.get("COMP_WORDS", "").split("\n"), os.environ.get("COMP_CWORD", "")
    if not current.isdecimal() or int(current) >= len(typed):
        yield
        return
    whole, place = rejoined(typed, int(current))
    os.environ.update(COMP_WORDS="\n".join(whole), COMP_CWORD=str(place))
    if whole[place] == typed[int(current)]:
        yield
        return
    answer = StringIO()
    try:
        with redirect_stdout(answer):
            yield
    finally:
        # What bash replaces begins with the last @.
        sys.stdout.write("".join(f"@{line.rpartition('@')[2]}\n" for line in answer.getvalue().splitlines()))
