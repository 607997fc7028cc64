"""Attempts as people name them: by a whole id, by its unique beginning, or by a number.

``92`` is attempt 92 of the only session that has one. ``01M89WDX-92`` is attempt 92 of the session whose ULID begins
so. Any other text stands for the one attempt whose id begins with it. Only what a version knows of its sessions is
looked at, never the table, so a million attempts cost no more than ten.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice

from handsight.datasets.errors import AttemptNotFoundError, pasteable
from handsight.datasets.format.beginnings import telling_length
from handsight.datasets.format.schema import attempt_id, attempt_number
from handsight.datasets.format.sessions import SessionInfo
from handsight.datasets.reading.reader import GraspDataset

_SHOWN = 3
"""Candidates in the message about a text that could mean several attempts."""


def resolve_attempt_ids(dataset: GraspDataset, texts: Sequence[str]) -> list[str]:
    """The ids of the attempts that are meant, each once, in the order of the texts.

    Args:
        dataset: The version whose attempts are meant.
        texts: Whole ids, unique beginnings of ids, or numbers; upper and lower case are the same.

    Raises:
        AttemptNotFoundError: A text means no attempt, or more than one; the message lists every such text.
    """
    found: dict[str, None] = {}
    faults = []
    for text in texts:
        ranges = _meant(dataset.sessions, text.upper())
        count = sum(len(numbers) for _, numbers in ranges)
        if count == 1:
            found[next(_ids(ranges))] = None
        else:
            faults.append(_fault(dataset, text, ranges, count))
    if faults:
        raise AttemptNotFoundError("; ".join(faults))
    return list(found)


_ID = re.compile(r"\b([0-9A-HJKMNP-TV-Z]{26})(?:-([0-9]{6,}))?\b")
"""A whole id in a text, of an attempt or of a session."""


def short_ids(ulids: Iterable[str]) -> Callable[[str], str]:
    """What writes the ids in a text shortly, as ``01M89WDX-92``, such that :func:`resolve_attempt_ids` takes them.

    Args:
        ulids: Of all sessions that the ids are to be told from.
    """
    length = telling_length(ulids)

    def shortened(text: str) -> str:
        return _ID.sub(lambda found: found[1][:length] + (f"-{int(found[2])}" if found[2] else ""), text)

    return shortened


def short_id(dataset: GraspDataset) -> Callable[[str], str]:
    """As :func:`short_ids`, for the sessions of a version."""
    return short_ids(session.ulid for session in dataset.sessions)


_Ranges = list[tuple[SessionInfo, range]]
"""Attempts as runs of numbers in sessions: they are counted without being listed."""


def _meant(sessions: Sequence[SessionInfo], text: str) -> _Ranges:
    """The attempts that a text can mean."""
    ulid, dash, digits = text.rpartition("-")
    if dash and not ulid:
        return []  # A number below zero, and not the attempt of that number in whatever session.
    number = _written_out(digits)
    if number is not None:
        exact = [(one, range(number, number + 1)) for one in sessions if one.ulid.startswith(ulid)]
        exact = [(one, numbers) for one, numbers in exact if numbers.stop <= one.attempts]
        # Without a session it is only ever a number: ULIDs begin with the time, all of a century with 01.
        if exact or not dash:
            return exact
    if not dash:
        return [(one, range(one.attempts)) for one in sessions if text and one.ulid.startswith(text)]
    return [(one, numbers) for one in sessions if one.ulid == ulid for numbers in _beginning_with(digits, one.attempts)]


def _written_out(digits: str) -> int | None:
    """The number of an attempt, written as a number is or as an id ends; None for anything else."""
    number = attempt_number(digits)
    return number if number is not None and digits in (str(number), attempt_id("", number)[1:]) else None


def _beginning_with(digits: str, attempts: int) -> Iterator[range]:
    """The numbers below ``attempts`` that begin with ``digits`` at the end of an id."""
    first_digits = attempt_number(digits or "0")
    if not attempts or first_digits is None:
        return
    shortest, longest = (len(attempt_id("", number)) - 1 for number in (0, attempts - 1))
    for width in range(shortest, longest + 1):
        unit = 10 ** (width - len(digits)) if len(digits) <= width else 0
        first = first_digits * unit
        least = 0 if width == shortest else 10 ** (width - 1)
        last = first + unit if digits else 10**width
        yield range(max(first, least), max(first, least, min(last, attempts)))


def _ids(ranges: _Ranges) -> Iterator[str]:
    return (attempt_id(session.ulid, number) for session, numbers in ranges for number in numbers)


def _fault(dataset: GraspDataset, text: str, ranges: _Ranges, count: int) -> str:
    where = f"{dataset.repository.path}@{dataset.ref}"
    if count:
        shown = ", ".join(islice(_ids(ranges), _SHOWN))
        more = f" and {count - _SHOWN} more" if count > _SHOWN else ""
        return f"attempt {text!r} of {where} can be any of {count}: {shown}{more}; write out more of the id"
    sessions = [f"{one.ulid} with {one.attempts}" for one in dataset.sessions[:_SHOWN]]
    more = f" and {len(dataset.sessions) - _SHOWN} more" if len(dataset.sessions) > _SHOWN else ""
    return (
        f"there is no attempt {text!r} in {where} (attempts of each session: {', '.join(sessions) or 'none'}{more}): "
        f"see {pasteable('handsight', 'dataset', 'ls', where)}"
    )
