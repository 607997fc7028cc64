"""Wires names of engines to engines."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext

from handsight.cli.errors import CommandError
from handsight.jobs.engine import LOCAL, Engine


def check_engine(name: str, ray_address: str | None) -> None:
    """Refuse the address of a cluster that is not used."""
    if name != "ray" and ray_address is not None:
        raise CommandError(f"--ray-address {ray_address} goes with --engine ray, and the engine is {name}")


def engine_named(name: str, ray_address: str | None, workers: int) -> AbstractContextManager[Engine]:
    """The engine, reached before anything is written."""
    if name == "ray":
        from handsight.jobs.ray_engine import ray_engine  # only where there is a cluster

        return ray_engine(ray_address, workers=workers)
    return nullcontext(LOCAL)
