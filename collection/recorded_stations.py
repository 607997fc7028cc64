"""Stations as sessions recorded them, one for each configuration, opened when it is needed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from handsight.collection.station import Station
from handsight.datasets.format.header import canonical_json

StationOpener = Callable[[Mapping[str, Any]], Station]
"""Opens the station that a session's settings describe."""


class RecordedStations:
    """Stations by their settings."""

    def __init__(self, open_station: StationOpener) -> None:
        """None is open yet."""
        self._open_station = open_station
        self._stations: dict[str, Station] = {}

    def station(self, settings: Mapping[str, Any]) -> Station:
        """The station that these settings describe."""
        key = canonical_json(dict(settings))
        if key not in self._stations:
            self._stations[key] = self._open_station(settings)
        return self._stations[key]

    def close(self) -> None:
        """Release all of them."""
        for station in self._stations.values():
            station.close()
        self._stations.clear()
