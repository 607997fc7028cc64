"""In CI a skip is a failure; elsewhere it stays a skip. Shown on real pytest runs that use this suite's conftest."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from tests.support.ursim import NO_URSIM

TESTS = Path(__file__).parents[1]

SKIPPED_BY_MARK = "import pytest\n@pytest.mark.skip(reason='no such device')\ndef test_it(): pass\n"
SKIPPED_WHEN_RUN = "import pytest\ndef test_it(): pytest.skip('no such device')\n"
SKIPPED_FILE = "import pytest\npytest.skip('no such device', allow_module_level=True)\n"
EXPECTED_FAILURE = "import pytest\n@pytest.mark.xfail(reason='known')\ndef test_it(): raise ValueError\n"


def run_pytest(folder: Path, source: str, *, ci: str, processes: int = 0) -> subprocess.CompletedProcess[str]:
    shutil.copy(TESTS / "conftest.py", folder)
    (folder / "test_case.py").write_text(source)
    command = [sys.executable, "-m", "pytest", "--import-mode=importlib", "-p", "no:cacheprovider", "-rs", str(folder)]
    command += ["--numprocesses", str(processes)]
    environment = os.environ | {"CI": ci, "PYTHONSAFEPATH": "1"}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("source", [SKIPPED_BY_MARK, SKIPPED_WHEN_RUN, SKIPPED_FILE], ids=["mark", "call", "file"])
def test_a_skip_fails_in_ci_and_gives_its_reason(tmp_path: Path, source: str) -> None:
    run = run_pytest(tmp_path, source, ci="true")
    assert run.returncode not in (0, 5), run.stdout
    assert "nothing may be skipped" in run.stdout
    assert "no such device" in run.stdout


def test_what_no_ci_can_install_is_skipped_and_told(tmp_path: Path) -> None:
    run = run_pytest(tmp_path, f"import pytest\ndef test_it(): pytest.skip({NO_URSIM!r})\n", ci="true")
    assert run.returncode == 0, run.stdout
    assert "1 skipped" in run.stdout
    assert NO_URSIM in run.stdout
    run = run_pytest(tmp_path, f"import pytest\ndef test_it(): pytest.skip({NO_URSIM[:20]!r})\n", ci="true")
    assert run.returncode == pytest.ExitCode.TESTS_FAILED, run.stdout


def test_a_skip_fails_on_several_processes_too(tmp_path: Path) -> None:
    run = run_pytest(tmp_path, SKIPPED_WHEN_RUN, ci="true", processes=2)
    assert run.returncode == pytest.ExitCode.TESTS_FAILED, run.stdout
    assert "nothing may be skipped" in run.stdout
    assert "no such device" in run.stdout
    assert "1 failed in" in run.stdout.splitlines()[-1]


def test_a_skip_is_only_a_skip_elsewhere(tmp_path: Path) -> None:
    run = run_pytest(tmp_path, SKIPPED_WHEN_RUN, ci="")
    assert run.returncode == 0, run.stdout
    assert "1 skipped" in run.stdout


def test_an_expected_failure_is_no_skip(tmp_path: Path) -> None:
    run = run_pytest(tmp_path, EXPECTED_FAILURE, ci="true")
    assert run.returncode == 0, run.stdout
    assert "1 xfailed" in run.stdout


def test_the_root_on_the_import_path_is_refused() -> None:
    root = TESTS.parent
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "tests/layout/test_ci_skips.py"]
    run = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == pytest.ExitCode.USAGE_ERROR
    assert "make test" in run.stderr
