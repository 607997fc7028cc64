"""Errors of the training room.

TrainingError
├── NetworkSettingsError (ValueError)   a network that cannot be built
├── PictureError (ValueError)           a picture of which a network can score no part
├── TrainerSettingsError (ValueError)   training settings out of range
├── TrainingDataError (ValueError)      a dataset from which nothing can be learnt
├── MissingExtraError (ImportError)     something is asked for that needs a package which is not installed
├── DivergedError (ArithmeticError)     training that ended in numbers that are none
├── HeldOutError (ValueError)           a run whose held-out attempts cannot be told
├── CheckpointError (ValueError)        a run folder that holds no usable checkpoint
├── SweepPlanError (ValueError)         a sweep that cannot be run, or not in this folder
└── SweepFolderError (ValueError)       a folder that holds no usable sweep
"""


class TrainingError(Exception):
    """Base of every error raised in ``handsight.training``."""


class NetworkSettingsError(TrainingError, ValueError):
    """A network that cannot be built."""


class PictureError(TrainingError, ValueError):
    """A picture of which a network can score no part."""


class TrainerSettingsError(TrainingError, ValueError):
    """Training settings out of range."""


class TrainingDataError(TrainingError, ValueError):
    """A dataset from which nothing can be learnt."""


class DivergedError(TrainingError, ArithmeticError):
    """Training ended in numbers that are none."""


class MissingExtraError(TrainingError, ImportError):
    """Something is asked for that needs a package which is not installed."""


class HeldOutError(TrainingError, ValueError):
    """A run whose held-out attempts cannot be told."""


class CheckpointError(TrainingError, ValueError):
    """A run folder that holds no usable checkpoint."""


class SweepPlanError(TrainingError, ValueError):
    """A sweep that cannot be run, or not in this folder."""


class SweepFolderError(TrainingError, ValueError):
    """A folder that holds no usable sweep."""
