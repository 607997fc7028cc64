"""Commands that write are killed or interrupted at a change to the file system, and run again.

Nothing is lost and nothing is left. ``python -P tests/support/kills.py --kills 1000`` does so at more moments, and to
more commands, such as those that take seconds and have children.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from tests.support.kills import Bench

SEED = 11
KILLED = ("import hdf5", "import to new", "release", "branch --delete", "exclude", "repair", "migrate", "gc")
INTERRUPTED = (("import hdf5", 1), ("import to new", 3), ("merge", 3), ("repair", 3), ("gc", 1))


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """What kills and looks."""
    one = Bench(tmp_path_factory.mktemp("kills"))
    yield one
    one.close()


@pytest.mark.parametrize("command", KILLED)
def test_a_killed_command_loses_nothing_and_can_be_run_again(bench: Bench, command: str) -> None:
    outcome = bench.kill(command, SEED, KILLED.index(command))
    assert outcome.ok, outcome


@pytest.mark.parametrize(("command", "times"), INTERRUPTED, ids=[name for name, _ in INTERRUPTED])
def test_an_interrupted_command_says_in_one_line_what_is_kept(bench: Bench, command: str, times: int) -> None:
    """Exit status 130 and no traceback, however often Ctrl-C is pressed."""
    outcome = bench.kill(command, SEED, 0, interrupts=times)
    assert outcome.killed
    assert outcome.ok, outcome
