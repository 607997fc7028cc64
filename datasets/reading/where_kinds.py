"""What each part of a ``--where`` expression is: a number, a text, a time, or true or false.

Like is compared with like. ``success == 'True'`` would hold for no attempt, and nobody would see why, so it is refused
with what the column holds and how to write it. So is whatever reaches beyond the table, and a regular expression whose
time grows faster than the text (references back, looking around), which the engine for patterns does not know.
"""

from __future__ import annotations

import ast
import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from handsight.datasets.errors import counted

Kind = Literal["number", "text", "time", "truth"]

METHODS = ("between", "contains", "endswith", "isin", "isna", "lower", "notna", "startswith", "str", "upper")
"""What may follow a column and a dot, such as ``target.str.startswith("mug")``; ``abs()`` is the one function."""
TEXT_TESTS = ("contains", "endswith", "startswith")
TEXT_CHANGES = ("lower", "upper")
ARITHMETIC = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Mod)
ORDERS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE)

_HOLDS: dict[Kind, str] = {"number": "numbers", "text": "text", "time": "times", "truth": "truth values"}
_EXAMPLES: dict[Kind, str] = {
    "number": "{0} > 0.01",
    "text": "{0} == 'cup'",
    "time": "{0} > '2026-01-31'",
    "truth": "{0}, or not {0}",
}


def kinds_of(table: pd.DataFrame) -> dict[str, Kind]:
    """What each column of a table holds."""
    return {str(name): _kind_of(dtype) for name, dtype in table.dtypes.items()}


def _kind_of(dtype: object) -> Kind:
    if pd.api.types.is_bool_dtype(dtype):  # type: ignore[arg-type]  # Whatever pandas has for a dtype.
        return "truth"
    if pd.api.types.is_numeric_dtype(dtype):  # type: ignore[arg-type]
        return "number"
    return "time" if pd.api.types.is_datetime64_any_dtype(dtype) else "text"  # type: ignore[arg-type]


def where_faults(tree: ast.expr, kinds: Mapping[str, Kind]) -> list[str]:
    """Everything wrong with an expression over columns of these kinds, each fault once."""
    checked = _Checked(kinds=kinds)
    checked.kind(tree)
    return list(dict.fromkeys(checked.faults))


def nearest(name: str, known: Sequence[str] | Mapping[str, object]) -> str:
    """The end of a message about an unknown name: names like it or, where there are none, all that are known."""
    near = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
    return f", did you mean {' or '.join(near)}?" if near else f", expected one of {', '.join(known)}"


