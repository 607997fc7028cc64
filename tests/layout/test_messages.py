"""What messages of all rooms have in common: a count agrees with its noun, and a hint can be pasted."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROOMS = sorted(path.name for path in (ROOT / "src" / "handsight").iterdir() if path.is_symlink())
FILES = sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))

NOUNS = (
    "attempts|branches|cells|channels|characters|chunks|columns|commits|conditions|decisions|demos|elites|epochs|"
    "episodes|examples|failures|files|findings|folds|frames|grasps|heatmaps|images|inputs|iterations|labels|lines|"
    "meshes|moves|objects|pictures|releases|rows|samples|scores|sessions|shakes|snapshots|steps|successes|trials|"
    "values|views|workers"
)
COUNT_AND_NOUN = re.compile(rf" (?!(?:has|have|holds|names|labels) )(?:[a-z]+ )?({NOUNS})\b(?! an?\b)")
BOUND = re.compile(r"(at most|more than|up to|expected|expected \S+ to) $")
"""A bound is no count of what is there; its number is known to be more than one."""


def texts(file: Path) -> Iterator[ast.JoinedStr]:
    return (node for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.JoinedStr))


def parts(text: ast.JoinedStr) -> Iterator[tuple[str, ast.FormattedValue, str]]:
    """Each value of a text, with the words before and behind it."""
    words = [one.value if isinstance(one, ast.Constant) else "" for one in text.values]
    for at, part in enumerate(text.values):
        if isinstance(part, ast.FormattedValue):
            before = str(words[at - 1]) if at else ""
            yield before, part, str(words[at + 1]) if at + 1 < len(words) else ""


def may_be_one(before: str, value: ast.FormattedValue, behind: str) -> bool:
    """Whether the text counts things by a number that may be one and a noun that is always in the plural."""
    if COUNT_AND_NOUN.match(behind) is None or BOUND.search(before):
        return False
    shown = ast.unparse(value.value)
    return "counted(" not in shown and not re.fullmatch(r"_?[A-Z_]+", shown.rpartition(".")[2]) and "join(" not in shown


OF_MANY = {
    "collection/sim/objects/meshes/glb.py": 2,  # more than a bound
    "datasets/curation/folds.py": 1,  # folds are two or more
    "datasets/reading/where_tree.py": 2,  # more than a bound, and more than one
    "datasets/store/repository.py": 1,  # more than one
    "servoing/methods/cem.py": 1,  # names of settings
    "training/run.py": 1,  # the same
    "viz/figures/dataset.py": 1,  # said only of more than one
    "viz/figures/rate_panels.py": 2,  # windows hold ten or more; said only of more than one session
    "viz/pixels.py": 1,  # a grid has more than one
}
"""Texts whose numbers are never one, by file."""


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(ROOT)))
def test_counts_agree_with_their_nouns(file: Path) -> None:
    found = {ast.unparse(text) for text in texts(file) for part in parts(text) if may_be_one(*part)}
    assert len(found) == OF_MANY.get(str(file.relative_to(ROOT)), 0), f"use counted: {found}"


def spoken(file: Path) -> Iterator[str]:
    """Every text of a module but its docstrings; in place of a value stands a letter."""
    tree = ast.parse(file.read_text())
    documents = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    within = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in ast.walk(tree):
        if id(node) in documents | within:
            continue
        if isinstance(node, ast.JoinedStr):
            yield "".join(str(one.value) if isinstance(one, ast.Constant) else "X" for one in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


HINT = re.compile(r"['\"`](handsight [a-z]+(?: [^'\"`]+)?)['\"`]")
GENERAL = re.compile(
    r"handsight (objects ls|demo|heatmap|servo|[a-z ]+ --help|dataset (decisions|filter|suspect)[^ ]*)"
)
"""Calls that are whole without the name of a dataset, and names of commands in a help text."""


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(ROOT)))
def test_a_hint_that_names_a_dataset_is_made_by_pasteable(file: Path) -> None:
    """A call within quotation marks is one to be pasted: it is complete, or ``pasteable`` completes and quotes it."""
    found = [call for text in spoken(file) for call in HINT.findall(text) if GENERAL.fullmatch(call) is None]
    assert found == []
