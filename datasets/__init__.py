"""Versioned grasp datasets: recording, history, reading.

A dataset is a folder with commits, branches and immutable releases, named ``PATH`` or ``PATH@REF``::

    repository = GraspRepository.open_or_create("grasps")
    with SessionWriter.begin(repository, header) as writer:
        writer.append(attempt)
    repository.release("v1", message="first hundred")
    dataset = GraspDataset.open("grasps@v1")
    dataset.attempts.groupby("target")["success"].mean()

Names are imported when they are first used (PEP 562), so that a command which only refuses bad input does not wait for
Icechunk, pandas or torch. This is the face for users; the rooms of handsight import modules.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if __name__ != "handsight.datasets":
    raise ImportError(
        f"this folder was imported as {__name__!r}, expected 'handsight.datasets': "
        "keep the root of the checkout off sys.path (python -P, or the handsight command)"
    )

if TYPE_CHECKING:
    from handsight.datasets.address import DatasetAddress as DatasetAddress
    from handsight.datasets.curation.curator import Curator as Curator
    from handsight.datasets.curation.folds import Folds as Folds
    from handsight.datasets.curation.folds import make_folds as make_folds
    from handsight.datasets.curation.folds import read_folds as read_folds
    from handsight.datasets.curation.saved_filters import forget_filter as forget_filter
    from handsight.datasets.curation.saved_filters import save_filter as save_filter
    from handsight.datasets.errors import AddressError as AddressError
    from handsight.datasets.errors import AttemptNotFoundError as AttemptNotFoundError
    from handsight.datasets.errors import CorruptDataError as CorruptDataError
    from handsight.datasets.errors import CurationError as CurationError
    from handsight.datasets.errors import DatasetBusyError as DatasetBusyError
    from handsight.datasets.errors import DatasetError as DatasetError
    from handsight.datasets.errors import DatasetExistsError as DatasetExistsError
    from handsight.datasets.errors import DatasetNotFoundError as DatasetNotFoundError
    from handsight.datasets.errors import FoldsError as FoldsError
    from handsight.datasets.errors import ForkedProcessError as ForkedProcessError
    from handsight.datasets.errors import FrameNotFoundError as FrameNotFoundError
    from handsight.datasets.errors import HeaderError as HeaderError
    from handsight.datasets.errors import InterchangeError as InterchangeError
    from handsight.datasets.errors import ListingError as ListingError
    from handsight.datasets.errors import LoaderStateError as LoaderStateError
    from handsight.datasets.errors import MergeError as MergeError
    from handsight.datasets.errors import NotADatasetError as NotADatasetError
    from handsight.datasets.errors import NoTrainingDataError as NoTrainingDataError
    from handsight.datasets.errors import RecordError as RecordError
    from handsight.datasets.errors import RefNameError as RefNameError
    from handsight.datasets.errors import RefNotFoundError as RefNotFoundError
    from handsight.datasets.errors import SchemaError as SchemaError
    from handsight.datasets.errors import SessionConflictError as SessionConflictError
    from handsight.datasets.errors import SessionNotFoundError as SessionNotFoundError
    from handsight.datasets.errors import StorageError as StorageError
    from handsight.datasets.errors import UnknownNameError as UnknownNameError
    from handsight.datasets.errors import VersionRemovedError as VersionRemovedError
    from handsight.datasets.errors import WhereError as WhereError
    from handsight.datasets.exchange.commands import ImportReport as ImportReport
    from handsight.datasets.exchange.commands import export_dataset as export_dataset
    from handsight.datasets.exchange.commands import import_dataset as import_dataset
    from handsight.datasets.exchange.formats import EXPORT_FORMATS as EXPORT_FORMATS
    from handsight.datasets.exchange.formats import FORMATS as FORMATS
    from handsight.datasets.exchange.merge import merge as merge
    from handsight.datasets.exchange.transfer import TransferReport as TransferReport
    from handsight.datasets.format.decisions import Decision as Decision
    from handsight.datasets.format.saved_filters import read_filters as read_filters
    from handsight.datasets.format.schema import VIEWPOINTS as VIEWPOINTS
    from handsight.datasets.format.schema import Viewpoint as Viewpoint
    from handsight.datasets.format.sessions import SessionInfo as SessionInfo
    from handsight.datasets.inputs.loader import GraspLoader as GraspLoader
    from handsight.datasets.inputs.materialize import GraspInputs as GraspInputs
    from handsight.datasets.inputs.materialize import materialize as materialize
    from handsight.datasets.inputs.torch_dataset import FlippedGrasps as FlippedGrasps
    from handsight.datasets.inputs.torch_dataset import TorchGrasps as TorchGrasps
    from handsight.datasets.integrity.doctor.examine import Diagnosis as Diagnosis
    from handsight.datasets.integrity.doctor.examine import doctor as doctor
    from handsight.datasets.integrity.doctor.findings import Finding as Finding
    from handsight.datasets.integrity.maintenance import ExpiryReport as ExpiryReport
    from handsight.datasets.integrity.maintenance import GarbageReport as GarbageReport
    from handsight.datasets.integrity.maintenance import collect_garbage as collect_garbage
    from handsight.datasets.integrity.maintenance import expire as expire
    from handsight.datasets.integrity.migrate import Migration as Migration
    from handsight.datasets.integrity.migrate import migrate as migrate
    from handsight.datasets.integrity.repair import RepairReport as RepairReport
    from handsight.datasets.integrity.repair import ResimulateAttempt as ResimulateAttempt
    from handsight.datasets.integrity.repair import repair as repair
    from handsight.datasets.integrity.verify import VerifyReport as VerifyReport
    from handsight.datasets.integrity.verify import verify as verify
    from handsight.datasets.integrity.verify_all import AllReport as AllReport
    from handsight.datasets.integrity.verify_all import verify_all as verify_all
    from handsight.datasets.reading.diff import Balance as Balance
    from handsight.datasets.reading.diff import VersionDiff as VersionDiff
    from handsight.datasets.reading.diff import diff_versions as diff_versions
    from handsight.datasets.reading.info import DatasetInfo as DatasetInfo
    from handsight.datasets.reading.listing import Listing as Listing
    from handsight.datasets.reading.reader import GraspDataset as GraspDataset
    from handsight.datasets.reading.selection import Selection as Selection
    from handsight.datasets.reading.stats import LabelStats as LabelStats
    from handsight.datasets.reading.stats import label_stats as label_stats
    from handsight.datasets.records import PHASES as PHASES
    from handsight.datasets.records import GraspAttempt as GraspAttempt
    from handsight.datasets.records import GripperReadings as GripperReadings
    from handsight.datasets.records import Outcome as Outcome
    from handsight.datasets.records import RgbdFrame as RgbdFrame
    from handsight.datasets.records import SceneObjects as SceneObjects
    from handsight.datasets.records import SessionHeader as SessionHeader
    from handsight.datasets.records import StationSpec as StationSpec
    from handsight.datasets.store.branches import create_branch as create_branch
    from handsight.datasets.store.branches import delete_branch as delete_branch
    from handsight.datasets.store.releases import Release as Release
    from handsight.datasets.store.repository import GraspRepository as GraspRepository
    from handsight.datasets.store.repository import LogEntry as LogEntry
    from handsight.datasets.views import station_view as station_view
    from handsight.datasets.writing.revert import revert as revert
    from handsight.datasets.writing.writer import SessionWriter as SessionWriter

_NAMES: dict[str, tuple[str, ...]] = {
    "address": ("DatasetAddress",),
    "curation.curator": ("Curator",),
    "curation.folds": (
        "Folds",
        "make_folds",
        "read_folds",
    ),
    "curation.saved_filters": (
        "forget_filter",
        "save_filter",
    ),
    "errors": (
        "AddressError",
        "AttemptNotFoundError",
        "CorruptDataError",
        "CurationError",
        "DatasetBusyError",
        "DatasetError",
        "DatasetExistsError",
        "DatasetNotFoundError",
        "FoldsError",
        "ForkedProcessError",
        "FrameNotFoundError",
        "HeaderError",
        "InterchangeError",
        "ListingError",
        "LoaderStateError",
        "MergeError",
        "NoTrainingDataError",
        "NotADatasetError",
        "RecordError",
        "RefNameError",
        "RefNotFoundError",
        "SchemaError",
        "SessionConflictError",
        "SessionNotFoundError",
        "StorageError",
        "UnknownNameError",
        "VersionRemovedError",
        "WhereError",
    ),
    "exchange.commands": (
        "ImportReport",
        "export_dataset",
        "import_dataset",
    ),
    "exchange.formats": (
        "EXPORT_FORMATS",
        "FORMATS",
    ),
    "exchange.merge": ("merge",),
    "exchange.transfer": ("TransferReport",),
    "format.decisions": ("Decision",),
    "format.saved_filters": ("read_filters",),
    "format.schema": (
        "VIEWPOINTS",
        "Viewpoint",
    ),
    "format.sessions": ("SessionInfo",),
    "inputs.loader": ("GraspLoader",),
    "inputs.materialize": (
        "GraspInputs",
        "materialize",
    ),
    "inputs.torch_dataset": ("FlippedGrasps", "TorchGrasps"),
    "integrity.doctor.examine": (
        "Diagnosis",
        "doctor",
    ),
    "integrity.doctor.findings": ("Finding",),
    "integrity.maintenance": (
        "ExpiryReport",
        "GarbageReport",
        "collect_garbage",
        "expire",
    ),
    "integrity.migrate": (
        "Migration",
        "migrate",
    ),
    "integrity.repair": (
        "RepairReport",
        "ResimulateAttempt",
        "repair",
    ),
    "integrity.verify": (
        "VerifyReport",
        "verify",
    ),
    "integrity.verify_all": (
        "AllReport",
        "verify_all",
    ),
    "reading.diff": (
        "Balance",
        "VersionDiff",
        "diff_versions",
    ),
    "reading.info": ("DatasetInfo",),
    "reading.listing": ("Listing",),
    "reading.reader": ("GraspDataset",),
    "reading.selection": ("Selection",),
    "reading.stats": (
        "LabelStats",
        "label_stats",
    ),
    "records": (
        "GraspAttempt",
        "GripperReadings",
        "Outcome",
        "PHASES",
        "RgbdFrame",
        "SceneObjects",
        "SessionHeader",
        "StationSpec",
    ),
    "store.branches": (
        "create_branch",
        "delete_branch",
    ),
    "store.releases": ("Release",),
    "store.repository": (
        "GraspRepository",
        "LogEntry",
    ),
    "views": ("station_view",),
    "writing.revert": ("revert",),
    "writing.writer": ("SessionWriter",),
}
"""What each module gives to the face."""

_HOMES = {name: module for module, names in _NAMES.items() for name in names}

__all__ = [
    "EXPORT_FORMATS",
    "FORMATS",
    "PHASES",
    "VIEWPOINTS",
    "AddressError",
    "AllReport",
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
    "Decision",
    "Diagnosis",
    "ExpiryReport",
    "Finding",
    "FlippedGrasps",
    "Folds",
    "FoldsError",
    "ForkedProcessError",
    "FrameNotFoundError",
    "GarbageReport",
    "GraspAttempt",
    "GraspDataset",
    "GraspInputs",
    "GraspLoader",
    "GraspRepository",
    "GripperReadings",
    "HeaderError",
    "ImportReport",
    "InterchangeError",
    "LabelStats",
    "Listing",
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
    "RgbdFrame",
    "SceneObjects",
    "SchemaError",
    "Selection",
    "SessionConflictError",
    "SessionHeader",
    "SessionInfo",
    "SessionNotFoundError",
    "SessionWriter",
    "StationSpec",
    "StorageError",
    "TorchGrasps",
    "TransferReport",
    "UnknownNameError",
    "VerifyReport",
    "VersionDiff",
    "VersionRemovedError",
    "Viewpoint",
    "WhereError",
    "collect_garbage",
    "create_branch",
    "delete_branch",
    "diff_versions",
    "doctor",
    "expire",
    "export_dataset",
    "forget_filter",
    "import_dataset",
    "label_stats",
    "make_folds",
    "materialize",
    "merge",
    "migrate",
    "read_filters",
    "read_folds",
    "repair",
    "revert",
    "save_filter",
    "station_view",
    "verify",
    "verify_all",
]


def __getattr__(name: str) -> Any:
    """Import what a name stands for; the module remembers it."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """What there is, imported or not."""
    return sorted({*globals(), *__all__})
