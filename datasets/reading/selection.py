"""Which attempts are meant: by id, by a ``--where`` expression over the attempts table, or by a saved filter.

An expression is written as for ``DataFrame.query``: ``target == "cup" and width_final_m < 0.004 and not excluded``.
It may come from a script or another person, so it is checked before it is evaluated: columns, constants, comparisons,
arithmetic and the few methods listed here, nothing that reaches Python itself.
"""

from __future__ import annotations

import ast
import difflib
from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from handsight.datasets.errors import AttemptNotFoundError, WhereError

METHODS = ("between", "contains", "endswith", "isin", "isna", "lower", "notna", "startswith", "str", "upper")
"""What may follow a column and a dot, such as ``target.str.startswith("mug")``; ``abs()`` is the one function."""

_FUNCTIONS = ("abs",)
_LONGEST = 4096
_EVALUATION_FAILURES = (
    ArithmeticError,
    AttributeError,
    LookupError,
    NameError,
    NotImplementedError,
    RecursionError,
    SyntaxError,
    TypeError,
    ValueError,
)
"""What pandas raises for an expression that makes no sense for the values."""
_NODES = (
    ast.Expression,
    ast.BoolOp,
    ast.And,
    ast.Or,
    ast.UnaryOp,
    ast.Not,
    ast.Invert,
    ast.USub,
    ast.UAdd,
    ast.BinOp,
    ast.Add,
    ast.Sub,
    ast.Mult,
    ast.Div,
    ast.Mod,
    ast.BitAnd,
    ast.BitOr,
    ast.BitXor,
    ast.Compare,
    ast.Eq,
    ast.NotEq,
    ast.Lt,
    ast.LtE,
    ast.Gt,
    ast.GtE,
    ast.In,
    ast.NotIn,
    ast.Name,
    ast.Load,
    ast.Constant,
    ast.List,
    ast.Tuple,
    ast.Call,
    ast.Attribute,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection:
    """Some attempts of a version: those with the given ids, or those for which every expression holds."""

    ids: tuple[str, ...] = ()
    where: str = ""
    """An expression; empty for none."""
    filter: str = ""
    """Name of a saved filter; empty for none. With ``where``, both must hold."""

    def __post_init__(self) -> None:
        if bool(self.ids) == bool(self.where or self.filter):
            got = f"ids {', '.join(self.ids[:3]) or 'none'}, where {self.where!r}, filter {self.filter!r}"
            raise WhereError(f"the attempts are named by {got}: expected either ids or an expression or filter")

    def __str__(self) -> str:
        if self.ids:
            return ", ".join(self.ids[:3]) + (f" and {len(self.ids) - 3} more" if len(self.ids) > 3 else "")
        parts = [f"filter {self.filter}"] * bool(self.filter) + [self.where] * bool(self.where)
        return " and ".join(parts)


def select(table: pd.DataFrame, selection: Selection, filters: dict[str, str]) -> list[str]:
    """The ids of the attempts meant, each once, in the order of the table.

    Args:
        table: The attempts of a version.
        selection: What is wanted.
        filters: Expressions of the saved filters by name.

    Raises:
        AttemptNotFoundError: Some of the ids are not in the table; the message lists them.
        WhereError: An expression is not sound, or there is no such filter.
    """
    if selection.ids:
        missing = sorted(set(selection.ids) - set(table.index))
        if missing:
            raise AttemptNotFoundError(
                f"there is no attempt {', '.join(missing[:5])}{f' and {len(missing) - 5} more' * (len(missing) > 5)} "
                "in this version: see 'handsight dataset ls'"
            )
        return table.index[table.index.isin(selection.ids)].tolist()
    chosen = pd.Series(True, index=table.index)
    for where in expressions(selection.where, selection.filter, filters):
        chosen &= matches(table, where)
    return table.index[chosen].tolist()


def expressions(where: str, name: str, filters: dict[str, str]) -> list[str]:
    """The expressions that must all hold: that of the saved filter and the one given, where there are such.

    Raises:
        WhereError: There is no such filter.
    """
    if name and name not in filters:
        raise WhereError(
            f"there is no saved filter {name!r}{nearest(name, filters)} "
            f"(filters: {', '.join(sorted(filters)) or 'none'})"
        )
    return ([filters[name]] if name else []) + ([where] if where else [])


def matches(table: pd.DataFrame, where: str) -> pd.Series[bool]:
    """For each attempt whether the expression holds; false where it cannot be told for want of a value.

    Raises:
        WhereError: The expression is malformed, names an unknown column, reaches beyond the table or yields anything
            but truth values.
    """
    check_where(table, where)
    try:
        found = _plain(table).eval(where, engine="python", parser="pandas", local_dict={}, global_dict={})
    except _EVALUATION_FAILURES as error:
        raise WhereError(f"--where {where!r} cannot be evaluated: {error}; compare like with like") from error
    if isinstance(found, pd.Series) and found.dtype in (bool, "boolean"):
        return found.fillna(False).astype(bool)
    kind = found.dtype if isinstance(found, pd.Series) else type(found).__name__
    raise WhereError(f"--where {where!r} yields {kind}, expected true or false for each attempt: add a comparison")


def check_where(table: pd.DataFrame, where: str) -> None:
    """Refuse an expression before it is evaluated or stored; all faults show at once.

    Raises:
        WhereError: As for :func:`matches`, except for what only shows on the values.
    """
    if len(where) > _LONGEST:
        raise WhereError(f"--where has {len(where)} characters, expected at most {_LONGEST}")
    try:
        tree = ast.parse(where.strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        reason = error.msg if isinstance(error, SyntaxError) else str(error)
        raise WhereError(f"--where {where!r} is no expression: {reason}") from error
    columns = [str(table.index.name), *map(str, table.columns)]
    faults = dict.fromkeys(fault for node in _nodes(tree) for fault in _faults(node, columns, where))
    if faults:
        raise WhereError(f"--where {where!r} is refused: {'; '.join(faults)}")


def columns_in(where: str) -> list[str]:
    """The columns that an expression needs, each once; ``check_where`` has found it sound."""
    tree = ast.parse(where.strip(), mode="eval")
    return list(dict.fromkeys(node.id for node in _nodes(tree) if isinstance(node, ast.Name)))


def _nodes(tree: ast.Expression) -> list[ast.AST]:
    """All nodes but the names of functions that are called."""
    called = [node.func for node in ast.walk(tree) if isinstance(node, ast.Call)]
    return [node for node in ast.walk(tree) if not (isinstance(node, ast.Name) and node in called)]


def _faults(node: ast.AST, columns: Sequence[str], where: str) -> list[str]:
    if isinstance(node, ast.Call):
        called = node.func
        if isinstance(called, ast.Attribute) or (isinstance(called, ast.Name) and called.id in _FUNCTIONS):
            return []
        return [f"{ast.unparse(called)}() is no known function, expected abs() or a method of a column"]
    if isinstance(node, ast.Attribute):
        return [] if node.attr in METHODS else [f".{node.attr} is unknown, expected one of {', '.join(METHODS)}"]
    if isinstance(node, ast.Name):
        return [] if node.id in columns else [f"there is no column {node.id!r}{nearest(node.id, columns)}"]
    if isinstance(node, ast.BinOp) and any(_is_text(side) for side in (node.left, node.right)):
        return ["text cannot be calculated with"]
    if not isinstance(node, _NODES):
        text = ast.get_source_segment(where.strip(), node) if isinstance(node, ast.expr) else None
        return [f"{text or type(node).__name__} is not allowed, expected comparisons of columns"]
    return []


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str | bytes)


def nearest(name: str, known: Sequence[str] | dict[str, str]) -> str:
    """The end of a message about an unknown name: names like it or, where there are none, all that are known."""
    near = difflib.get_close_matches(name, known, n=3, cutoff=0.5)
    return f", did you mean {' or '.join(near)}?" if near else f", expected one of {', '.join(known)}"


def _plain(table: pd.DataFrame) -> pd.DataFrame:
    """The table in types that expressions can compare: the objects of a scene as one text, UTC without saying so."""
    plain = table.copy(deep=False)
    if "objects" in table:
        plain["objects"] = table["objects"].str.join(" ").astype("str")
    if "started" in table:
        plain["started"] = table["started"].dt.tz_localize(None)
    return plain
