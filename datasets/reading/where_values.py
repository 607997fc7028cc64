"""What a ``--where`` expression yields for a table; it has been checked, so every part is of a kind that fits.

Regular expressions are matched by RE2, whose time grows as the text does: Python's own engine takes exponential time
for some, and pandas falls back to it.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable
from functools import reduce
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from handsight.datasets.reading.where_kinds import as_time

_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.And: operator.and_,
    ast.Or: operator.or_,
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: operator.mod,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}


def value_of(node: ast.expr, table: pd.DataFrame) -> Any:
    """The value of a part: a Series with the index of the table, or a constant.

    Args:
        node: The part.
        table: The attempts, of plain types; the id is among the columns.

    Raises:
        ArithmeticError: A division by zero of constants, or a number too large for the column.
    """
    match node:
        case ast.BoolOp():
            return reduce(_OPERATORS[type(node.op)], (value_of(one, table) for one in node.values))
        case ast.UnaryOp(op=ast.Not() | ast.Invert()):
            return _negated(value_of(node.operand, table))
        case ast.UnaryOp():
            return _OPERATORS[type(node.op)](value_of(node.operand, table))
        case ast.BinOp():
            return _OPERATORS[type(node.op)](value_of(node.left, table), value_of(node.right, table))
        case ast.Compare():
            return _compared(node, table)
        case ast.Name():
            return table[node.id]
        case ast.Constant():
            return node.value
        case ast.List() | ast.Tuple():
            return [value_of(one, table) for one in node.elts]
        case ast.Call(func=ast.Name()):
            return abs(value_of(node.args[0], table))
        case ast.Call(func=ast.Attribute() as called):
            return _method(called, [value_of(one, table) for one in node.args], table)
    raise TypeError(f"{type(node).__name__} was to be refused")


def _negated(value: Any) -> Any:
    return ~value if isinstance(value, pd.Series) else not value


def _compared(node: ast.Compare, table: pd.DataFrame) -> Any:
    values = [value_of(one, table) for one in (node.left, *node.comparators)]
    pairs = zip(values, node.ops, values[1:], strict=False)
    return reduce(operator.and_, (_compare(left, op, right) for left, op, right in pairs))


def _compare(left: Any, op: ast.cmpop, right: Any) -> Any:
    if isinstance(right, list):
        found = left.isin(right) if isinstance(left, pd.Series) else left in right
        return found if isinstance(op, ast.In | ast.Eq) else _negated(found)
    return _OPERATORS[type(op)](_beside(left, right), _beside(right, left))


def _beside(value: Any, other: Any) -> Any:
    """A text next to times is a time, and 0 or 1 next to truth values is one of them."""
    if isinstance(other, pd.Series):
        if isinstance(value, str) and pd.api.types.is_datetime64_any_dtype(other.dtype):
            return as_time(value)
        if not isinstance(value, pd.Series) and pd.api.types.is_bool_dtype(other.dtype):
            return bool(value)
    return value


def _method(called: ast.Attribute, given: list[Any], table: pd.DataFrame) -> Any:
    name = called.attr
    if isinstance(called.value, ast.Attribute):
        texts = value_of(called.value.value, table)
        return _contains(texts, *given) if name == "contains" else getattr(texts.str, name)(*given)
    values = value_of(called.value, table)
    if name == "between":
        low, high = (_beside(bound, values) for bound in given)
        return (values >= low) & (values <= high)
    return getattr(values, name)(*given)


def _contains(texts: pd.Series[str], pattern: str) -> pd.Series[bool]:
    """Where a text holds what a pattern describes; not where the text is missing."""
    found = pc.match_substring_regex(pa.array(texts, from_pandas=True, type=pa.large_string()), pattern)
    return pd.Series(found.fill_null(False).to_numpy(zero_copy_only=False), index=texts.index)
