"""Which attempts are meant: by id, by a ``--where`` expression over the attempts table, or by a saved filter.

An expression is written as for ``DataFrame.query``: ``target == "cup" and width_final_m < 0.004 and not excluded``.
It may come from a script or another person, so it is checked before it is evaluated: columns, constants, comparisons of
like with like, arithmetic and a few methods, nothing that reaches Python itself.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass

import pandas as pd

from handsight.datasets.errors import AttemptNotFoundError, WhereError
from handsight.datasets.reading.where_kinds import kinds_of, nearest, where_faults
from handsight.datasets.reading.where_tree import shown, where_tree
from handsight.datasets.reading.where_values import value_of

_FAILURES = (ArithmeticError, TypeError, ValueError)
"""What the values can still refuse: a division of constants by zero, a number too large for its column."""


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
                "in this version, expected ids of its attempts table"
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
    plain = _plain(table)
    tree = _checked_tree(plain, where)
    try:
        found = value_of(tree, plain)
    except _FAILURES as error:
        raise WhereError(f"--where {shown(where)!r} cannot be evaluated: {error}; compare like with like") from error
    if isinstance(found, pd.Series) and found.dtype in (bool, "boolean"):
        return found.fillna(False).astype(bool)
    kind = found.dtype if isinstance(found, pd.Series) else type(found).__name__
    raise WhereError(
        f"--where {shown(where)!r} yields {kind}, expected true or false for each attempt: add a comparison"
    )


def check_where(table: pd.DataFrame, where: str) -> None:
    """Refuse an expression before it is evaluated or stored; all faults show at once.

    Raises:
        WhereError: As for :func:`matches`, except for what only shows on the values.
    """
    _checked_tree(_plain(table), where)


def _checked_tree(plain: pd.DataFrame, where: str) -> ast.expr:
    tree = where_tree(where)
    faults = where_faults(tree, kinds_of(plain))
    if faults:
        raise WhereError(f"--where {shown(where)!r} is refused: {'; '.join(faults)}")
    return tree


def _plain(table: pd.DataFrame) -> pd.DataFrame:
    """The table in types that expressions can compare: the objects of a scene as one text, UTC without saying so."""
    plain = table.copy(deep=False)
    plain[str(table.index.name)] = table.index
    if "objects" in table:
        plain["objects"] = table["objects"].str.join(" ").astype("str")
    if "started" in table:
        plain["started"] = table["started"].dt.tz_localize(None)
    return plain
