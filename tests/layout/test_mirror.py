"""The tests of a module are found by its name: ``tests/ROOM/test_MODULE.py`` tests ``ROOM/MODULE.py``."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TESTS = ROOT / "tests"

OF_NO_ROOM = ("layout", "support", "datasets/scenarios")
"""The repository as a whole, helpers, and runs that cross the rooms of datasets: kills, power cuts, other machines."""
OVER_MANY = "test_every_"
"""One suite over everything that is entered somewhere: methods, objects, collections."""
OF_THE_WHOLE_COMMAND = {
    "cli/dataset/test_in_a_bucket.py",
    "cli/test_command_line.py",
    "cli/test_completion.py",
    "cli/test_help.py",
    "cli/test_import_cost.py",
}
"""What a user types, from one noun to the next."""
FILES = sorted(path.relative_to(TESTS).as_posix() for path in TESTS.rglob("test_*.py"))
MIRRORS = [file for file in FILES if not file.startswith(tuple(f"{folder}/" for folder in OF_NO_ROOM))]


@pytest.mark.parametrize("file", MIRRORS)
def test_a_file_lies_where_its_module_lies(file: str) -> None:
    folder, name = (ROOT / file).parent, Path(file).stem.removeprefix("test_")
    assert (folder / "__init__.py").is_file(), f"{folder.relative_to(ROOT)} is no room"
    if file in OF_THE_WHOLE_COMMAND or Path(file).name.startswith(OVER_MANY):
        return
    assert (folder / f"{name}.py").is_file() or (folder / name / "__init__.py").is_file(), (
        f"tests/{file} tests no module of its name: expected {folder.relative_to(ROOT)}/{name}.py"
    )


def test_every_exception_is_still_one() -> None:
    assert set(FILES) >= OF_THE_WHOLE_COMMAND
    assert [folder for folder in OF_NO_ROOM if not (TESTS / folder).is_dir()] == []


def test_a_python_file_is_a_test_a_helper_or_a_fixture() -> None:
    """Anything else would be run by nobody."""
    others = {
        path.relative_to(TESTS).as_posix()
        for path in TESTS.rglob("*.py")
        if path.name != "conftest.py" and not path.name.startswith("test_") and path.parent != TESTS / "support"
    }
    assert others == {"datasets/scenarios/cut_ext4.py"}


def test_helpers_are_imported_from_one_place() -> None:
    """A test file imports no other test file, and no conftest."""
    imports = {
        line.split()[1]
        for path in TESTS.rglob("*.py")
        for line in path.read_text().splitlines()
        if line.startswith(("from tests", "import tests"))
    }
    helpers = {f"tests.support.{path.stem}" for path in (TESTS / "support").glob("*.py")}
    assert imports <= helpers
