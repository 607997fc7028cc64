"""What a rig does by itself between two attempts; on emulated devices ``test_session.py`` has it too."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from handsight.collection.errors import RigPausedError
from handsight.collection.ur10.between import BetweenAttempts
from handsight.collection.ur10.rig import GuardConfig


def test_what_pauses_the_rig_is_among_the_readings() -> None:
    """Whoever comes to look finds in them what the joint had."""
    rig = cast("Any", SimpleNamespace(guards=GuardConfig()))
    arm = cast("Any", SimpleNamespace(state=lambda: SimpleNamespace(temperatures_c=(31.26, 71.0))))
    between = BetweenAttempts(rig, arm, cast("Any", None), cast("Any", None), data_folder=None)
    readings: dict[str, Any] = {}
    with pytest.raises(RigPausedError, match="joint 1 has 71 degrees"):
        between.guard(readings)
    assert readings == {"temperatures_c": [31.3, 71.0]}
