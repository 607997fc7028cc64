"""What a mistake gets: one line that says what to do, status 2, and nothing on the output."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from handsight.cli.app import run


def check_refused(capsys: pytest.CaptureFixture[str], words: Sequence[str], said: str) -> None:
    """Type the words, and find ``said`` in the one line that comes back."""
    capsys.readouterr()
    assert run(words) == 2
    captured = capsys.readouterr()
    (line,) = captured.err.splitlines()
    assert line.startswith("error: ")
    assert said in line
    assert captured.out == ""
