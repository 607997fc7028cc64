"""Performs recorded attempts again, in the station their session describes."""

from __future__ import annotations

from typing import Any

from handsight.collection.attempt import attempt_seed, run_attempt
from handsight.collection.policy import UniformPolicy
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation
from handsight.collection.station import Workspace
from handsight.datasets import GraspAttempt, SessionHeader
from handsight.datasets.header import canonical_json
from handsight.servoing.camera import HandCamera, Intrinsics


class Resimulator:
    """Answers for simulated sessions with the uniform policy; keeps one station for each configuration."""

    def __init__(self) -> None:
        self._stations: dict[str, SimStation] = {}

    def __call__(self, header: SessionHeader, number: int) -> GraspAttempt | None:
        """Attempt ``number`` of such a session; None for sessions that were not simulated, or by another policy."""
        policy = dict(header.config.get("policy", {}))
        if header.station.source != "sim" or header.seed is None or policy.pop("name", "") != UniformPolicy.__name__:
            return None
        return run_attempt(
            self._station(header.config["station"]),
            UniformPolicy(**policy),
            number,
            attempt_seed(header.seed, number),
            pregrasp_picture=header.config["pregrasp_picture"],
        )

    def _station(self, settings: dict[str, Any]) -> SimStation:
        key = canonical_json(settings)
        if key not in self._stations:
            self._stations[key] = SimStation(_config(settings))
        return self._stations[key]


def _config(settings: dict[str, Any]) -> SimConfig:
    camera = dict(settings["camera"])
    intrinsics = Intrinsics(**camera.pop("intrinsics"))
    parts = {"camera": HandCamera(intrinsics=intrinsics, **camera), "workspace": Workspace(**settings["workspace"])}
    return SimConfig(**{**settings, **parts})
