"""The text of a ``--where`` expression as a tree of Python's, bounded before anything is computed.

As for ``DataFrame.query``, ``&`` and ``|`` stand for ``and`` and ``or``, and bind as these do.
"""

from __future__ import annotations

import ast
import io
import tokenize
import warnings
from collections.abc import Iterator

from handsight.datasets.errors import WhereError

LONGEST = 4096
"""Characters of an expression."""
DEEPEST = 100
"""Operations inside one another; far below what Python's stack holds."""

_WORDS = {"&": " and ", "|": " or "}
_UNREADABLE = (SyntaxError, ValueError, RecursionError, MemoryError, tokenize.TokenError)
"""What Python raises for text that is none of its expressions."""


def where_tree(where: str) -> ast.expr:
    """Parse an expression, and refuse one that is too long, too deep, or more than one line.

    Raises:
        WhereError: The text is no expression, or breaks a bound.
    """
    text = where.strip()
    if len(text) > LONGEST:
        raise WhereError(f"--where has {len(text)} characters, expected at most {LONGEST}")
    if len(text.splitlines()) > 1:
        raise WhereError(f"--where {shown(where)!r} has {len(text.splitlines())} lines, expected one: join them")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # About escapes and comparisons of constants; nobody wrote a program here.
            tree = ast.parse(_with_words(text), mode="eval").body
    except _UNREADABLE as error:
        reason = error.msg if isinstance(error, SyntaxError) else str(error) or type(error).__name__
        raise WhereError(f"--where {shown(where)!r} is no expression: {reason}") from error
    if any(level > DEEPEST for level in _levels(tree)):
        raise WhereError(
            f"--where {shown(where)!r} nests more than {DEEPEST} deep: name the values in a list, 'in [..]'"
        )
    return tree


def columns_in(where: str) -> list[str]:
    """The columns that an expression needs, each once; it has been found sound."""
    tree = where_tree(where)
    called = [node.func for node in ast.walk(tree) if isinstance(node, ast.Call)]
    names = [node for node in ast.walk(tree) if isinstance(node, ast.Name) and node not in called]
    return list(dict.fromkeys(node.id for node in names))


def _with_words(text: str) -> str:
    """The text with ``&`` and ``|`` written out, where these are operators."""
    columns = [
        (token.start[1], _WORDS[token.string])
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
        if token.type == tokenize.OP and token.string in _WORDS
    ]
    for column, word in reversed(columns):
        text = text[:column] + word + text[column + 1 :]
    return text.strip()


def _levels(tree: ast.expr) -> Iterator[int]:
    """How deep each node lies; without recursion, as the tree may be deeper than the stack."""
    waiting: list[tuple[ast.AST, int]] = [(tree, 1)]
    while waiting:
        node, level = waiting.pop()
        yield level
        waiting += [(child, level + 1) for child in ast.iter_child_nodes(node)]


def shown(where: str) -> str:
    """An expression for a message, whose end may be left out."""
    return where if len(where) <= 200 else f"{where[:197]}..."
