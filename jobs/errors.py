"""Errors of the jobs room.

JobsError
├── EngineError (RuntimeError)       workers cannot be started where they were asked for
└── WorkerDiedError (RuntimeError)   workers ended without an answer, again and again
"""

from __future__ import annotations


class JobsError(Exception):
    """Base of every error raised in ``handsight.jobs``."""


class EngineError(JobsError, RuntimeError):
    """Workers cannot be started where they were asked for, or not as equals of the process that asks."""


class WorkerDiedError(JobsError, RuntimeError):
    """Workers ended without an answer, again and again; one that does so once is replaced."""
