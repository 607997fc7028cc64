"""Errors of the collection room.

CollectionError
├── PhaseError (RuntimeError)            a phase of an attempt did not complete; recorded, the session goes on
│   ├── UnreachableError                 the commanded pose is outside the arm's reach
│   └── PhaseAbortedError                the station stopped the phase and says why
│       └── SceneUnsettledError          the objects of a scene did not come to rest where they can be grasped
├── CollectionSettingsError (ValueError) how much or how to collect makes no sense
├── ObjectSetError (ValueError)          unknown object set, or one that cannot be used
│   └── MeshImportError                  meshes that cannot become an object set, all of them named
└── StationSettingsError (ValueError)    settings that describe no usable station
    └── RendererUnavailableError         the renderer asked for does not run on this machine
"""

from __future__ import annotations


class CollectionError(Exception):
    """Base of every error raised in ``handsight.collection``."""


class PhaseError(CollectionError, RuntimeError):
    """A phase of an attempt did not complete."""

    def __init__(self, phase: str, reason: str) -> None:
        super().__init__(f"{phase}: {reason}")
        self.phase = phase
        self.reason = reason


class UnreachableError(PhaseError):
    """The commanded pose is outside the arm's reach."""


class PhaseAbortedError(PhaseError):
    """The station stopped the phase and says why."""


class SceneUnsettledError(PhaseAbortedError):
    """The objects of a scene did not come to rest, or none did where it can be grasped: no fault of any method."""

    def __init__(self, reason: str) -> None:
        super().__init__("settle", reason)


class CollectionSettingsError(CollectionError, ValueError):
    """How much or how to collect makes no sense."""


class ObjectSetError(CollectionError, ValueError):
    """Unknown object set, or one that cannot be used."""


class MeshImportError(ObjectSetError):
    """Meshes that cannot become an object set; the message names every one of them and its fault."""


class StationSettingsError(CollectionError, ValueError):
    """Settings that describe no usable station."""


class RendererUnavailableError(StationSettingsError):
    """The renderer asked for does not run on this machine."""
