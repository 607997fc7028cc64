"""Errors of the evaluation room.

EvaluationError
├── UnknownMethodError (ValueError)        no servo method of that name
├── EvaluationSettingsError (ValueError)   settings out of range
└── SuspectsError (ValueError)             attempts whose labels cannot be reviewed
"""


class EvaluationError(Exception):
    """Base of every error raised in ``handsight.evaluation``."""


class UnknownMethodError(EvaluationError, ValueError):
    """No servo method has that name."""


class EvaluationSettingsError(EvaluationError, ValueError):
    """Settings out of range."""


class SuspectsError(EvaluationError, ValueError):
    """Attempts whose labels cannot be reviewed."""
