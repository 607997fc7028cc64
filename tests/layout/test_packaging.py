"""An editable install, the sdist and the wheel built from the sdist each hold every module and all package data."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import handsight

ROOT = Path(__file__).resolve().parents[2]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
FOLDERS = sorted(path.name for path in (ROOT / "src" / "handsight").iterdir() if path.is_symlink())
NEVER_SHIPPED = ("__pycache__", ".DS_Store")


def files_under(folder: str) -> set[str]:
    """Every file of a top-level folder, relative to the root, without what interpreters and desktops leave behind."""
    paths = (path for path in (ROOT / folder).rglob("*") if path.is_file())
    return {str(path.relative_to(ROOT)) for path in paths if not set(path.parts) & set(NEVER_SHIPPED)}


SHIPPED = {"__init__.py", "py.typed"}.union(*map(files_under, FOLDERS))
"""What the package holds, relative to ``handsight/``."""


def module_name(file: str) -> str:
    """``viz/figures.py`` is ``handsight.viz.figures.results``."""
    return ".".join(["handsight", *Path(file).with_suffix("").parts]).removesuffix(".__init__")


MODULES = sorted(module_name(file) for file in SHIPPED if file.endswith(".py"))


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the sdist, and the wheel from the sdist, with the installed hatchling and no network."""
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    environment = os.environ | {"PIP_NO_INDEX": "1"}
    run = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    return folder


@pytest.fixture(scope="module")
def wheel_files(dist: Path) -> set[str]:
    [wheel] = dist.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


def test_an_editable_install_finds_every_module() -> None:
    assert [name for name in MODULES if importlib.util.find_spec(name) is None] == []


def test_the_wheel_holds_the_package_and_nothing_else(wheel_files: set[str]) -> None:
    packaged = {name for name in wheel_files if ".dist-info/" not in name}
    assert packaged == {f"handsight/{file}" for file in SHIPPED}


def test_the_sdist_holds_the_package_the_tests_and_the_benchmarks(dist: Path) -> None:
    [sdist] = dist.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    needed = {"src/handsight/__init__.py", "src/handsight/py.typed", "pyproject.toml", "constraints.txt", "LICENSE"}
    needed = needed.union(*map(files_under, [*FOLDERS, "tests", "benchmarks"]))
    assert sorted(needed - names) == []


def test_the_wheel_carries_version_command_and_licence(dist: Path, wheel_files: set[str]) -> None:
    [wheel] = dist.glob("*.whl")
    [info] = {name.split("/")[0] for name in wheel_files if ".dist-info/" in name}
    with zipfile.ZipFile(wheel) as archive:
        metadata = Parser().parsestr(archive.read(f"{info}/METADATA").decode())
        commands = archive.read(f"{info}/entry_points.txt").decode()
    assert metadata["Version"] == handsight.__version__
    assert "handsight = handsight.cli.app:main" in commands
    assert f"{info}/licenses/LICENSE" in wheel_files


def locked() -> dict[str, str]:
    """Version of each package in constraints.txt, by canonical name."""
    lines = (line for line in (ROOT / "constraints.txt").read_text().splitlines() if line and not line.startswith("#"))
    pins = (line.partition(";")[0].split("==") for line in lines)
    return {canonicalize_name(name): version for name, version in pins}


def test_the_lock_satisfies_every_declared_dependency() -> None:
    project = PYPROJECT["project"]
    declared = [*project["dependencies"], *project["optional-dependencies"]["dev"]]
    pins = locked()
    faults = []
    for requirement in map(Requirement, declared):
        version = pins.get(canonicalize_name(requirement.name))
        if version is None or version not in requirement.specifier:
            faults.append(f"{requirement}: constraints.txt has {version}")
    assert faults == []


def test_the_lock_names_no_cuda_package() -> None:
    assert [name for name in locked() if name.startswith(("nvidia-", "cuda-", "triton"))] == []
