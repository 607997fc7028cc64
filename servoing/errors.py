"""Errors of the servoing room.

ServoingError
├── CameraModelError (ValueError)      intrinsics or mount that describe no camera
├── ImageError (ValueError)            a picture of the wrong shape, type or content
├── ScoreError (ValueError)            scores of a network that are no success metrics
├── StepError (ValueError)             steps of the wrong shape or type
├── UnknownMethodError (ValueError)    no servo method of that name
└── ServoSettingsError (ValueError)    optimiser or loop settings out of range
"""


class ServoingError(Exception):
    """Base of every error raised in ``handsight.servoing``."""


class CameraModelError(ServoingError, ValueError):
    """Intrinsics or mount that describe no camera."""


class ImageError(ServoingError, ValueError):
    """A picture of the wrong shape, type or content."""


class ScoreError(ServoingError, ValueError):
    """Scores of a network that are no success metrics in [0, 1]."""


class StepError(ServoingError, ValueError):
    """Steps of the wrong shape or type."""


class UnknownMethodError(ServoingError, ValueError):
    """No servo method has that name."""


class ServoSettingsError(ServoingError, ValueError):
    """Optimiser or loop settings out of range."""
