"""Which errors are the user's business, and how they are shown."""

from __future__ import annotations

import errno
import sys

from handsight.collection.errors import CollectionError
from handsight.datasets.errors import DatasetError
from handsight.datasets.machine import said_by
from handsight.evaluation.errors import EvaluationError
from handsight.jobs.errors import JobsError
from handsight.servoing.errors import ServoingError
from handsight.training.errors import TrainingError
from handsight.viz.errors import VizError


class CommandError(ValueError):
    """Options that are fine one by one and make no sense together."""


_OURS = (
    CommandError,
    CollectionError,
    DatasetError,
    EvaluationError,
    JobsError,
    ServoingError,
    TrainingError,
    VizError,
)
"""Their messages say what to do."""
EXPECTED = (*_OURS, OSError)
"""Bad input and a bad environment (missing rights, full disk). Anything else is a bug and keeps its traceback."""


def is_expected(error: BaseException) -> bool:
    """Whether an error is the user's business, or the machine's: no memory, no thread."""
    return isinstance(error, EXPECTED) or said_by(error) is not None


def report(error: BaseException) -> None:
    """One line on standard error: what, the value got, what was expected, what to do."""
    text = str(error)
    if isinstance(error, OSError) and error.errno is not None:
        where = f"{error.filename}: " if error.filename else ""
        text = f"{where}{error.strerror or errno.errorcode.get(error.errno, 'input/output error')}"
    if not isinstance(error, _OURS) and (said := said_by(error)):
        cause, remedy = said
        text = f"{text if isinstance(error, OSError) else cause}; {remedy}"
    sys.stderr.write(f"error: {' '.join(text.split())}\n")
