"""Sessions from anywhere: what describes them is read by type, range and digest before anything is written."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from tests.support.factories import make_header
from tests.support.fuzz_mutations import mutate_json

from handsight.datasets import DatasetError, InterchangeError
from handsight.datasets.exchange.sources import checked_source
from handsight.datasets.format.sessions import new_session_attributes
from handsight.datasets.format.upgrades import current_attributes

ULID = "01K8Z0000000000000000000AB"


def attributes() -> dict[str, Any]:
    read: dict[str, Any] = json.loads(json.dumps(new_session_attributes(make_header())))
    return read


def station(**changes: Any) -> Callable[[dict[str, Any]], object]:
    return lambda values: values["header"]["station"].update(changes)


def top(**changes: Any) -> Callable[[dict[str, Any]], object]:
    return lambda values: values.update(changes)


BAD: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "source": (station(source=None), "header.station.source is null, expected text"),
    "objects": (station(objects=["cup", None]), r"header.station.objects\[1\] is null, expected text"),
    "scale": (station(depth_scale_m="0.001"), "header.station.depth_scale_m is '0.001', expected a number"),
    "stroke": (station(gripper_stroke_m=85), r"gripper_stroke_m is 85 m, expected 0.001 to 1 m: millimetres\?"),
    "camera": (station(camera=[]), "header.station.camera is a list of 0, expected an object with intrinsics"),
    "serials": (station(serials={"camera": "a\nb"}), r"serials holds 'a\\nb', expected text of up to 512 characters"),
    "surrogate": (station(objects=["\ud800"]), "objects holds '.*', expected text"),
    "empty name": (station(objects=[""]), "objects holds an empty name"),
    "seed": (lambda values: values["header"].update(seed=1.5), "header.seed is 1.5, expected a whole number"),
    "scene": (
        lambda values: values["header"].update(objects_per_scene=30_000),
        "objects_per_scene is 30000, expected 0 to",
    ),
    "config": (lambda values: values["header"].update(config=None), "header.config is null, expected an object"),
    "nothing": (lambda values: values.clear(), "header is missing; config_digest is missing; code is missing"),
    "status": (top(status="shut"), "status is 'shut', expected open or sealed"),
    "code": (top(code=1), "code is 1, expected an object"),
    "packages": (top(packages={"zarr": 3}), "packages.'zarr' is 3, expected text"),
    "started": (top(started="noon"), "started is 'noon', expected a time in ISO 8601"),
    "started type": (top(started=7), "started is 7, expected text"),
    "digest": (top(config_digest="0"), "config_digest does not belong to the header"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_description_is_refused(case: str) -> None:
    change, message = BAD[case]
    values = attributes()
    change(values)
    with pytest.raises(InterchangeError, match=message):
        checked_source(ULID, values, size=1)


@pytest.mark.parametrize("ulid", ["", "x", "01k8z0000000000000000000ab", "../../etc", "8" * 26, None])
def test_a_bad_name_is_refused(ulid: Any) -> None:
    with pytest.raises(InterchangeError, match="expected a ULID as its name"):
        checked_source(ulid, attributes(), size=1)


@pytest.mark.parametrize("schema", [1, 2])
def test_no_mutation_ends_in_another_error(schema: int) -> None:
    refused = 0
    for seed in range(100):
        changed = mutate_json(attributes(), np.random.default_rng(seed))
        try:
            checked_source(ULID, current_attributes(changed, schema), size=1)
        except DatasetError:
            refused += 1
        except Exception as error:
            raise AssertionError(f"mutation {seed}: {changed}") from error
    assert refused > 33


@pytest.mark.parametrize("values", [[], None, 3, {}, {"header": []}, {"header": {"station": None}}])
def test_what_an_older_schema_never_wrote_is_refused(values: Any) -> None:
    with pytest.raises(DatasetError):
        current_attributes(values, 1)
