"""What tests of the emulated rig share: a rig whose time they let pass, on no network."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from handsight.collection.ur10.emulator.generation import CB3, E_SERIES, Generation
from handsight.collection.ur10.emulator.rig import EmulatedRig, RigSettings
from handsight.collection.ur10.emulator.world import BareWorld

Pass = Callable[[float], None]


def bare_rig(generation: Generation) -> EmulatedRig:
    """No objects, nothing listens."""
    return EmulatedRig(RigSettings(robot="127.0.0.2", generation=generation), BareWorld())


@pytest.fixture(params=[CB3, E_SERIES], ids=lambda generation: str(generation.name))
def rig(request: pytest.FixtureRequest) -> EmulatedRig:
    """Of either generation."""
    return bare_rig(request.param)


@pytest.fixture
def e_series() -> EmulatedRig:
    return bare_rig(E_SERIES)


@pytest.fixture
def cb3() -> EmulatedRig:
    return bare_rig(CB3)


def let_pass(rig: EmulatedRig, seconds: float) -> None:
    """Let robot time pass."""
    for _ in range(round(seconds / rig.robot.period_s)):
        rig.tick(0.0)
