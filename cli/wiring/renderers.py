"""What the option ``--renderer`` comes to.

A session has one renderer, known before it begins: it is part of the recorded configuration, by which a session is
found again to go on with it.
"""

from __future__ import annotations

from dataclasses import replace

from handsight.cli.output import errors
from handsight.collection.sim.renderer import check_available, renderer_named
from handsight.collection.sim.renderer_choice import choose_renderer
from handsight.collection.sim.station import SimStationFactory
from handsight.datasets.errors import DatasetNotFoundError
from handsight.datasets.format.header import canonical_json


def with_renderer(factory: SimStationFactory, wanted: str, *, dataset: str, seed: int) -> SimStationFactory:
    """The same stations with the renderer ``wanted``; ``auto`` is that of the session to go on with, or the faster.

    Raises:
        RendererUnavailableError: This machine cannot draw with it.
        StationSettingsError: It cannot do what the configuration asks for.
    """
    name = _settle(factory, dataset, seed) if wanted == "auto" else wanted
    check_available(renderer_named(name))
    return SimStationFactory(config=replace(factory.config, renderer=name))


def _settle(factory: SimStationFactory, dataset: str, seed: int) -> str:
    recorded = _recorded_renderer(factory, dataset, seed)
    if recorded is not None:
        return recorded
    choice = choose_renderer(factory.config)
    if choice.measured:
        errors.print(f"renderer {choice.renderer}: {choice.reason}")
    return choice.renderer


def _recorded_renderer(factory: SimStationFactory, dataset: str, seed: int) -> str | None:
    """The renderer of the latest session of this seed whose station differs in nothing else."""
    from handsight.datasets.reading.reader import GraspDataset  # Icechunk and pandas, only for ``auto``

    try:
        sessions = GraspDataset.open(dataset).sessions
    except DatasetNotFoundError:
        return None
    wanted = _without_renderer(factory.settings())
    for session in reversed(sessions):
        station = session.header.config.get("station", {})
        if session.header.seed == seed and "renderer" in station and _without_renderer(station) == wanted:
            return str(station["renderer"])
    return None


def _without_renderer(settings: dict[str, object]) -> str:
    return canonical_json({name: value for name, value in settings.items() if name != "renderer"})
