"""The text of expressions: its bounds, and how it binds."""

from __future__ import annotations

import ast

import pytest

from handsight.datasets import WhereError
from handsight.datasets.reading.where_tree import DEEPEST, LONGEST, columns_in, where_tree


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ("number > 1\nand success", "has 2 lines, expected one"),
        ("target == '\n'", "has 2 lines"),
        ("number == (1,\n2)", "has 2 lines"),
        ("(" * 1500 + "number" + ")" * 1500, "is no expression"),
        ("not " * 900 + "success", "is no expression|nests more than"),
        ("-" * 4000 + "1 == number", "is no expression|nests more than"),
        (" + ".join(["number"] * 300) + " > 0", f"nests more than {DEEPEST} deep"),
        ("x" * (LONGEST + 1), f"has {LONGEST + 1} characters, expected at most {LONGEST}"),
        ("target == 'cup", "is no expression: unterminated string literal"),
        ("(number > 1", "is no expression: "),
        ("number > 1)", "is no expression: "),
        ("\ud800 == 1", "is no expression: "),
        ("a\0b", "is no expression: "),
        ("", "is no expression: "),
    ],
)
def test_what_is_no_expression_of_bounded_size_is_refused(where: str, said: str) -> None:
    with pytest.raises(WhereError, match=said) as refused:
        where_tree(where)
    assert len(str(refused.value)) < 500


def test_a_long_choice_is_not_deep() -> None:
    assert len(columns_in(" or ".join(["target == 'a'"] * 200))) == 1


def test_signs_of_and_and_or_bind_as_the_words() -> None:
    signs = where_tree("number > 1 & target == 'a | b' | success")
    assert ast.dump(signs) == ast.dump(where_tree("number > 1 and target == 'a | b' or success"))


def test_columns_are_named_once_and_functions_are_none() -> None:
    assert columns_in("abs(number) > 1 and number < 3 or target.isna()") == ["number", "target"]
