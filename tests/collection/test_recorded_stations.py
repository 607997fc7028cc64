"""Stations by what sessions recorded of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tests.support.scripted_station import ScriptedStation

from handsight.collection.recorded_stations import RecordedStations


def test_each_configuration_has_one_station_and_all_are_closed() -> None:
    opened: list[Mapping[str, Any]] = []
    closed: list[str] = []

    class Closing(ScriptedStation):
        def close(self) -> None:
            closed.append("closed")

    def opening(settings: Mapping[str, Any]) -> ScriptedStation:
        opened.append(settings)
        return Closing()

    stations = RecordedStations(opening)
    first = stations.station({"a": 1, "b": 2})
    assert stations.station({"b": 2, "a": 1}) is first
    assert stations.station({"a": 2, "b": 2}) is not first
    assert len(opened) == 2
    stations.close()
    assert closed == ["closed", "closed"]