@dataclass(kw_only=True)
class _Checked:
    """One walk over a tree. A part with a fault has no kind, and what stands around it is not blamed for it."""

    kinds: Mapping[str, Kind]
    faults: list[str] = field(default_factory=list)

    def kind(self, node: ast.expr) -> Kind | None:
        """The kind of a part, once its own parts have been looked at."""
        match node:
            case ast.BoolOp():
                return self._truths(node.values)
            case ast.UnaryOp(op=ast.Not() | ast.Invert()):
                return self._truths([node.operand])
            case ast.UnaryOp():
                return self._numbers([node.operand])
            case ast.BinOp():
                return self._arithmetic(node)
            case ast.Compare():
                return self._comparison(node)
            case ast.Name():
                return self._column(node)
            case ast.Constant():
                return self._constant(node)
            case ast.Call():
                return self._call(node)
            case ast.Attribute():
                self.kind(node.value)
                return self._refuse(
                    f"{_text(node)} is no value" if node.attr in METHODS else _unknown_method(node.attr)
                )
            case ast.List() | ast.Tuple():
                return self._refuse(f"the list {_text(node)} stands alone, expected 'COLUMN in {_text(node)}'")
        return self._refuse(f"{_text(node)} is not allowed, expected comparisons of columns")

    def _refuse(self, fault: str) -> Kind | None:
        """Note a fault; the part that has it is of no kind."""
        self.faults.append(fault)
        return None

    def _column(self, node: ast.Name) -> Kind | None:
        if node.id not in self.kinds:
            return self._refuse(f"there is no column {node.id!r}{nearest(node.id, self.kinds)}")
        return self.kinds[node.id]

    def _constant(self, node: ast.Constant) -> Kind | None:
        match node.value:
            case bool():
                return "truth"
            case int() | float():
                return "number"
            case str():
                return "text"
        return self._refuse(f"{_text(node)} is no number, text or truth value; what is missing is found with .isna()")

    def _truths(self, nodes: Sequence[ast.expr]) -> Kind:
        for node in nodes:
            kind = self.kind(node)
            if kind not in ("truth", None):
                self._refuse(f"{_text(node)} {_is(node, kind)}, expected what is true or false: add a comparison")
        return "truth"

    def _numbers(self, nodes: Sequence[ast.expr]) -> Kind:
        for node in nodes:
            if isinstance(node, ast.List | ast.Tuple):
                self._refuse(f"the list {_text(node)} cannot be calculated with")
                continue
            kind = self.kind(node)
            if kind not in ("number", None):
                name = "text" if kind == "text" else _text(node)
                self._refuse(f"{name} cannot be calculated with, expected numbers")
        return "number"

    def _arithmetic(self, node: ast.BinOp) -> Kind | None:
        if not isinstance(node.op, ARITHMETIC):
            return self._refuse(f"{type(node.op).__name__} is not allowed, expected comparisons of columns")
        return self._numbers([node.left, node.right])

    def _comparison(self, node: ast.Compare) -> Kind:
        sides = [node.left, *node.comparators]
        for left, op, right in zip(sides, node.ops, sides[1:], strict=False):
            if isinstance(op, ast.Is | ast.IsNot):
                self._refuse("'is' is not allowed, expected == or .isna()")
            elif isinstance(right, ast.List | ast.Tuple):
                self._among(left, op, right)
            elif isinstance(op, ast.In | ast.NotIn):
                self.kind(left)
                self._refuse(f"{_text(right)} is no list, expected such as in ['cup', 'mug']")
            else:
                self._alike(left, right, ordered=isinstance(op, ORDERS))
        return "truth"

    def _among(self, left: ast.expr, op: ast.cmpop, right: ast.List | ast.Tuple) -> None:
        if isinstance(op, ORDERS):
            self._refuse(f"the list {_text(right)} has no order, expected 'in'")
        self._listed(left, right)

    def _listed(self, left: ast.expr, right: ast.List | ast.Tuple) -> None:
        """The values of a list, which have to be constants of the kind of what is looked for among them."""
        kind = self.kind(left)
        if kind == "time":
            self._refuse(f"{_text(left)} holds times, expected a comparison such as {_example(left, kind)}")
            return
        for value in right.elts:
            unsigned = value.operand if isinstance(value, ast.UnaryOp) else value
            if not isinstance(unsigned, ast.Constant):
                self._refuse(f"{_text(value)} stands in a list, expected constants")
            else:
                self._like(left, kind, value, self.kind(value))

    def _alike(self, left: ast.expr, right: ast.expr, *, ordered: bool) -> None:
        kinds = self.kind(left), self.kind(right)
        if ordered and kinds == ("truth", "truth"):
            self._refuse(f"{_text(left)} is true or false and has no order, expected == or !=")
        # What is constant is held against what is not.
        if isinstance(left, ast.Constant):
            self._like(right, kinds[1], left, kinds[0])
        else:
            self._like(left, kinds[0], right, kinds[1])

    def _like(self, one: ast.expr, kind: Kind | None, other: ast.expr, found: Kind | None) -> None:
        """Refuse to compare two kinds, but for dates as text, and 0 and 1 for false and true."""
        if kind is None or found is None or kind == found != "time":
            return
        if {kind, found} == {"time"}:
            return
        if kind == "time" and isinstance(other, ast.Constant) and found == "text":
            if as_time(other.value) is None:
                self._refuse(f"{_text(other)} is no date, expected {_example(one, kind)}")
            return
        if kind == "truth" and isinstance(other, ast.Constant) and other.value in (0, 1):
            return
        self._refuse(
            f"{_text(one)} {_is(one, kind)} and {_text(other)} {_is(other, found)}, expected {_example(one, kind)}"
        )

    def _call(self, node: ast.Call) -> Kind | None:
        called = node.func
        if node.keywords:
            self._refuse(f"{node.keywords[0].arg}= is not allowed in {_text(node)}")
        if isinstance(called, ast.Name) and called.id == "abs":
            self._count(node, 1)
            return self._numbers(node.args)
        if not isinstance(called, ast.Name | ast.Attribute):
            return self._refuse(
                f"{_text(called)} cannot be called, expected abs() or a method of a column: is 'and' or 'or' missing?"
            )
        if isinstance(called, ast.Name):
            return self._refuse(f"{_text(called)}() is no known function, expected abs() or a method of a column")
        if called.attr not in METHODS or called.attr == "str":
            self.kind(called.value)
            return self._refuse(_unknown_method(called.attr))
        if called.attr in (*TEXT_TESTS, *TEXT_CHANGES):
            return self._text_method(node, called)
        return self._column_method(node, called)

    def _column_method(self, node: ast.Call, called: ast.Attribute) -> Kind | None:
        if isinstance(called.value, ast.Constant | ast.List | ast.Tuple):
            return self._refuse(f"{_text(called.value)} is no column, expected COLUMN.{called.attr}()")
        if called.attr == "between":
            self._count(node, 2)
            for bound in node.args:
                self._alike(called.value, bound, ordered=True)
        elif called.attr == "isin":
            self._count(node, 1)
            for values in node.args[:1]:
                if isinstance(values, ast.List | ast.Tuple):
                    self._listed(called.value, values)
                else:
                    self._refuse(f"{_text(values)} is no list, expected such as ['cup', 'mug']")
        else:
            self._count(node, 0)
            self.kind(called.value)
        return "truth"

    def _text_method(self, node: ast.Call, called: ast.Attribute) -> Kind | None:
        column = called.value.value if isinstance(called.value, ast.Attribute) else None
        if column is None or called.value.attr != "str":  # type: ignore[attr-defined]  # It is an attribute.
            return self._refuse(f"{_text(called)} lacks the str, expected COLUMN.str.{called.attr}()")
        kind = self.kind(column)
        if kind not in ("text", None):
            self._refuse(f"{_text(column)} holds {_HOLDS[kind]}, and .str is for text")
        if isinstance(column, ast.Constant):
            self._refuse(f"{_text(column)} is no column, expected COLUMN.str.{called.attr}()")
        if called.attr in TEXT_CHANGES:
            self._count(node, 0)
            return "text"
        self._count(node, 1)
        for given in node.args[:1]:
            if not (isinstance(given, ast.Constant) and isinstance(given.value, str)):
                self._refuse(f"{_text(given)} is no text, expected such as {called.attr}('cup')")
            elif called.attr == "contains":
                self.faults += pattern_faults(given.value)
        return "truth"

    def _count(self, node: ast.Call, expected: int) -> None:
        if len(node.args) != expected:
            self._refuse(f"{_text(node)} has {counted(len(node.args), 'value')} in brackets, expected {expected}")


