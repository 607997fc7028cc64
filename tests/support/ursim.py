"""Where UR's own simulator is, if somebody has it."""

from __future__ import annotations

import os

ADDRESSES = [address for address in os.environ.get("HANDSIGHT_URSIM", "").split(",") if address]
NO_URSIM = "HANDSIGHT_URSIM is not set: the address of UR's own simulator, a judge that comes with no package"
"""The reason for which a test is skipped without it; ``tests/conftest.py`` lets CI skip for it too, word by word."""
