"""Wires station names to stations; the one place that knows the simulator."""

from __future__ import annotations

from collections.abc import Sequence

from handsight.cli.errors import CommandError
from handsight.collection.sim.config import RANDOMIZED, SimConfig
from handsight.collection.sim.grippers import DEFAULT_GRIPPER
from handsight.collection.sim.objects.catalogue import load_object_set, objects_per_scene
from handsight.collection.sim.station import SimStationFactory, check_object_count

EVERYTHING = "all"
"""What ``--vary`` takes for all of ``RANDOMIZED``."""


def randomized(given: Sequence[str] | None) -> tuple[str, ...]:
    """What ``--vary`` asks for, each once and in one order, so that equal requests are equal configurations.

    Raises:
        CommandError: Something there is not.
    """
    wanted = set(given or ())
    unknown = sorted(wanted - {*RANDOMIZED, EVERYTHING})
    if unknown:
        expected = ", ".join((*RANDOMIZED, EVERYTHING))
        raise CommandError(f"vary is {', '.join(map(repr, unknown))}, expected some of: {expected}")
    return RANDOMIZED if EVERYTHING in wanted else tuple(kind for kind in RANDOMIZED if kind in wanted)


def sim_station(
    objects: str,
    *,
    gripper: str = DEFAULT_GRIPPER,
    shakes: int = 0,
    per_scene: int | None = None,
    vary: tuple[str, ...] = (),
) -> SimStationFactory:
    """The simulated station over an object set, checked before any process is started.

    Args:
        objects: The set.
        gripper: Its name; see ``grippers.GRIPPERS``.
        shakes: Shakes after the lift.
        per_scene: Objects in a scene; None for what the set asks for.
        vary: What differs between scenes beside the objects; see ``config.RANDOMIZED``.

    Raises:
        ObjectSetError: Unknown object set, or fewer objects in it than a scene needs.
        StationSettingsError: The settings describe no usable station.
    """
    count = objects_per_scene(objects) if per_scene is None else per_scene
    config = SimConfig(objects=objects, gripper=gripper, shakes=shakes, objects_per_scene=count, vary=vary)
    check_object_count(load_object_set(objects), config)
    return SimStationFactory(config=config)
