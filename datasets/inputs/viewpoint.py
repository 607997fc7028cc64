"""Which picture network inputs are made of unless another is named; told without importing an array library."""

from __future__ import annotations

from typing import Final

DEFAULT_VIEWPOINT: Final = "overhead"
"""The picture that every collection has: of the pre-grasp view there is one only where it was asked for."""
