"""Versioned grasp datasets: recording, history, reading.

A dataset is a folder with commits, branches and immutable releases, named ``PATH`` or ``PATH@REF``::

    repository = GraspRepository.open_or_create("grasps")
    with SessionWriter.begin(repository, header) as writer:
        writer.append(attempt)
    repository.release("v1", message="first hundred")
    dataset = GraspDataset.open("grasps@v1")
    dataset.attempts.groupby("target")["success"].mean()
"""

from __future__ import annotations

if __name__ != "handsight.datasets":
    raise ImportError(
        f"this folder was imported as {__name__!r}, expected 'handsight.datasets': "
        "keep the root of the checkout off sys.path (python -P, or the handsight command)"
    )

from handsight.datasets.address import DatasetAddress
from handsight.datasets.curation.curator import Curator
from handsight.datasets.curation.folds import Folds, make_folds, read_folds
from handsight.datasets.errors import (
    AddressError,
    AttemptNotFoundError,
    CorruptDataError,
    CurationError,
    DatasetBusyError,
    DatasetError,
    DatasetExistsError,
    DatasetNotFoundError,
    FoldsError,
    ForkedProcessError,
    FrameNotFoundError,
    HeaderError,
    InterchangeError,
    ListingError,
    LoaderStateError,
    MergeError,
    NotADatasetError,
    NoTrainingDataError,
    RecordError,
    RefNameError,
    RefNotFoundError,
    SchemaError,
    SessionConflictError,
    SessionNotFoundError,
    StorageError,
    UnknownNameError,
    WhereError,
)
from handsight.datasets.format.schema import VIEWPOINTS, Viewpoint
from handsight.datasets.format.sessions import SessionInfo
from handsight.datasets.integrity.maintenance import ExpiryReport, GarbageReport, collect_garbage, expire
from handsight.datasets.integrity.migrate import Migration, migrate
from handsight.datasets.integrity.repair import RepairReport, ResimulateAttempt, repair
from handsight.datasets.integrity.verify import VerifyReport, verify
from handsight.datasets.reading.diff import Balance, VersionDiff, diff_versions
from handsight.datasets.reading.info import DatasetInfo
from handsight.datasets.reading.reader import GraspDataset
from handsight.datasets.reading.selection import Selection
from handsight.datasets.records import (
    PHASES,
    GraspAttempt,
    GripperReadings,
    Outcome,
    RgbdFrame,
    SceneObjects,
    SessionHeader,
    StationCard,
)
from handsight.datasets.store.branches import create_branch, delete_branch
from handsight.datasets.store.releases import Release
from handsight.datasets.store.repository import GraspRepository, LogEntry
from handsight.datasets.writing.revert import revert
from handsight.datasets.writing.writer import SessionWriter

__all__ = [
    "PHASES",
    "VIEWPOINTS",
    "AddressError",
    "AttemptNotFoundError",
    "Balance",
    "CorruptDataError",
    "CurationError",
    "Curator",
    "DatasetAddress",
    "DatasetBusyError",
    "DatasetError",
    "DatasetExistsError",
    "DatasetInfo",
    "DatasetNotFoundError",
    "ExpiryReport",
    "Folds",
    "FoldsError",
    "ForkedProcessError",
    "GarbageReport",
    "GraspAttempt",
    "GraspDataset",
    "GraspRepository",
    "GripperReadings",
    "HeaderError",
    "InterchangeError",
    "ListingError",
    "LoaderStateError",
    "LogEntry",
    "MergeError",
    "Migration",
    "NoTrainingDataError",
    "NotADatasetError",
    "Outcome",
    "RecordError",
    "RefNameError",
    "RefNotFoundError",
    "Release",
    "RepairReport",
    "ResimulateAttempt",
    "SceneObjects",
    "SchemaError",
    "Selection",
    "SessionConflictError",
    "SessionHeader",
    "SessionInfo",
    "SessionNotFoundError",
    "SessionWriter",
    "RgbdFrame",
    "FrameNotFoundError",
    "StationCard",
    "StorageError",
    "UnknownNameError",
    "VerifyReport",
    "VersionDiff",
    "Viewpoint",
    "WhereError",
    "collect_garbage",
    "create_branch",
    "delete_branch",
    "diff_versions",
    "expire",
    "make_folds",
    "migrate",
    "read_folds",
    "repair",
    "revert",
    "verify",
]
