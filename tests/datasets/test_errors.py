"""How messages count, and how they name a call."""

from __future__ import annotations

import shlex
from types import SimpleNamespace

from hypothesis import given
from hypothesis import strategies as st

from handsight.datasets.errors import below_least, counted, pasteable


def test_a_count_agrees_with_its_noun() -> None:
    assert [counted(number, "attempt") for number in (0, 1, 2)] == ["0 attempts", "1 attempt", "2 attempts"]
    assert [counted(number, "success", "successes") for number in (1, 2)] == ["1 success", "2 successes"]


@given(words=st.lists(st.text(st.characters(exclude_categories=["C"])), min_size=1))
def test_a_call_can_be_pasted(words: list[str]) -> None:
    call = pasteable("handsight", *words)
    bare = call[1:-1] if call.startswith("'") else call
    assert shlex.split(bare) == ["handsight", *words]


def test_a_call_stands_in_quotation_marks_unless_it_has_some() -> None:
    assert pasteable("handsight", "dataset", "undo", "lab@trial", 3) == "'handsight dataset undo lab@trial 3'"
    assert pasteable("handsight", "dataset", "undo", "my lab", 3) == "handsight dataset undo 'my lab' 3"


def test_what_is_below_its_least_is_named_each_with_its_bound() -> None:
    settings = SimpleNamespace(trials=0, workers=1, seed=-3)
    assert below_least(settings, trials=1, workers=1, seed=0) == [
        "trials is 0, expected 1 or more",
        "seed is -3, expected 0 or more",
    ]
