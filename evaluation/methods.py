"""Servo methods by name, with the settings that the paper gives or that were tuned in simulation."""

from __future__ import annotations

from collections.abc import Sequence

from handsight.evaluation.errors import UnknownMethodError
from handsight.servoing.cem import Cem
from handsight.servoing.first_order import FirstOrder
from handsight.servoing.optimiser import Method

RANDOM = "random"
"""Grasp from the random pre-grasp pose: the baseline, without a network."""

SERVO_METHODS: dict[str, Method] = {
    "cem-1": Cem(),
    "first-order": FirstOrder(),
}
"""Single-iteration CEM and first-order ascent (sections IV-A and IV-B)."""

METHODS = (RANDOM, *SERVO_METHODS)


def servo_method(name: str) -> Method:
    """The servo method of that name.

    Raises:
        UnknownMethodError: There is no such method, or it does not servo.
    """
    check_methods([name])
    if name not in SERVO_METHODS:
        raise UnknownMethodError(
            f"method is {name!r}, which does not servo, expected one of: {', '.join(SERVO_METHODS)}"
        )
    return SERVO_METHODS[name]


def check_methods(names: Sequence[str]) -> tuple[str, ...]:
    """The names, if every one of them is a method, none twice.

    Raises:
        UnknownMethodError: Some are not; all of them are named.
    """
    unknown = sorted(set(names) - set(METHODS))
    if unknown or not names:
        what = f"unknown servo method {', '.join(map(repr, unknown))}" if unknown else "no servo method given"
        raise UnknownMethodError(f"{what}, expected some of: {', '.join(METHODS)}")
    return tuple(dict.fromkeys(names))
