"""Datasets on disk for the tests of the room."""

from __future__ import annotations

from pathlib import Path

import pytest

from handsight.datasets import GraspRepository


@pytest.fixture
def repository(tmp_path: Path) -> GraspRepository:
    """An empty dataset."""
    return GraspRepository.create(tmp_path / "grasps")
