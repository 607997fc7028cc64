"""Errors of the evaluation room.

EvaluationError
├── EvaluationSettingsError (ValueError)   settings out of range
├── TrialAbortedError (RuntimeError)       a trial in which nothing was grasped, for no fault of the method
├── JournalError (ValueError)              a file that is no journal of this evaluation
└── LabelIssuesError (ValueError)          attempts whose labels cannot be reviewed
"""


class EvaluationError(Exception):
    """Base of every error raised in ``handsight.evaluation``."""


class EvaluationSettingsError(EvaluationError, ValueError):
    """Settings out of range."""


class TrialAbortedError(EvaluationError, RuntimeError):
    """A trial in which nothing was grasped, for no fault of the method."""


class JournalError(EvaluationError, ValueError):
    """A file that is no journal of this evaluation."""


class LabelIssuesError(EvaluationError, ValueError):
    """Attempts whose labels cannot be reviewed."""
