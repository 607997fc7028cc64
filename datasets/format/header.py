"""Session headers as JSON, and the digest that tells whether two sessions were set up alike."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from typing import Any

from handsight.datasets.format.typed import typed
from handsight.datasets.records import SessionHeader, StationSpec


def canonical_json(value: Any) -> str:
    """One text for one value: sorted keys, no blanks, no NaN.

    Raises:
        TypeError: The value holds something JSON has no form for.
        ValueError: The value holds NaN or infinity.
    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def station_to_json(station: StationSpec) -> dict[str, Any]:
    """A station spec as JSON values."""
    names = {"objects": list(station.objects), "conditions": list(station.conditions)}
    return {**asdict(station), **names, "camera": station.camera.to_json()}


def station_from_json(values: object) -> StationSpec:
    """The station spec that ``station_to_json`` was given.

    Raises:
        HeaderError: The values make no station spec; every fault is said.
    """
    return typed(StationSpec, values)


def header_to_json(header: SessionHeader) -> dict[str, Any]:
    """A session header as JSON values."""
    return {
        "station": station_to_json(header.station),
        "seed": header.seed,
        "objects_per_scene": header.objects_per_scene,
        "config": header.config,
    }


def header_from_json(values: object) -> SessionHeader:
    """The session header that ``header_to_json`` was given; tuples in its configuration come back as lists.

    Raises:
        HeaderError: The values make no session header; every fault is said.
    """
    return typed(SessionHeader, values)


def config_digest(header: SessionHeader) -> str:
    """What decides, with the seed, whether two sessions would record the same, as 64 hexadecimal digits."""
    setup = header_to_json(header)
    del setup["seed"]
    return hashlib.sha256(canonical_json(setup).encode()).hexdigest()
