"""Performs recorded attempts again, in the station their session describes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from handsight.cli.wiring.policies import recorded_policy
from handsight.collection.attempt import attempt_seed, run_attempt
from handsight.collection.recorded_stations import RecordedStations
from handsight.collection.sim.config import PHYSICS_VERSION, SimConfig, recorded_physics
from handsight.collection.sim.station import SimStation
from handsight.datasets.records import GraspAttempt, SessionHeader


def why_not_again(header: SessionHeader) -> str:
    """Why the scenes of a session cannot be simulated again here, to be told of its attempts; empty where they can."""
    if header.station.source != "sim" or header.seed is None:
        return "not simulated"
    settings = header.config.get("station")
    if not isinstance(settings, Mapping):
        return "by a simulator that is not described"
    if recorded_physics(settings) != PHYSICS_VERSION:
        return f"under version {recorded_physics(settings)} of the physics, this is {PHYSICS_VERSION}"
    return ""


def open_recorded_station(settings: Mapping[str, Any]) -> SimStation:
    """The simulated station that a session's settings describe."""
    return SimStation(SimConfig.from_json(settings))


class Resimulator:
    """Answers for simulated sessions; keeps one station for each configuration."""

    def __init__(self, model: Path | None = None) -> None:
        """Prepare to simulate.

        Args:
            model: The run whose network chose the grasps, for sessions of the servo policy.
        """
        self._stations = RecordedStations(open_recorded_station)
        self._model = model

    def __call__(self, header: SessionHeader, number: int) -> GraspAttempt | None:
        """Attempt ``number`` of a session; None for what cannot be performed here.

        That is one that was not simulated, or by a simulator that is not described, was under another version of the
        physics, or by a network not at hand.
        """
        if why_not_again(header) or header.seed is None:
            return None
        policy = recorded_policy(header.config.get("policy", {}), self._model)
        if policy is None:
            return None
        return run_attempt(
            self._stations.station(header.config["station"]),
            policy,
            number,
            attempt_seed(header.seed, number),
            pregrasp_picture=bool(header.config.get("pregrasp_picture", False)),
        )

    def close(self) -> None:
        """Stop the stations."""
        self._stations.close()
