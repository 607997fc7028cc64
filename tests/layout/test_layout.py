"""The top-level folders, the links to them and the lists in pyproject.toml all name the same subpackages."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "src" / "handsight"
LINKS = sorted(path.name for path in PACKAGE.iterdir() if path.is_symlink())
PYPROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())
TARGETS = PYPROJECT["tool"]["hatch"]["build"]["targets"]


def test_nothing_but_links_and_the_root_module_lies_in_the_package_folder() -> None:
    real = {path.name for path in PACKAGE.iterdir() if not path.is_symlink()} - {"__pycache__"}
    assert real == {"__init__.py", "py.typed"}


@pytest.mark.parametrize("name", LINKS)
def test_a_link_leads_to_the_top_level_folder_of_its_name(name: str) -> None:
    # A relative target, or the link would break in every other checkout.
    assert (PACKAGE / name).readlink() == Path(f"../../{name}")
    assert (ROOT / name / "__init__.py").is_file()


def test_the_path_of_an_editable_install_adds_no_other_top_level_name() -> None:
    # `benchmarks` is there so that it can be run with the root off the import path.
    assert {path.name for path in (ROOT / "src").iterdir()} == {"handsight", "benchmarks"}
    assert (ROOT / "src" / "benchmarks").readlink() == Path("../benchmarks")


def test_the_datasets_folder_refuses_its_bare_name() -> None:
    # From the root, where it would stand in for the well-known package of that name.
    environment = os.environ | {"PYTHONSAFEPATH": ""}
    command = [sys.executable, "-c", "import datasets"]
    run = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode != 0
    assert "handsight.datasets" in run.stderr


@pytest.mark.parametrize("safe_path", ["", "1"], ids=["root on the path", "root off the path"])
def test_benchmarks_run_from_the_root(safe_path: str) -> None:
    # People type `python -m benchmarks`, which puts the root on the path; `make bench` keeps it off.
    environment = os.environ | {"PYTHONSAFEPATH": safe_path}
    command = [sys.executable, "-m", "benchmarks", "--help"]
    run = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


def test_the_wheel_maps_every_link_and_nothing_else() -> None:
    sources = dict(TARGETS["wheel"]["sources"])
    assert sources.pop("src/handsight") == "handsight"
    assert sources == {name: f"handsight/{name}" for name in LINKS}


@pytest.mark.parametrize("target", ["sdist", "wheel"])
def test_a_build_takes_every_folder_and_the_root_module(target: str) -> None:
    needed = {*LINKS, "src/handsight/__init__.py", "src/handsight/py.typed"}
    assert needed <= set(TARGETS[target]["only-include"])


def test_everything_the_builds_name_exists() -> None:
    named = {path for target in TARGETS.values() for path in target["only-include"]}
    assert [path for path in sorted(named) if not (ROOT / path).exists()] == []


def test_tests_and_benchmarks_stay_out_of_the_wheel() -> None:
    assert {"tests", "benchmarks"} <= set(TARGETS["sdist"]["only-include"])
    assert not {"tests", "benchmarks"} & set(TARGETS["wheel"]["only-include"])


def test_every_folder_has_its_place_in_the_one_way_order() -> None:
    contracts = {contract["id"]: contract for contract in PYPROJECT["tool"]["importlinter"]["contracts"]}
    layers = contracts["one-way"]["layers"]
    placed = [name.strip() for layer in layers for name in layer.split("|")]
    assert sorted(placed) == LINKS


def test_no_python_package_hides_among_the_folders_that_do_not_ship() -> None:
    known = {*LINKS, "benchmarks"}
    packages = {path.parent.name for path in ROOT.glob("*/__init__.py") if not path.parent.name.startswith(".")}
    assert packages <= known, "a new top-level package needs a link, and a place in pyproject.toml"


def test_the_tests_are_no_package() -> None:
    # With an __init__.py pytest would import them as `tests.…` from the root, and put the root on sys.path.
    assert list((ROOT / "tests").rglob("__init__.py")) == []
