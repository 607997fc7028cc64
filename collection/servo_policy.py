"""Attempts that a trained network chooses: on-policy data, rich in the mistakes that the network still makes."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Protocol

import numpy as np

from handsight.collection.errors import CollectionSettingsError, UnreachableError
from handsight.collection.policy import Pregrasp, UniformPolicy
from handsight.collection.station import Station
from handsight.datasets.records import SceneObjects
from handsight.datasets.views import station_view
from handsight.servoing.homography import InputGrid
from handsight.servoing.loop import ServoSettings, ServoStep, ServoTrace, servo
from handsight.servoing.optimiser import ServoMethod
from handsight.servoing.planar import PlanarPose
from handsight.servoing.scorer import GraspScorer
from handsight.servoing.view import View


class NetworkFactory(Hashable, Protocol):
    """Opens the network of a policy in any process. Equal ones open equal networks; must survive pickling."""

    @property
    def sha256(self) -> str:
        """Of the network's weights."""

    @property
    def grid(self) -> InputGrid:
        """Crop and size of its inputs, as the network that it opens has it."""

    def __call__(self) -> GraspScorer:
        """Open it."""


@lru_cache(maxsize=1)
def _opened(open_network: NetworkFactory) -> GraspScorer:
    """The policy comes pickled with every attempt; its network is opened once in a process."""
    return open_network()


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoPolicy:
    """Servo from a uniformly drawn pose, as in evaluation; a share of the attempts grasps from that pose at once."""

    open_network: NetworkFactory
    method: ServoMethod
    random_share: float = 0.3
    """Share of uniform grasps: without them a network would never learn what it has come to avoid."""
    start: UniformPolicy = field(default_factory=UniformPolicy)
    servo: ServoSettings = field(default_factory=ServoSettings)

    def __post_init__(self) -> None:
        if not 0 <= self.random_share <= 1:
            raise CollectionSettingsError(f"random_share is {self.random_share}, expected 0 to 1")

    def settings(self) -> dict[str, object]:
        """Everything that decides the poses: how the method is tuned, the network and its grid, shares and ranges."""
        method = self.method.to_json()
        return {
            "name": "servo",
            "method": method["name"],
            "optimiser": method["optimiser"],
            "method_settings": method["settings"],
            "weights_sha256": self.open_network.sha256,
            "grid": self.open_network.grid.to_json(),
            "random_share": self.random_share,
            "half_range_m": self.start.half_range_m,
            "servo": self.servo.to_json(),
        }

    def choose(self, station: Station, scene: SceneObjects | None, rng: np.random.Generator) -> Pregrasp:
        """Draw a pose and, unless the attempt is one of the random share, servo from it.

        Raises:
            UnreachableError: The pose drawn cannot be reached.
            ScoreError: A score of the network is not in [0, 1]. It would be so in other attempts too, so that this ends
                the session and no attempt is recorded.
        """
        drawn = self.start.choose(station, scene, rng)
        if rng.random() < self.random_share:
            return drawn
        station.reach(drawn.pose)
        scorer = _opened(self.open_network)
        trace = servo_on_station(station, scorer, self.method, settings=self.servo, rng=rng)
        return Pregrasp(pose=trace.grasp_pose, predicted_success=trace.grasp_score)


def servo_on_station(
    station: Station,
    scorer: GraspScorer,
    method: ServoMethod,
    *,
    settings: ServoSettings,
    rng: np.random.Generator,
    looks: int | None = None,
    on_step: Callable[[ServoStep], None] | None = None,
) -> ServoTrace:
    """Servo from wherever the gripper stands. Steps out of reach are not taken.

    Args:
        station: The robot, its gripper at the pre-grasp height.
        scorer: The network.
        method: How to climb its predictions.
        settings: When to stop.
        rng: Source of the method's randomness.
        looks: Pictures after which is grasped unseen; None for as many as the method needs.
        on_step: Called with every pass of the loop, before the gripper moves.

    Raises:
        ScoreError: A score of the network is not in [0, 1].
    """

    def look() -> tuple[View, PlanarPose]:
        frame = station.look()
        return station_view(frame, station.spec), PlanarPose.from_pose_base_tool(frame.pose_base_tool)

    def move(pose: PlanarPose) -> bool:
        try:
            station.reach(pose)
        except UnreachableError:
            return False
        return True

    return servo(look, move, scorer, method, settings=settings, rng=rng, looks=looks, on_step=on_step)
