"""The table of quantities: its ranges hold each other, and a wrong unit is recognised."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handsight.datasets.format import quantities
from handsight.datasets.format.quantities import Quantity

TABLE = {name: value for name, value in vars(quantities).items() if isinstance(value, Quantity)}


@pytest.mark.parametrize("name", TABLE)
def test_what_is_likely_is_possible_and_has_a_source(name: str) -> None:
    quantity = TABLE[name]
    assert quantity.possible[0] <= quantity.likely[0] <= quantity.likely[1] <= quantity.possible[1]
    assert quantity.source
    assert quantity.fault(quantity.likely[0]) is None
    assert quantity.fault(quantity.likely[1]) is None
    assert quantity.fault(math.nan) is not None


@pytest.mark.parametrize(
    ("name", "value", "unit"),
    [
        ("GRIPPER_STROKE", 85, "millimetres"),
        ("GRIPPER_STROKE", 8.5, "centimetres"),
        ("GRIPPER_STROKE", 1e9, ""),
        ("GRIPPER_STROKE", -85, ""),
        ("CLOSED_WIDTH", 2, "millimetres"),
        ("PREGRASP_HEIGHT", 400, "millimetres"),
        ("PREGRASP_HEIGHT", 40, "centimetres"),
        ("CAMERA_OFFSET", -55.0, "millimetres"),
        ("DEPTH_SCALE", 1, "millimetres per unit"),
        ("DEPTH_SCALE", 1000, "units per metre"),
        ("DEPTH_SCALE", 5000, "units per metre"),
        ("OVERHEAD_ANGLE", 90, "degrees"),
        ("ANGLE", -90, "degrees"),
        ("PHASE", 3500, "milliseconds"),
        ("PHASE", 3.5e9, "nanoseconds"),
        ("STARTED", 60_000_000_000, ""),
        ("STARTED", 1_700_000_000, "seconds"),
        ("STARTED", 1_700_000_000_000, "milliseconds"),
        ("STARTED", 1_700_000_000_000_000, "microseconds"),
        ("PROBABILITY", 87, "per cent"),
        ("CONTACT_FORCE", 1e9, ""),
    ],
)
def test_the_unit_of_a_number_that_is_off_is_guessed(name: str, value: float, unit: str) -> None:
    assert TABLE[name].mistaken_unit(value) == unit


def test_a_complaint_says_what_was_given_and_what_was_expected() -> None:
    assert quantities.GRIPPER_STROKE.fault(85, "gripper_stroke_m") == (
        "gripper_stroke_m is 85 m, expected 0.001 to 1 m: millimetres?"
    )
    assert quantities.SEED.fault(-1) == "seed is -1, expected 0 to 2**63 - 1"


@given(st.sampled_from(sorted(TABLE)), st.floats(allow_nan=False) | st.integers(-(10**30), 10**30))
def test_a_number_is_possible_and_likely_possible_and_unlikely_or_impossible(name: str, value: float) -> None:
    quantity = TABLE[name]
    impossible, unlikely = bool(quantity.impossible(float(value))), bool(quantity.unlikely(float(value)))
    assert not (impossible and unlikely)
    if isinstance(value, float):
        assert impossible == (quantity.fault(value) is not None)
    said = quantity.complaint(value, quantity.possible)
    assert said.isprintable()


def test_what_is_not_known_is_neither_impossible_nor_unlikely() -> None:
    values = np.array([math.nan, 0.03, 5.0])
    np.testing.assert_array_equal(quantities.JAW_OPENING.impossible(values), [False, False, True])
    np.testing.assert_array_equal(quantities.JAW_OPENING.unlikely(values), [False, False, False])
