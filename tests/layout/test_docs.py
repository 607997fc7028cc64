"""What the documents say holds: links lead somewhere, quoted commands and targets exist. Run alone by `make docs`."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from handsight.cli.app import run

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = sorted(
    path for path in ROOT.rglob("*.md") if not any(part.startswith(".") for part in path.relative_to(ROOT).parts)
)

FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
INLINE_CODE = re.compile(r"`([^`\n]+)`")
LINK = re.compile(r"\[[^\]]*\]\(<?([^)>\s]+)[^)]*\)|(?:src|href)=\"([^\"]+)\"")
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)
SHELL_LANGUAGES = ("sh", "bash", "shell", "console")
SYNTAX_SIGNS = set("[]{}<>|…")
"""Inline code with one of these describes the form of a command and is not one."""


def prose(text: str) -> str:
    """A document without its fenced blocks and inline code, in which brackets are no links."""
    return INLINE_CODE.sub("", FENCE.sub("", text))


def anchors(path: Path) -> set[str]:
    """Anchors of a document's headings, made as GitHub makes them."""
    headings = HEADING.findall(FENCE.sub("", path.read_text()))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


def broken_links(document: Path) -> Iterator[str]:
    for match in LINK.finditer(prose(document.read_text())):
        target = match[1] or match[2]
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        path = (document.parent / name) if name else document
        if not path.exists():
            yield f"{document.relative_to(ROOT)}: {target} does not exist"
        elif anchor and path.suffix == ".md" and anchor not in anchors(path):
            yield f"{document.relative_to(ROOT)}: {target} names no heading"


def shell_lines(text: str) -> Iterator[str]:
    """Command lines of a document: those of its shell blocks, continuations joined, and its inline code."""
    for language, body in FENCE.findall(text):
        if language in SHELL_LANGUAGES:
            yield from (line.strip().removeprefix("$ ") for line in body.replace("\\\n", " ").splitlines())
    yield from (code for code in INLINE_CODE.findall(FENCE.sub("", text)) if not SYNTAX_SIGNS & set(code))


def quoted_commands(program: str) -> Iterator[tuple[str, list[str]]]:
    """Every quoted call of a program, with the document it is in, as its arguments without the program's name."""
    for document in DOCUMENTS:
        for line in shell_lines(document.read_text()):
            words = shlex.split(line, comments=True) if line.startswith(f"{program} ") else []
            if words:
                yield str(document.relative_to(ROOT)), words[1:]


def test_every_relative_link_leads_somewhere() -> None:
    assert [fault for document in DOCUMENTS for fault in broken_links(document)] == []


def test_every_quoted_command_parses(capsys: pytest.CaptureFixture[str]) -> None:
    # `--help` answers before values are converted, so that a placeholder may stand for a number or a folder, yet only
    # after the words were taken as commands, options and arguments that exist.
    calls = list(quoted_commands("handsight"))
    faults = []
    for document, words in calls:
        if run([*words, "--help"]) != 0:
            faults.append(f"{document}: handsight {shlex.join(words)}\n{capsys.readouterr().err}")
    assert faults == []
    assert any(document == "README.md" for document, _ in calls), "the README shows no call of handsight"


def test_every_quoted_target_is_in_the_makefile() -> None:
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    quoted = {(document, words[0]) for document, words in quoted_commands("make")}
    assert {(document, target) for document, target in quoted if target not in targets} == set()
    assert {("README.md", "demo"), ("README.md", "test")} <= quoted
