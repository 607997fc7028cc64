"""Export and import, whatever the format."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handsight.datasets.address import DEFAULT_REF, Location, S3Prefix, location_of
from handsight.datasets.atomic import atomic_folder
from handsight.datasets.errors import DatasetError, InterchangeError, StorageError, headline
from handsight.datasets.exchange.formats import format_named, format_of
from handsight.datasets.exchange.places import refuse_source, refuse_target, staying_in_place
from handsight.datasets.exchange.transfer import TransferReport, transfer
from handsight.datasets.held import HeldFolder
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.store.icechunk_engine import sync_file_system
from handsight.datasets.store.readers import being_read
from handsight.datasets.store.repository import GraspRepository
from handsight.datasets.writable import refuse_unwritable


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportReport:
    """What an import did, or would do."""

    format: str
    created: bool
    """Whether the dataset was made by this import."""
    transfer: TransferReport
    preview: dict[str, Any] | None = None
    """What a map made of the set: ``held``, ``empty`` and the ``first`` attempt; None without a map."""


def export_dataset(
    dataset: GraspDataset, target: str | Path, *, format: str, on_attempt: Callable[[], None] | None = None
) -> None:
    """Write a whole version, curation included, in another format.

    Args:
        dataset: The version.
        target: File or folder to make. It is whole or absent: it is written beside its location and renamed.
        format: Name of the format, see ``FORMATS``.
        on_attempt: Called for every attempt written.

    Raises:
        InterchangeError: The format cannot be written, something is at the target, or it is inside a dataset.
        CorruptDataError: An attempt is damaged; the message names it.
        VersionRemovedError: The version was expired and collected meanwhile.
        StorageError: The target cannot be written, for instance because the disk is full.
    """
    chosen, path = format_named(format), Path(target)
    if chosen.write is None:
        raise InterchangeError(f"format {format!r} is only imported: choose another")
    reading = being_read(dataset.repository, dataset.snapshot_id, f"export to {path.name} ({format})")
    with _writing_to(path), whole_or_absent(path) as unfinished, reading:
        chosen.write(dataset, unfinished, on_attempt or _nothing)


def import_dataset(
    source: str | Path,
    target: str | Location,
    *,
    format: str | None = None,
    map: str | Path | None = None,
    branch: str = DEFAULT_REF,
    allow_mismatch: bool = False,
    dry_run: bool = False,
    author: str = "unknown",
    on_total: Callable[[int], None] | None = None,
    on_attempt: Callable[[], None] | None = None,
) -> ImportReport:
    """Add everything in a file or folder of another format to a dataset, which is made where there is none.

    All of it is added or none; see ``transfer.transfer`` for the checks, the arguments and the errors they raise.

    Args:
        source: What to import.
        target: The dataset; in a bucket it must exist already.
        format: Name of the format; None to look at the source.
        map: A file that says what the columns of a foreign LeRobotDataset or HDF5 file mean, see ``mapped/map_file``.
        branch: The branch of an existing dataset that moves.
        allow_mismatch: Take sessions recorded with other instruments than those the dataset knows.
        dry_run: Check and report, and change nothing.
        author: Who imports, and decides where the source's user has changed labels or filter keys in it.
        on_total: Told how many attempts are to be written, before the first is.
        on_attempt: Called for every attempt written.

    Raises:
        InterchangeError: The source is in no known format or is malformed, or the map is.
        StorageError: The dataset cannot be written to.
    """
    path, location = Path(source), location_of(target)
    refuse_source(path)
    if not dry_run:
        refuse_unwritable(location)
    if map is not None and format is not None:
        raise InterchangeError(
            f"format {format!r} and a map are given: a map says itself what the set is; leave one out"
        )
    if map is None:
        chosen = format_of(path) if format is None else format_named(format)
        name, opened = chosen.name, chosen.open(path)
    else:
        from handsight.datasets.exchange.mapped.bundle import open_mapped  # SciPy, which other imports do without

        name, opened = "mapped", open_mapped(path, Path(map))
    message = f"import {path.name} ({name})"
    with opened as bundle, _destination(location, dry_run=dry_run) as repository:
        report = transfer(
            repository,
            bundle.sessions,
            decisions=bundle.decisions,
            edits=bundle.edits,
            author=author,
            branch=branch,
            message=message,
            allow_mismatch=allow_mismatch,
            dry_run=dry_run,
            on_total=on_total,
            on_attempt=on_attempt,
        )
        created = repository.path != location
    return ImportReport(format=name, created=created and not dry_run, transfer=report, preview=bundle.preview)


@contextmanager
def _writing_to(target: Path) -> Iterator[None]:
    """Turn what the system says against writing somewhere into ``StorageError``."""
    try:
        yield
    except DatasetError:
        raise
    except OSError as error:
        raise StorageError(
            f"cannot write {target}: {error.strerror or headline(error)}; make room there, or choose another place"
        ) from error


@contextmanager
def whole_or_absent(target: Path) -> Iterator[Path]:
    """A path to write to that becomes ``target`` at the end, unless the block fails, which leaves nothing.

    Raises:
        InterchangeError: Something is at the target, or it is inside a dataset.
    """
    refuse_target(target)
    target.parent.mkdir(parents=True, exist_ok=True)
    with atomic_folder(target) as unfinished:
        yield unfinished
        sync_file_system(unfinished)


@contextmanager
def _destination(path: Location, *, dry_run: bool) -> Iterator[GraspRepository]:
    """The dataset at a location; a new folder appears there only once the block has succeeded."""
    if isinstance(path, S3Prefix):
        yield GraspRepository.open(path)
        return
    if path.exists():
        with staying_in_place(path):
            yield GraspRepository.open(path)
        return
    if dry_run:
        refuse_target(path)
        with HeldFolder("handsight-dry-run-") as folder:
            yield GraspRepository.create(folder / "dataset")
        return
    with whole_or_absent(path) as unfinished:
        yield GraspRepository.create(unfinished)


def _nothing() -> None:
    pass
