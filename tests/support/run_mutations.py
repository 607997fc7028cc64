"""Damage to run folders: everything that an editor, a disk or a foreign tool might do to one."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors.torch import save
from tests.support.fuzz_mutations import mutate_bytes

from handsight.training.gqn import GqnConfig, GraspQualityNetwork
from handsight.training.run_folder import RUN_RECORD, WEIGHTS

ODD_VALUES: tuple[Any, ...] = (
    *(None, True, False, "", "rgb", "x" * 5000, "\ud800", "0" * 64, [], {}, [[]], {"a": 1}, [None], [0], [10**9] * 4),
    *(-1, 0, 1, 2, 3, 64, 400, 10**6, 10**9, 2**31, 2**63, 10**30, -(10**30), 0.5, -0.0, 1e-320, 1e30, 1e308),
    *(float("nan"), float("inf"), float("-inf"), list(range(10_000)), [3] * 10_000, {"channels": "rgbd"}),
)


def mutate_run(folder: Path, rng: np.random.Generator) -> tuple[str, bool]:
    """Change one thing in the folder of a run.

    Returns:
        What was done, and whether the hashes of the record were taken out, as a record of an older version has none.
    """
    unsealed = bool(rng.integers(2))
    if unsealed:
        _edit_record(folder, lambda record: [record.pop(name) for name in list(record) if name.endswith("_sha256")])
    kinds: tuple[Callable[[Path, np.random.Generator], str], ...] = (
        *(_odd_value, _odd_value, _odd_value, _missing_key, _unknown_key, _spoil_bytes_of_record, _odd_text_of_record),
        *(_spoil_bytes_of_weights, _spoil_bytes_of_weights, _header_of_weights, _foreign_weights),
    )
    return kinds[rng.integers(len(kinds))](folder, rng), unsealed


def _edit_record(folder: Path, edit: Callable[[dict[str, Any]], object]) -> None:
    record = json.loads((folder / RUN_RECORD).read_text())
    edit(record)
    (folder / RUN_RECORD).write_text(json.dumps(record))


def _places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The path of every value in a JSON value, its own left out."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [place for key, part in items for place in [(*path, key), *_places(part, (*path, key))]]


def _holder(record: dict[str, Any], place: tuple[Any, ...]) -> Any:
    holder: Any = record
    for key in place[:-1]:
        holder = holder[key]
    return holder


def _at_a_place(folder: Path, rng: np.random.Generator, edit: Callable[[Any, Any], object]) -> tuple[Any, ...]:
    record = json.loads((folder / RUN_RECORD).read_text())
    places = _places(record)
    place = places[rng.integers(len(places))]
    edit(_holder(record, place), place[-1])
    (folder / RUN_RECORD).write_text(json.dumps(record))
    return place


def _odd_value(folder: Path, rng: np.random.Generator) -> str:
    value = ODD_VALUES[rng.integers(len(ODD_VALUES))]
    place = _at_a_place(folder, rng, lambda holder, key: holder.__setitem__(key, value))
    return f"{place} is {str(value)[:40]}"


def _missing_key(folder: Path, rng: np.random.Generator) -> str:
    return f"{_at_a_place(folder, rng, lambda holder, key: holder.__delitem__(key))} is gone"


def _unknown_key(folder: Path, rng: np.random.Generator) -> str:
    def add(holder: Any, key: Any) -> None:
        if isinstance(holder, dict):
            holder["unknown"] = 1
        else:
            holder.append(1)

    return f"something new beside {_at_a_place(folder, rng, add)}"


def _spoil_bytes_of_record(folder: Path, rng: np.random.Generator) -> str:
    return _spoil_bytes(folder / RUN_RECORD, rng)


def _spoil_bytes_of_weights(folder: Path, rng: np.random.Generator) -> str:
    return _spoil_bytes(folder / WEIGHTS, rng)


def _spoil_bytes(path: Path, rng: np.random.Generator) -> str:
    path.write_bytes(mutate_bytes(path.read_bytes(), rng))
    return f"bytes of {path.name}"


def _odd_text_of_record(folder: Path, rng: np.random.Generator) -> str:
    texts = (
        "",
        "null",
        "[]",
        '"run"',
        "[" * 100_000,
        "9" * 5000,
        '{"run_version": 1}',
        '{"run_version": 1e999}',
        "{}\0",
    )
    text = texts[rng.integers(len(texts))]
    (folder / RUN_RECORD).write_text(text)
    return f"run.json is {text[:20]!r}"


def _header_of_weights(folder: Path, rng: np.random.Generator) -> str:
    """A header that lies about its own length, or about shapes, types and places of the tensors."""
    data = (folder / WEIGHTS).read_bytes()
    length = int.from_bytes(data[:8], "little")
    if rng.integers(4) == 0:
        lie = (0, 1, length + 1, length - 1, len(data), 2**32, 2**63, 2**64 - 1)[rng.integers(8)]
        (folder / WEIGHTS).write_bytes(lie.to_bytes(8, "little") + data[8:])
        return f"a header of {lie} bytes"
    header = json.loads(data[8 : 8 + length])
    name = sorted(header)[rng.integers(len(header))]
    lies: tuple[dict[str, Any], ...] = (
        *({"shape": shape} for shape in ([], [0], [2**40, 2**40], [-1], [10**9], ["a"], None)),
        *({"dtype": dtype} for dtype in ("F16", "F64", "I64", "BOOL", "F8_E8M0", "F4", "", None)),
        *({"data_offsets": offsets} for offsets in ([0, 0], [0, 2**62], [8, 4], [-4, 4], [1], None)),
    )
    lie_about = lies[rng.integers(len(lies))]
    header[name] = {**header[name], **lie_about}
    text = json.dumps(header).encode()
    (folder / WEIGHTS).write_bytes(len(text).to_bytes(8, "little") + text + data[8 + length :])
    return f"{name} has {lie_about}"


def _foreign_weights(folder: Path, rng: np.random.Generator) -> str:
    sizes = [int(size) for size in rng.integers(1, 9, 2)]
    channels = ("rgbd", "rgb", "depth")[rng.integers(3)]
    config = GqnConfig(channels=channels, widths=(8, sizes[0]), kernels=(3, 3), dense=(2 * sizes[1],), size_px=16)
    with torch.random.fork_rng(devices=()):
        torch.manual_seed(int(rng.integers(2**31)))
        state = GraspQualityNetwork(config).state_dict()
    state = {name: tensor.half() for name, tensor in state.items()} if rng.integers(4) == 0 else state
    (folder / WEIGHTS).write_bytes(save(state))
    return f"weights of {config}"
