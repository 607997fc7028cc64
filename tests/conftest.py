"""What every test relies on: an import path without the repository's root, settings for CI, no silent skips there."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Generator
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from hypothesis import settings

ROOT = Path(__file__).resolve().parents[1]
IN_CI = os.environ.get("CI", "").lower() in ("1", "true")

# A thread of torch's for each process of tests: pools as large as the machine in each of them wait for each other. Set
# before anything loads torch; programs that tests start inherit it.
os.environ.setdefault("OMP_NUM_THREADS", "1")

NO_URSIM = "HANDSIGHT_URSIM is not set: the address of UR's own simulator, a judge that comes with no package"
"""The one reason for which CI skips too, and prints: nothing that it could install would change it; see
``tests/support/ursim.py``."""

# Deadlines measure the machine, not the code. CI draws the same examples every time, so that a red run can be repeated.
settings.register_profile("local", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if IN_CI else "local")


def pytest_configure() -> None:
    """Refuse to run with the repository's root on the import path, where ``datasets`` would be the wrong package."""
    if any(Path(entry).resolve() == ROOT for entry in sys.path):
        raise pytest.UsageError(
            f"the repository's root ({ROOT}) is on sys.path, where its folders shadow other packages; "
            "run `make test` or plain `pytest`, or set PYTHONSAFEPATH=1 for `python -m pytest`"
        )
    # Interpreters that tests start inherit the same protection.
    os.environ["PYTHONSAFEPATH"] = "1"


class _OwnThreads:
    """Hands a thread over to coverage once it runs, but for those of Zarr's event loop, which run next to none of ours.

    They call a million functions, and to trace them is a seventh of what tests on datasets take. Coverage has no
    setting for it.
    """

    def __init__(self, begin: Any) -> None:
        self._begin = begin

    def __call__(self, frame: FrameType, event: str, argument: object) -> Any:
        if threading.current_thread().name.startswith(("zarr_io", "asyncio_")):
            sys.settrace(None)
            return None
        return self._begin(frame, event, argument)


def pytest_runtest_setup() -> None:
    """Where coverage is measured, see to threads; it begins anew after each test that is marked ``no_cover``."""
    begin = threading.gettrace()
    if begin is not None and not isinstance(begin, _OwnThreads):
        threading.settrace(_OwnThreads(begin))


def _skip_is_failure(report: pytest.CollectReport | pytest.TestReport) -> None:
    """Turn a skip into a failure that gives the skip's reason. An expected failure is not a skip."""
    if not report.skipped or hasattr(report, "wasxfail"):
        return
    reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
    if reason == f"Skipped: {NO_URSIM}":
        return
    report.outcome = "failed"
    report.longrepr = f"in CI nothing may be skipped. {reason}"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Fail a test that skips itself in CI, where everything it could need has been installed."""
    report = yield
    if IN_CI:
        _skip_is_failure(report)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Fail a whole file that skips itself in CI."""
    report = yield
    if IN_CI:
        _skip_is_failure(report)
    return report
