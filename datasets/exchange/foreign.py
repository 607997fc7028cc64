"""Whatever libraries raise while they read what somebody else may have written, as errors of this room."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

from handsight.datasets.errors import CorruptDataError, DatasetError, InterchangeError, headline
from handsight.datasets.exchange.sources import SessionSource
from handsight.datasets.format.schema import attempt_id
from handsight.datasets.format.typed import listed
from handsight.datasets.machine import of_the_machine
from handsight.datasets.records import GraspAttempt

NOT_UNDERSTOOD = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
)
"""What readers raise for values of another type, beyond their range, or missing."""


@contextmanager
def understood(path: Path, failure: str) -> Iterator[None]:
    """Turn errors of readers into those of this room; ``failure`` goes before what they say.

    Raises:
        StorageError: The machine could not read.
        InterchangeError: It did, and what was read cannot be.
    """
    try:
        yield
    except DatasetError:
        raise
    except NOT_UNDERSTOOD as error:
        if trouble := of_the_machine(f"{path} cannot be read", error):
            raise trouble from error
        what = headline(error) if isinstance(error, OSError) else f"{type(error).__name__}: {headline(error)}"
        raise InterchangeError(f"{path} {failure}: {what}") from error


def guarded(sources: Sequence[SessionSource], path: Path) -> list[SessionSource]:
    """Sources whose attempts raise nothing but errors of this room."""

    def attempts(ulid: str, read: Callable[[], Iterator[GraspAttempt]]) -> Iterator[GraspAttempt]:
        number = 0
        try:
            for attempt in read():
                yield attempt
                number += 1
        except DatasetError:
            raise
        except NOT_UNDERSTOOD as error:
            if trouble := of_the_machine(f"{path} cannot be read", error):
                raise trouble from error
            raise CorruptDataError(
                f"attempt {attempt_id(ulid, number)} cannot be read from {path}: {type(error).__name__}: "
                f"{headline(error)}; take an undamaged copy"
            ) from error

    return [replace(source, attempts=partial(attempts, source.ulid, source.attempts)) for source in sources]


def refuse(path: Path, faults: Sequence[str]) -> None:
    """Refuse what has faults.

    Raises:
        InterchangeError: It has; the message lists the first.
    """
    if faults:
        raise InterchangeError(f"{path} cannot be imported: {listed(faults)}")
