"""Errors of the emulated rig.

EmulatorError (CollectionError, ValueError)   what was asked of the emulator makes no sense
└── FaultError                                no such fault, value or moment
"""

from __future__ import annotations

from handsight.collection.errors import CollectionError


class EmulatorError(CollectionError, ValueError):
    """What was asked of the emulator makes no sense."""


class FaultError(EmulatorError):
    """There is no such fault, or it has no such value or moment."""
