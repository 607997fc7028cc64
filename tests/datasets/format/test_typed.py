"""JSON values of anybody's become dataclasses, or every fault is said."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.support.factories import make_header
from tests.support.fuzz_mutations import mutate_json

from handsight.datasets import HeaderError
from handsight.datasets.format.header import header_from_json, header_to_json
from handsight.datasets.format.sessions import new_session_attributes, session_from_attributes
from handsight.datasets.format.typed import shown, typed
from handsight.datasets.format.validation import header_faults


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    size: int

    def __post_init__(self) -> None:
        if self.size < 0:
            raise ValueError(f"size is {self.size}, expected 0 or more")


@dataclass(frozen=True, slots=True, kw_only=True)
class Whole:
    name: str
    part: Part
    length_m: float = 1.0
    exact: bool = False
    words: tuple[str, ...] = ()
    serials: dict[str, str] | None = None
    kind: Literal["open", "sealed"] = "open"
    rest: dict[str, Any] = field(default_factory=dict)


GOOD: dict[str, Any] = {"name": "a", "part": {"size": 1}}


def test_what_is_as_declared_comes_back() -> None:
    given = {**GOOD, "length_m": 2, "words": ["a", "b"], "serials": {"x": "1"}, "kind": "sealed", "rest": {"a": [1]}}
    whole = typed(Whole, given)
    assert whole == Whole(
        name="a",
        part=Part(size=1),
        length_m=2,
        words=("a", "b"),
        serials={"x": "1"},
        kind="sealed",
        rest={"a": [1]},
    )
    # Digests are made of the text of numbers.
    assert isinstance(whole.length_m, int)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": None}, "name is null, expected text"),
        ({"name": 7}, "name is 7, expected text"),
        ({"part": 7}, "part is 7, expected an object with size"),
        ({"part": {}}, "part.size is missing"),
        ({"part": {"size": 1.0}}, "part.size is 1.0, expected a whole number"),
        ({"part": {"size": True}}, "part.size is true, expected a whole number"),
        ({"part": {"size": -1}}, "part: size is -1, expected 0 or more"),
        ({"length_m": "1"}, "length_m is '1', expected a number"),
        ({"length_m": False}, "length_m is false, expected a number"),
        ({"length_m": 10**400}, "length_m is a number of 1329 bits, expected a number that is not beyond all measure"),
        ({"exact": 1}, "exact is 1, expected true or false"),
        ({"words": "ab"}, "words is 'ab', expected a list"),
        ({"words": ["a", None, 3]}, r"words\[1\] is null, expected text; words\[2\] is 3, expected text"),
        ({"serials": []}, "serials is a list of 0, expected an object"),
        ({"serials": {"x": 1}}, "serials.'x' is 1, expected text"),
        ({"kind": "shut"}, "kind is 'shut', expected open or sealed"),
        ({"kind": ["open"]}, "kind is a list of 1, expected open or sealed"),
        ({"nmae": 1}, "fields 'nmae' are unknown, expected name, part"),
        ({"name": 1, "part": {"size": "x"}, "exact": 0}, "name is 1.*part.size is 'x'.*exact is 0"),
    ],
)
def test_every_fault_is_said(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(HeaderError, match=message):
        typed(Whole, {**GOOD, **changes})


@pytest.mark.parametrize("value", [None, 1, "a", [], [GOOD]])
def test_what_is_no_object_is_refused(value: object) -> None:
    with pytest.raises(HeaderError, match="expected an object with name, part"):
        typed(Whole, value)


def test_values_in_messages_are_short() -> None:
    assert len(shown("x" * 10_000)) < 100
    assert shown(10**5000) == "a number of 16610 bits"
    assert shown({"a": 1}) == "an object of 1 field"


def test_no_mutation_of_a_session_ends_in_another_error() -> None:
    attributes = json.loads(json.dumps(new_session_attributes(make_header())))
    for seed in range(500):
        changed = mutate_json(attributes, np.random.default_rng(seed))
        try:
            info = session_from_attributes("ulid", changed, attempts=1)
            header_faults(info.header)
        except HeaderError as error:
            assert len(str(error)) < 5000, seed  # noqa: PT017  # What it says is looked at, not that it comes.
        except Exception as error:
            raise AssertionError(f"mutation {seed}: {changed}") from error


@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.text(), lambda one: st.lists(one) | st.dictionaries(st.text(), one)
    )
)
def test_no_json_value_ends_in_another_error(value: object) -> None:
    with pytest.raises(HeaderError):
        header_from_json(value)
    header = header_to_json(make_header())
    assert header_from_json({**header, "config": {"x": value}}).config == {"x": value} or value != value
