"""Errors of the datasets room.

DatasetError
├── AddressError (ValueError)                  text that is no ``PATH[@REF]``
├── DatasetNotFoundError (FileNotFoundError)   no folder at that path
├── DatasetExistsError (FileExistsError)       creation where a dataset already is
├── NotADatasetError (NotADirectoryError)      a file or a foreign folder where a dataset is wanted
├── SchemaError (ValueError)                   a dataset of a newer schema, or of an older one and not migrated
├── RefNotFoundError (LookupError)             no release, branch or snapshot of that name
├── VersionRemovedError (LookupError)          a version that was expired and collected while it was read
├── RefNameError (ValueError)                  a name that a release cannot take
├── AttemptNotFoundError (LookupError)         no such attempt in this version of the dataset
├── FrameNotFoundError (LookupError)           the attempt exists, the picture was never taken
├── SessionNotFoundError (LookupError)         no such session in this version of the dataset
├── SessionConflictError (ValueError)          a session that exists already, or that another process continued
├── HeaderError (ValueError)                   a session header that cannot be recorded
├── RecordError (ValueError)                   an attempt that cannot be recorded
├── WhereError (ValueError)                    a --where expression that selects nothing sound
├── ListingError (ValueError)                  columns, an order or a limit that no listing can have
├── CurationError (ValueError)                 a decision that cannot be recorded
├── FoldsError (ValueError)                    folds that cannot be made, or that leak
├── UnknownNameError (LookupError)             no saved filter, folds or decision of that name
├── NoTrainingDataError (ValueError)           a version from which no network input can be made
├── LoaderStateError (ValueError)              the state of a loader of other batches
├── InterchangeError (ValueError)              a foreign file that cannot be imported, or a bad target of an export
├── MergeError (ValueError)                    sessions that do not belong into one dataset
├── CorruptDataError (OSError)                 stored bytes that fail their checksum or are missing
├── StorageError (OSError)                     Icechunk failed
├── DatasetBusyError (TimeoutError)            another process held the commit lock for too long
└── ForkedProcessError (RuntimeError)          use in a forked child of the process that opened the dataset
"""

from __future__ import annotations

import shlex


class DatasetError(Exception):
    """Base of every error raised in ``handsight.datasets``."""


class AddressError(DatasetError, ValueError):
    """Text that is no ``PATH[@REF]``."""


class DatasetNotFoundError(DatasetError, FileNotFoundError):
    """There is no folder at that path."""


class DatasetExistsError(DatasetError, FileExistsError):
    """A dataset was to be created where one already is."""


class NotADatasetError(DatasetError, NotADirectoryError):
    """A file or a foreign folder lies where a dataset is wanted."""


class SchemaError(DatasetError, ValueError):
    """The dataset has a newer schema than this handsight reads, or an older one and was not migrated."""


class RefNotFoundError(DatasetError, LookupError):
    """No release, branch or snapshot has that name."""


class VersionRemovedError(DatasetError, LookupError):
    """The version was expired, and its files were deleted, while it was being read."""


class RefNameError(DatasetError, ValueError):
    """A release cannot take that name."""


class AttemptNotFoundError(DatasetError, LookupError):
    """This version of the dataset holds no such attempt."""


class FrameNotFoundError(DatasetError, LookupError):
    """The attempt exists, but that picture was never taken."""


class SessionNotFoundError(DatasetError, LookupError):
    """This version of the dataset holds no such session."""


class SessionConflictError(DatasetError, ValueError):
    """The session exists already, or another process continued it."""


class HeaderError(DatasetError, ValueError):
    """The session header cannot be recorded; the message lists every fault."""


class RecordError(DatasetError, ValueError):
    """The attempt cannot be recorded; the message lists every fault."""


class WhereError(DatasetError, ValueError):
    """A ``--where`` expression that cannot be evaluated, or that yields no truth values."""


class ListingError(DatasetError, ValueError):
    """Attempts cannot be listed so; the message lists every fault."""


class CurationError(DatasetError, ValueError):
    """A decision that cannot be recorded; the message lists every fault."""


class FoldsError(DatasetError, ValueError):
    """Folds that cannot be made, or that do not fit the version they are read from; every fault is listed."""


class UnknownNameError(DatasetError, LookupError):
    """The version holds no saved filter, folds or decision of that name."""


class NoTrainingDataError(DatasetError, ValueError):
    """No network input can be made from this version."""


class LoaderStateError(DatasetError, ValueError):
    """The state of a loader belongs to other batches; the message lists every difference."""


class InterchangeError(DatasetError, ValueError):
    """A foreign file cannot be imported, or nothing can be exported to that target."""


class MergeError(DatasetError, ValueError):
    """Sessions do not belong into one dataset; the message lists every fault."""


class CorruptDataError(DatasetError, OSError):
    """Stored bytes fail their checksum or are missing."""


class StorageError(DatasetError, OSError):
    """Icechunk failed, for instance because the disk is full."""


class DatasetBusyError(DatasetError, TimeoutError):
    """Another process held the commit lock for too long."""


class ForkedProcessError(DatasetError, RuntimeError):
    """An open dataset was used in a forked child, where Icechunk would hang."""


def counted(number: int, noun: str, nouns: str = "") -> str:
    """A number of things for a message, such as ``1 attempt`` and ``2 attempts``.

    Args:
        number: How many.
        noun: What one of them is called.
        nouns: What several are called, where that is not the noun with an s.
    """
    return f"{number} {noun}" if number == 1 else f"{number} {nouns or f'{noun}s'}"


def below_least(settings: object, **least: int) -> list[str]:
    """What is wrong with settings of which some numbers have a least value, one fault for each that is below it.

    Args:
        settings: Whatever has attributes of these names.
        least: The least value of each.
    """
    values = {name: getattr(settings, name) for name in least}
    return [f"{name} is {values[name]}, expected {low} or more" for name, low in least.items() if values[name] < low]


def pasteable(*words: object) -> str:
    """A call for a message, as it is pasted into a shell: ``'handsight dataset log grasps'``.

    Quotation marks would not tell where a call ends in which a word needs some itself; it stands bare.
    """
    call = shlex.join(map(str, words))
    return call if "'" in call else f"'{call}'"


def headline(error: Exception) -> str:
    """The first line of an error's message, for another's; Icechunk adds a Rust backtrace below it."""
    lines = [line.strip(" x×") for line in str(error).splitlines() if line.strip(" x×")]
    return lines[0] if lines else type(error).__name__
