"""In what two or more runs differ, value by value."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from handsight.training.run_record import origins_of

_COMPARED = ("handsight", "origins", "selection", "grid", "settings")
"""Keys of a record that say how the network came about. The others are what came of it."""
_PLACE = ("dataset", "ref", "snapshot")
"""Of an origin: where the data lay. What they were, its digest says."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """One value that not all runs have alike."""

    name: str
    """As in the record, with dots and positions: ``origins[0].snapshot``."""
    values: tuple[Any, ...]
    """One for each run; None where a run has no such value."""


def differences(records: Sequence[Mapping[str, Any]]) -> list[Difference]:
    """In what the settings, data and grids of records that were read differ, in the order of the records."""
    flat = [dict(_values(record)) for record in records]
    names = dict.fromkeys(name for values in flat for name in values)
    found = [Difference(name=name, values=tuple(values.get(name) for values in flat)) for name in names]
    return [one for one in found if any(value != one.values[0] for value in one.values)]


def held_out_alike(records: Sequence[Mapping[str, Any]]) -> bool:
    """Whether the runs held out the same attempts, so that their figures are of the same: data and draw agree."""
    drawn = [
        (
            [{**one, **dict.fromkeys(_PLACE)} for one in origins_of(dict(record))],
            record.get("selection"),
            record["settings"].get("seed"),
            record["settings"].get("holdout"),
        )
        for record in records
    ]
    return all(one == drawn[0] for one in drawn)


def _values(record: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    whole = {**record, "origins": origins_of(dict(record))}
    for name in _COMPARED:
        if name in whole:
            yield from _flat(name, whole[name])


def _flat(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Values by where they lie; a list of plain values, such as the widths of layers, is one."""
    if isinstance(value, Mapping):
        for key, part in value.items():
            yield from _flat(f"{name}.{key}", part)
    elif isinstance(value, list) and any(isinstance(part, Mapping) for part in value):
        for at, part in enumerate(value):
            yield from _flat(f"{name}[{at}]", part)
    else:
        yield name, value
