"""What is compared with what, and what a refusal says of it."""

from __future__ import annotations

import pytest

from handsight.datasets.reading.where_kinds import Kind, where_faults
from handsight.datasets.reading.where_tree import where_tree

KINDS: dict[str, Kind] = {
    "number": "number",
    "width_final_m": "number",
    "success": "truth",
    "excluded": "truth",
    "target": "text",
    "started": "time",
}


def faults(where: str) -> list[str]:
    return where_faults(where_tree(where), KINDS)


@pytest.mark.parametrize(
    "where",
    [
        "success",
        "success == True and excluded != 0",
        "0.01 < width_final_m <= 1 + number % 2",
        "-1 < -number",
        "target == 'cup' or 'mug' != target",
        "target in ['cup', 'mug'] and number not in (1, -2)",
        "target == ['cup']",
        "target < 'm'",
        "started > '2026-01-31T10:00+02:00'",
        "started.between('2026-01-31', '2026-02-01')",
        "target.isin(['cup']) and width_final_m.between(0, number)",
        "target.str.lower().str.contains('cup|mug')",
        "(number > 1).isna()",
        "abs(number - 3) > 1",
        "success == excluded",
    ],
)
def test_like_is_compared_with_like(where: str) -> None:
    assert faults(where) == []


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ("success == 'True'", "success holds truth values and 'True' is text, expected success, or not success"),
        ("success == 2", "success holds truth values and 2 is a number"),
        ("'True' != success", "success holds truth values and 'True' is text"),
        ("success in ['True']", "success holds truth values and 'True' is text"),
        ("success.isin(['yes'])", "success holds truth values and 'yes' is text"),
        ("width_final_m > '0.01'", "width_final_m holds numbers and '0.01' is text, expected width_final_m > 0.01"),
        ("number == '5'", "number holds numbers and '5' is text"),
        ("number in ['5', 6]", "number holds numbers and '5' is text"),
        ("number == True", "number holds numbers and True is true or false"),
        ("number.between('1', '2')", "number holds numbers and '1' is text"),
        ("target == 5", "target holds text and 5 is a number, expected target == 'cup'"),
        ("target == number", "target holds text and number holds numbers"),
        ("target.str.lower() == 5", "target.str.lower() is text and 5 is a number"),
        ("started > 2026", "started holds times and 2026 is a number, expected started > '2026-01-31'"),
        ("started > 'yesterday'", "'yesterday' is no date, expected started > '2026-01-31'"),
        ("started in ['2026-01-31']", "started holds times, expected a comparison"),
        ("failure == None", "there is no column 'failure'"),
        ("target == None", "what is missing is found with .isna()"),
        ("success > excluded", "success is true or false and has no order"),
        ("number and success", "number holds numbers, expected what is true or false"),
        ("not target", "target holds text, expected what is true or false"),
        ("success + 1 == 2", "success cannot be calculated with, expected numbers"),
        ("target * 1000000000 == 'a'", "text cannot be calculated with"),
        ("99 (sucess == 1)", "99 cannot be called, expected abs() or a method of a column"),
        ("success (number)(1)", "success(number) cannot be called"),
        ("[1] * 1000000000 == number", "the list [1] cannot be calculated with"),
        ("'cup' in target", "target is no list"),
        ("target in 'cup'", "'cup' is no list"),
        ("number in [number]", "number stands in a list, expected constants"),
        ("number.str.contains('a')", "number holds numbers, and .str is for text"),
        ("target.contains('a')", "lacks the str, expected COLUMN.str.contains()"),
        ("target.str.contains(5)", "5 is no text"),
        ("target.str.contains('a', case=False)", "case= is not allowed"),
        ("target.str.contains()", "has 0 values in brackets, expected 1"),
        ("target.str", "target.str is no value"),
        ("number is 1", "'is' is not allowed, expected == or .isna()"),
    ],
)
def test_unlike_things_are_refused_with_an_example(where: str, said: str) -> None:
    assert said in "; ".join(faults(where))


@pytest.mark.parametrize("pattern", [r"(a*)*\\1", "(?=a)a", "(?<!a)b", "(?P<x>a)(?P=x)", "(", "a{2000}", "[z-a]"])
def test_patterns_whose_time_could_explode_are_refused(pattern: str) -> None:
    (fault,) = faults(f"target.str.contains('{pattern}')")
    assert "is no pattern that can be looked for" in fault


def test_all_faults_are_named_at_once() -> None:
    found = faults("widht > 1 and success == 'a' and (target == 5 or number ** 2 > 1)")
    assert len(found) == 4
