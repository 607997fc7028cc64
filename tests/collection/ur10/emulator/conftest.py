"""What tests of the emulated rig share: a rig whose time they let pass, on no network."""

from __future__ import annotations

import pytest
from tests.support.bare_rig import bare_rig

from handsight.collection.ur10.emulator.generation import CB3, E_SERIES
from handsight.collection.ur10.emulator.rig import EmulatedRig


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
