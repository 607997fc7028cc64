"""Every room's public face: what it exports, the tree of its errors, and how little it loads."""

from __future__ import annotations

import ast
import builtins
import importlib
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import handsight.datasets as datasets_face
from handsight.cli.errors import EXPECTED

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "src" / "handsight"
ROOMS = sorted(path.name for path in PACKAGE.iterdir() if path.is_symlink())
FACES = sorted(
    ".".join(("handsight", *folder.relative_to(ROOT).parts))
    for room in ROOMS
    for folder in (ROOT / room, *(ROOT / room).rglob("*"))
    if (folder / "__init__.py").is_file()
)
ERRORS = [f"handsight.{room}.errors" for room in ROOMS]
TREES = [name for name in ERRORS if name != "handsight.cli.errors"]
"""The command line has no tree: it says which errors of the others are the user's."""

ENGINES = {"torch", "icechunk", "zarr", "pandas", "pybullet", "rerun", "ray", "matplotlib", "cv2", "typer"}
MOST_MODULES_OF_ERRORS = 55
"""Beyond those of a bare interpreter, which has 65: at most 120 together. Today cli needs 27, every other room 14."""


def loaded(statement: str) -> set[str]:
    """Modules of a fresh interpreter after the statement. It is not measured for coverage, which loads modules too."""
    program = f"{statement}\nimport sys\nprint(*sys.modules)"
    environment = {name: value for name, value in os.environ.items() if not name.startswith("COVERAGE_")}
    command = [sys.executable, "-P", "-c", program]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return set(run.stdout.split())


@pytest.mark.parametrize("name", [*FACES, *ERRORS])
def test_a_face_imports_no_engine(name: str) -> None:
    assert loaded(f"import {name}") & ENGINES == set()


@pytest.mark.parametrize("name", ERRORS)
def test_errors_are_imported_at_next_to_no_cost(name: str) -> None:
    assert len(loaded(f"import {name}") - loaded("pass")) <= MOST_MODULES_OF_ERRORS


@pytest.mark.parametrize("name", FACES)
def test_exports_are_sorted_and_exist(name: str) -> None:
    face = importlib.import_module(name)
    exported: list[str] = getattr(face, "__all__", [])
    constants = sorted(one for one in exported if one.isupper())
    assert exported == [*constants, *sorted(set(exported) - set(constants))]
    assert [one for one in exported if not hasattr(face, one)] == []


def drawn_tree(module: ModuleType) -> dict[str, tuple[str, str | None]]:
    """Parent and builtin of every error as the docstring draws them: ``├── Name (Builtin)   what it is``."""
    lines = inspect.cleandoc(module.__doc__ or "").splitlines()
    first = next(at for at, line in enumerate(lines) if "──" in line)
    above, tree = [lines[first - 1]], {}
    for line in lines[first:]:
        drawn = re.fullmatch(r"((?:│   |    )*)[├└]── (\w+)(?: \((\w+)\))? +\S.*", line)
        assert drawn is not None, f"{module.__name__} draws {line!r}"
        depth = len(drawn[1]) // 4
        tree[drawn[2]] = (above[depth], drawn[3])
        above[depth + 1 :] = [drawn[2]]
    return tree


def actual_tree(module: ModuleType) -> dict[str, tuple[str, str | None]]:
    """Parent and builtin of every error as it is defined."""
    kinds = {name: kind for name, kind in vars(module).items() if isinstance(kind, type)}
    tree = {}
    for name, kind in kinds.items():
        parent, *others = kind.__bases__
        assert all(vars(builtins).get(other.__name__) is other for other in others), f"{name} has {kind.__bases__}"
        if parent is not Exception:
            tree[name] = (parent.__name__, ", ".join(other.__name__ for other in others) or None)
    return tree


@pytest.mark.parametrize("name", TREES)
def test_the_drawn_tree_is_the_tree_of_errors(name: str) -> None:
    module = importlib.import_module(name)
    assert drawn_tree(module) == actual_tree(module)
    assert list(drawn_tree(module)), "a room without errors has no errors.py"


