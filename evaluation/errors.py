"""Errors of the evaluation room.

EvaluationError
├── EvaluationSettingsError (ValueError)   settings out of range
└── LabelIssuesError (ValueError)          attempts whose labels cannot be reviewed
"""


class EvaluationError(Exception):
    """Base of every error raised in ``handsight.evaluation``."""


class EvaluationSettingsError(EvaluationError, ValueError):
    """Settings out of range."""


class LabelIssuesError(EvaluationError, ValueError):
    """Attempts whose labels cannot be reviewed."""
