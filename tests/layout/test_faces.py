"""The room's public face."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import handsight.datasets as room
from handsight.datasets import errors

ROOT = Path(__file__).resolve().parents[2]


def test_exports_are_sorted_and_exist() -> None:
    constants = [name for name in room.__all__ if name.isupper()]
    assert room.__all__ == [*sorted(constants), *sorted(set(room.__all__) - set(constants))]
    assert all(hasattr(room, name) for name in room.__all__)


def test_the_drawn_tree_is_the_tree_of_errors() -> None:
    drawn = dict(re.findall(r"── (\w+) \((\w+)\)", errors.__doc__ or ""))
    actual = {
        name: kind.__mro__[2].__name__
        for name, kind in vars(errors).items()
        if isinstance(kind, type) and issubclass(kind, errors.DatasetError) and kind is not errors.DatasetError
    }
    assert drawn == actual
    assert set(actual) < set(room.__all__)


def test_the_folder_cannot_pass_for_another_package_called_datasets() -> None:
    program = f"import sys; sys.path.insert(0, {str(ROOT)!r}); import datasets"
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert answer.returncode == 1
    assert "ImportError: this folder was imported as 'datasets', expected 'handsight.datasets'" in answer.stderr
