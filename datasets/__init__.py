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
from handsight.datasets.errors import (
    AddressError,
    AttemptNotFoundError,
    CorruptDataError,
    DatasetBusyError,
    DatasetError,
    DatasetExistsError,
    DatasetNotFoundError,
    ForkedProcessError,
    HeaderError,
    NotADatasetError,
    NoTrainingDataError,
    RecordError,
    RefNameError,
    RefNotFoundError,
    SchemaError,
    SessionConflictError,
    SessionNotFoundError,
    SnapshotNotFoundError,
    StorageError,
)
from handsight.datasets.info import DatasetInfo
from handsight.datasets.reader import GraspDataset
from handsight.datasets.records import (
    PHASES,
    GraspAttempt,
    GripperReadings,
    Outcome,
    SceneObjects,
    SessionHeader,
    Snapshot,
    StationCard,
)
from handsight.datasets.releases import Release
from handsight.datasets.repository import GraspRepository, LogEntry
from handsight.datasets.schema import VIEWS, View
from handsight.datasets.sessions import SessionInfo
from handsight.datasets.writer import SessionWriter

__all__ = [
    "PHASES",
    "VIEWS",
    "AddressError",
    "AttemptNotFoundError",
    "CorruptDataError",
    "DatasetAddress",
    "DatasetBusyError",
    "DatasetError",
    "DatasetExistsError",
    "DatasetInfo",
    "DatasetNotFoundError",
    "ForkedProcessError",
    "GraspAttempt",
    "GraspDataset",
    "GraspRepository",
    "GripperReadings",
    "HeaderError",
    "LogEntry",
    "NoTrainingDataError",
    "NotADatasetError",
    "Outcome",
    "RecordError",
    "RefNameError",
    "RefNotFoundError",
    "Release",
    "SceneObjects",
    "SchemaError",
    "SessionConflictError",
    "SessionHeader",
    "SessionInfo",
    "SessionNotFoundError",
    "SessionWriter",
    "Snapshot",
    "SnapshotNotFoundError",
    "StationCard",
    "StorageError",
    "View",
]