@pytest.mark.parametrize("name", TREES)
def test_an_error_is_one_of_its_room_and_one_of_the_language(name: str) -> None:
    """What people catch: everything of a room by its base, or a kind that they know without handsight."""
    module = importlib.import_module(name)
    kinds = [kind for kind in vars(module).values() if isinstance(kind, type)]
    (base,) = [kind for kind in kinds if kind.__bases__ == (Exception,)]
    assert base.__doc__ == f"Base of every error raised in ``{name.removesuffix('.errors')}``."
    assert base in EXPECTED
    for kind in kinds:
        assert issubclass(kind, base)
        familiar = [one for one in kind.__mro__ if one.__module__ == "builtins"]
        assert kind is base or familiar[0] not in (Exception, BaseException)


def homes_by_module() -> dict[str, str]:
    """Where each exported name of datasets comes from, as the table of lazy imports says."""
    return {name: module for module, names in datasets_face._NAMES.items() for name in names}


def homes_for_type_checkers() -> dict[str, str]:
    """The same, as the imports for type checkers say."""
    tree = ast.parse((ROOT / "datasets" / "__init__.py").read_text())
    (block,) = [node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"]
    homes = {}
    for statement in block.body:
        assert isinstance(statement, ast.ImportFrom)
        assert statement.module is not None
        for alias in statement.names:
            # `import X as X` is what tells a type checker that a name is meant for others.
            assert alias.asname == alias.name
            homes[alias.name] = statement.module.removeprefix("handsight.datasets.")
    return homes


def test_the_three_lists_of_datasets_agree() -> None:
    assert homes_by_module() == homes_for_type_checkers()
    assert sum(map(len, datasets_face._NAMES.values())) == len(homes_by_module()), "a name has two homes"
    assert set(homes_by_module()) == set(datasets_face.__all__)
    assert len(set(datasets_face.__all__)) == len(datasets_face.__all__)


def test_every_error_of_datasets_is_exported() -> None:
    tree = actual_tree(importlib.import_module("handsight.datasets.errors"))
    assert {"DatasetError", *tree} <= set(datasets_face.__all__)


@pytest.mark.parametrize("name", datasets_face.__all__)
def test_a_name_of_datasets_is_that_of_its_module(name: str) -> None:
    given: dict[str, object] = {}
    exec(f"from handsight.datasets import {name}", given)
    home = importlib.import_module(f"handsight.datasets.{homes_by_module()[name]}")
    assert given[name] is getattr(home, name)


def test_names_of_datasets_come_when_they_are_used() -> None:
    program = (
        "import handsight.datasets as face\n"
        "print('PHASES' in vars(face), set(face.__all__) <= set(dir(face)))\n"
        "face.PHASES\n"
        "print('PHASES' in vars(face), set(face.__all__) <= set(dir(face)))\n"
    )
    answer = subprocess.run([sys.executable, "-P", "-c", program], capture_output=True, text=True, check=True)
    assert answer.stdout.splitlines() == ["False True", "True True"]
    assert "icechunk" not in loaded("from handsight.datasets import DatasetAddress, DatasetError")
    assert "icechunk" in loaded("from handsight.datasets import GraspRepository")


def test_a_name_that_datasets_has_not_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"module 'handsight\.datasets' has no attribute 'GraspDataSet'"):
        _ = datasets_face.GraspDataSet
    with pytest.raises(ImportError, match="cannot import name 'GraspDataSet'"):
        exec("from handsight.datasets import GraspDataSet")


def test_the_folder_cannot_pass_for_another_package_called_datasets() -> None:
    program = f"import sys; sys.path.insert(0, {str(ROOT)!r}); import datasets"
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert answer.returncode == 1
    assert "ImportError: this folder was imported as 'datasets', expected 'handsight.datasets'" in answer.stderr
