"""Methods by name: unknown names are all said at once."""

from __future__ import annotations

import pytest

from handsight.servoing.errors import UnknownMethodError
from handsight.servoing.methods.registry import METHODS, check_methods


def test_methods_are_checked_all_at_once() -> None:
    assert check_methods(["cem-1", "random", "cem-1"]) == ("cem-1", "random")
    with pytest.raises(UnknownMethodError) as caught:
        check_methods(["newton", "random", "luck"])
    for part in ("'luck'", "'newton'", *METHODS):
        assert part in str(caught.value)
    with pytest.raises(UnknownMethodError, match="no servo method given"):
        check_methods([])
