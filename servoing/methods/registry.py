"""Servo methods by name, with the settings that the paper gives or that were tuned in simulation.

The one place where a method is entered: the command, the figures and the tests that run every method read it here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import is_dataclass, replace
from types import MappingProxyType
from typing import Any, Final

from handsight.servoing.errors import UnknownMethodError
from handsight.servoing.methods.cem import Cem
from handsight.servoing.methods.first_order import FirstOrder
from handsight.servoing.methods.gauss_newton import GaussNewton
from handsight.servoing.methods.global_first import GlobalFirst
from handsight.servoing.methods.second_order import SecondOrder
from handsight.servoing.optimiser import ServoMethod

RANDOM: Final = "random"
"""Grasp from the random pre-grasp pose: the baseline, without a network."""

FULL_CEM: Final = Cem(samples=128, elite=12, iterations=5, max_steps=4)
"""Steps so limited that both CEMs score as many samples in a run, as the paper tuned them (section IV-A)."""

METHODS: Final[Mapping[str, ServoMethod]] = MappingProxyType(
    {
        method.name: method
        for method in (
            ServoMethod(name=RANDOM, label="random\ngrasps", paper_rate=0.185),
            ServoMethod(name="cem-5", label="full\nCEM", settings=FULL_CEM, paper_rate=0.745),
            ServoMethod(name="cem-1", label="single-iteration\nCEM", settings=Cem(), paper_rate=0.75),
            ServoMethod(name="first-order", label="first-order\nascent", settings=FirstOrder(), paper_rate=0.81),
            ServoMethod(name="second-order", label="second-order\nascent", settings=SecondOrder(), paper_rate=0.62),
            ServoMethod(name="gauss-newton", label="Gauss-Newton\nascent", settings=GaussNewton(), paper_rate=0.745),
            ServoMethod(name="global", label="global\nfirst step", settings=GlobalFirst()),
        )
    }
)
"""Every method, the baseline first. Rates are those of the testing set of Table I, novel objects in simulation."""


def servo_method(name: str) -> ServoMethod:
    """The servo method of that name.

    Raises:
        UnknownMethodError: There is no such method, or it does not servo.
    """
    check_methods([name])
    if METHODS[name].settings is None:
        servoing = ", ".join(other for other, method in METHODS.items() if method.settings is not None)
        raise UnknownMethodError(f"method is {name!r}, which does not servo, expected one of: {servoing}")
    return METHODS[name]


def recorded_method(name: str, optimiser: str, settings: Mapping[str, Any]) -> ServoMethod | None:
    """The method that :meth:`ServoMethod.to_json` gave these of, tuned as it then was.

    Returns:
        None where there is no such method any more, or it has other settings now.

    Raises:
        ServoSettingsError: The settings are out of range.
    """
    known = METHODS.get(name)
    now = None if known is None else known.settings
    if known is None or now is None:
        return None
    if type(now).__name__ != optimiser or now.__dataclass_fields__.keys() != settings.keys():
        return None
    then = {key: _rebuilt(getattr(now, key), value) for key, value in settings.items()}
    return replace(known, settings=replace(now, **then))


def _rebuilt(known: object, value: Any) -> Any:
    """A dataclass from the JSON value of one like ``known``."""
    if isinstance(known, tuple):
        return tuple(value)
    if not is_dataclass(known) or isinstance(known, type):
        return value
    return replace(known, **{key: _rebuilt(getattr(known, key), one) for key, one in value.items()})


def check_methods(names: Sequence[str]) -> tuple[str, ...]:
    """The names, if every one of them is a method, each once.

    Raises:
        UnknownMethodError: Some are not; all of them are named.
    """
    unknown = sorted(set(names) - set(METHODS))
    if unknown or not names:
        what = f"unknown servo method {', '.join(map(repr, unknown))}" if unknown else "no servo method given"
        raise UnknownMethodError(f"{what}, expected some of: {', '.join(METHODS)}")
    return tuple(dict.fromkeys(names))