def as_time(text: object) -> pd.Timestamp | None:
    """A date or time in UTC, without saying so; None for any other text."""
    try:
        time: Any = pd.Timestamp(text)  # type: ignore[arg-type]  # What is no text is refused.
    except (TypeError, ValueError, OverflowError):
        return None
    if time is pd.NaT:
        return None
    found: pd.Timestamp = time if time.tzinfo is None else time.tz_convert("UTC").tz_localize(None)
    return found


def pattern_faults(pattern: str) -> list[str]:
    """Why RE2, whose time grows as the text does, cannot look for a pattern: none where it can."""
    try:
        pc.match_substring_regex(pa.array([""]), pattern)
    except (pa.ArrowException, UnicodeEncodeError) as error:
        reason = str(error).splitlines()[0].removeprefix("Invalid regular expression: ")
        return [
            f"{pattern!r} is no pattern that can be looked for ({reason}): patterns are those of RE2, without "
            "references back and without looking around; a backslash takes the meaning from '(' or '.'"
        ]
    return []


def _unknown_method(name: str) -> str:
    return f".{name} is unknown, expected one of {', '.join(METHODS)}"


def _is(node: ast.expr, kind: Kind) -> str:
    """What a part is, or a column holds."""
    if isinstance(node, ast.Name):
        return f"holds {_HOLDS[kind]}"
    return {"number": "is a number", "text": "is text", "time": "is a time", "truth": "is true or false"}[kind]


def _example(node: ast.expr, kind: Kind) -> str:
    return _EXAMPLES[kind].format(_text(node) if isinstance(node, ast.Name) else "COLUMN")


def _text(node: ast.AST) -> str:
    """As it may have been written; the tree is bounded, so this is too."""
    text = ast.unparse(node)
    return text if len(text) <= 60 else f"{text[:57]}..."
