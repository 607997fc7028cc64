"""Workers on a Ray cluster. The one file that imports Ray, and only when it is asked for.

A worker is an actor with one CPU. Nothing but answers leaves it; what is made of them is up to the process that asks.
Every machine of the cluster needs the same environment; Ray itself holds its own and Python's version equal.
"""

from __future__ import annotations

import logging
import os
import pickle
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from types import ModuleType
from typing import Any, TypeVar

from handsight import __version__
from handsight.jobs.engine import Engine
from handsight.jobs.errors import EngineError

Answer = TypeVar("Answer")

INSTALL = "pip install 'handsight[ray]'"
NEW_CLUSTER = "local"
STORE_BYTES_PER_WORKER = 128 * 2**20
"""Shared memory of a cluster of our own: far more than the answers that can wait for one worker."""
CONNECT_LIMIT_S = 10.0
SHUTDOWN_LIMIT_S = 30.0


@contextmanager
def ray_engine(address: str | None = None, *, workers: int) -> Iterator[Engine]:
    """An engine on the cluster at ``address``, by default ``$RAY_ADDRESS``, or on one started for the while.

    A process that is connected to Ray already stays so, and its cluster is used.

    Args:
        address: ``HOST:PORT`` of the cluster's head; ``auto`` for the one this machine belongs to.
        workers: How many will be asked for, each with one CPU.

    Raises:
        EngineError: Ray is not installed, nothing answers at the address, or the cluster is too small.
    """
    ray = _import_ray()
    address = address or os.environ.get("RAY_ADDRESS") or NEW_CLUSTER
    _check_address(address)
    ours = not ray.is_initialized()
    if ours:
        _connect(ray, address, workers)
    try:
        _check_size(ray, workers)
        yield RayEngine(ray)
    finally:
        if ours:
            ray.shutdown()


@dataclass(frozen=True, slots=True)
class RayEngine:
    """Starts actors in the cluster that this process is connected to; see :func:`ray_engine`."""

    ray: ModuleType

    def start_worker(self) -> Executor:
        """Ask for an actor; it starts once a CPU is free."""
        remote = self.ray.remote(_Actor).options(num_cpus=1, max_restarts=0, scheduling_strategy="SPREAD")
        return _RayWorker(self.ray, remote.remote())

    def kill_worker(self, worker: Executor) -> None:
        """Kill the actor."""
        assert isinstance(worker, _RayWorker)
        worker.kill()


class _Actor:
    """A process of the cluster that answers calls."""

    def run(self, version: str, call: Callable[..., Any], *arguments: Any) -> bytes:
        """The pickled answer: arrays that lie in Ray's shared memory are read-only, and occupy it while one is held."""
        if version != __version__:
            raise EngineError(
                f"{socket.gethostname()} has handsight {__version__}, expected {version} as here: install the same "
                "environment on every machine of the cluster"
            )
        return pickle.dumps(call(*arguments), protocol=pickle.HIGHEST_PROTOCOL)


class _RayWorker(Executor):
    """An actor behind the face of an executor."""

    def __init__(self, ray: ModuleType, actor: Any) -> None:
        self._ray = ray
        self._actor = actor
        self._first: Future[Any] | None = None

    def submit(self, fn: Callable[..., Answer], /, *arguments: Any, **named: Any) -> Future[Answer]:
        """Call ``fn`` in the actor, behind the calls that it has already."""
        answered: Future[Answer] = Future()
        reference = self._actor.run.remote(__version__, partial(fn, **named), *arguments)
        reference.future().add_done_callback(partial(_pass_on, self._ray.exceptions, answered))
        self._first = self._first or answered
        return answered

    def kill(self) -> None:
        """End the actor in the middle of a call."""
        self._ray.kill(self._actor)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the actor behind the calls that it has, so that it closes its context; with ``wait``, see it gone."""
        terminated = self._actor.__ray_terminate__.remote()
        if wait:
            # Termination is done once the actor is dead. One that never began, for want of a free CPU, would wait
            # for ever; one that hangs or is cut off, too.
            begun = self._first is not None and self._first.done()
            self._ray.wait([terminated], timeout=SHUTDOWN_LIMIT_S if begun else 0)
            self._ray.kill(self._actor)


def _pass_on(errors: ModuleType, answered: Future[Any], finished: Future[bytes]) -> None:
    """Give an answer on, or the error as it was raised, or the end of the actor as any executor tells it."""
    error = finished.exception()
    if error is None:
        try:
            answered.set_result(pickle.loads(finished.result()))
        except Exception as unreadable:  # Left here, it would be logged by the thread of Ray and waited for in vain.
            answered.set_exception(unreadable)
    elif isinstance(error, errors.RayTaskError):
        cause = error.cause
        cause.__cause__ = error  # It has the traceback from the other machine.
        answered.set_exception(cause)
    elif isinstance(error, errors.RayError):
        broken = BrokenExecutor("the actor ended without an answer")
        broken.__cause__ = error
        answered.set_exception(broken)
    else:
        answered.set_exception(error)


def _import_ray() -> ModuleType:
    if find_spec("ray") is None:
        raise EngineError(f"the engine 'ray' needs Ray, which is not installed: {INSTALL}, or use the engine 'local'")
    # Read by Ray when it is imported: no reports to its makers, no hint about devices that no actor asks for, and no
    # copy of the cluster's log lines on standard output, where programs read JSON.
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    os.environ["RAY_DEDUP_LOGS_SKIP_REGEX"] = "."
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    import ray

    return ray


def _check_address(address: str) -> None:
    """Refuse an address where nobody answers, at once: Ray itself would try for two minutes and end the process."""
    if address in (NEW_CLUSTER, "auto"):
        return
    host, colon, port = address.rpartition(":")
    if not (host and colon and port.isdecimal() and int(port) < 2**16) or "://" in address:
        raise EngineError(
            f"the Ray address is {address!r}, expected HOST:PORT of the cluster's head (usually port 6379), on a "
            "machine that belongs to the cluster, or 'auto'"
        )
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=CONNECT_LIMIT_S).close()
    except OSError as error:
        reason = error.strerror or error
        raise EngineError(
            f"no Ray cluster answers at {address} ({reason}): start one there with 'ray start --head', or leave the "
            "address out to use this machine alone"
        ) from error


def _connect(ray: ModuleType, address: str, workers: int) -> None:
    settings: dict[str, Any] = {"log_to_driver": False, "logging_level": logging.ERROR}
    if address == NEW_CLUSTER:
        settings |= {
            "num_cpus": workers,
            "object_store_memory": STORE_BYTES_PER_WORKER * workers,
            "include_dashboard": False,
        }
    try:
        ray.init(address=address, **settings)
    except (ConnectionError, RuntimeError, ValueError) as error:
        where = "on this machine" if address == NEW_CLUSTER else f"at {address}"
        raise EngineError(f"cannot use Ray {where}: {error}") from error


def _check_size(ray: ModuleType, workers: int) -> None:
    """Refuse to wait for CPUs that the cluster does not have; for those that are busy the workers wait."""
    cpus = int(ray.cluster_resources().get("CPU", 0))
    if cpus < workers:
        raise EngineError(f"the Ray cluster has {cpus} of the {workers} CPUs needed: ask for fewer --workers")
