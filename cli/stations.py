"""Wires station names to stations; the one place that knows the simulator."""

from __future__ import annotations

from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.objects import load_object_set
from handsight.collection.sim.station import SimStationFactory


def sim_station(objects: str, *, shakes: int = 0) -> SimStationFactory:
    """The simulated station over an object set, checked before any process is started.

    Raises:
        ObjectSetError: Unknown object set.
        StationSettingsError: The settings describe no usable station.
    """
    load_object_set(objects)
    return SimStationFactory(config=SimConfig(objects=objects, shakes=shakes))
