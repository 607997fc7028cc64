"""Errors of the collection room.

CollectionError
├── PhaseError (RuntimeError)            a phase of an attempt did not complete; recorded, the session goes on
│   ├── UnreachableError                 the commanded pose is outside the arm's reach
│   └── PhaseAbortedError                the station stopped the phase and says why
│       ├── DeviceFaultError             a device failed, for no fault of the grasp
│       └── SceneUnsettledError          the objects of a scene did not come to rest where they can be grasped
├── CollectionSettingsError (ValueError) how much or how to collect makes no sense
├── ObjectSetError (ValueError)          unknown object set, or one that cannot be used
│   └── MeshImportError                  meshes that cannot become an object set, all of them named
├── StationSettingsError (ValueError)    settings that describe no usable station
│   ├── RendererUnavailableError         the renderer asked for does not run on this machine
│   └── RigSettingsError                 a rig's file or calibration that describes no usable rig
├── DeviceError (RuntimeError)           a device of a rig does not do what it was asked for
│   ├── DeviceLostError                  it does not answer any more, or its data do not change
│   │   └── CameraLostError              the camera gives no usable picture, whatever was tried
│   ├── RobotStoppedError                the controller has stopped the arm
│   └── PoseRefusedError (ValueError)    a move that we do not ask any arm for
└── RigPausedError (RuntimeError)        a person has to look before the rig goes on
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


class DeviceFaultError(PhaseAbortedError):
    """A device of the station failed during the phase: that says nothing about where was grasped."""


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


class RigSettingsError(StationSettingsError):
    """A rig's file, or a calibration, that describes no usable rig; the message names every fault."""


class DeviceError(CollectionError, RuntimeError):
    """A device of a rig does not do what it was asked for."""


class DeviceLostError(DeviceError):
    """It does not answer in time, its connection is gone, or its data do not change any more."""


class CameraLostError(DeviceLostError):
    """The camera gives no usable picture, whatever was tried."""


class RobotStoppedError(DeviceError):
    """The controller has stopped the arm: protective, safeguard or emergency stop, or a fault."""


class PoseRefusedError(DeviceError, ValueError):
    """A pose or speed outside what the rig may be asked for; nothing was sent to the arm."""


class RigPausedError(CollectionError, RuntimeError):
    """The rig stands still until a person has looked; what was recorded is kept."""
