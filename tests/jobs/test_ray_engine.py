"""Sessions collected on a Ray cluster of two nodes on this machine, into a bucket on a server of this machine."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import IO

import numpy as np
import pytest
import ray
from tests.support.ray_cluster import ray_cluster
from tests.support.s3_server import empty_bucket, s3_server

from handsight.cli.app import run
from handsight.collection.collector import CollectSettings, collect
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStation, SimStationFactory
from handsight.datasets import GraspDataset, GraspRepository
from handsight.datasets.records import GraspAttempt, SceneObjects
from handsight.jobs import ray_engine as engine_file
from handsight.jobs.engine import Engine
from handsight.jobs.errors import EngineError
from handsight.jobs.ordered import map_ordered
from handsight.jobs.ray_engine import ray_engine

FACTORY = SimStationFactory(config=SimConfig())
SETTINGS = CollectSettings(attempts=8, seed=11, workers=2)
ADDRESS = "s3://lab/week/grasps"


@dataclass(frozen=True, kw_only=True)
class SeenStationFactory(SimStationFactory):
    """Opens stations that leave a file for every attempt, in a folder named after node and process."""

    seen: Path

    def __call__(self) -> SimStation:
        return SeenStation(self)


class SeenStation(SimStation):
    def __init__(self, factory: SeenStationFactory) -> None:
        super().__init__(factory.config)
        self._mine = factory.seen / ray.get_runtime_context().get_node_id() / str(os.getpid())
        self._mine.mkdir(parents=True)

    def reset(self, rng: np.random.Generator) -> SceneObjects:
        (self._mine / str(len(list(self._mine.iterdir())))).touch()
        return super().reset(rng)


@pytest.fixture(scope="module")
def head() -> Iterator[str]:
    """Address of the head of a cluster of two nodes with one CPU each."""
    with ray_cluster(nodes=2) as nodes:
        yield nodes.address


@pytest.fixture
def engine(head: str) -> Iterator[Engine]:
    """Two workers' worth of the cluster. What this file defines travels by value: no node could import it."""
    ray.cloudpickle.register_pickle_by_value(sys.modules[__name__])
    with ray_engine(head, workers=2) as connected:
        yield connected
    ray.cloudpickle.unregister_pickle_by_value(sys.modules[__name__])


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory) -> GraspDataset:
    """The session as processes of this machine make it."""
    path = tmp_path_factory.mktemp("local") / "grasps"
    collect(GraspRepository.create(path), FACTORY, SETTINGS)
    return GraspDataset.open(str(path))


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    with s3_server() as address:
        yield address


@pytest.fixture
def bucket(server: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """An empty bucket ``lab``."""
    empty_bucket(server, monkeypatch)


@pytest.mark.usefixtures("bucket")
def test_two_nodes_make_the_session_that_one_machine_makes(local: GraspDataset, engine: Engine, tmp_path: Path) -> None:
    factory = SeenStationFactory(config=SimConfig(), seen=tmp_path / "seen")
    assert collect(GraspRepository.create(ADDRESS), factory, SETTINGS, engine=engine).attempts == 8
    assert GraspDataset.open(ADDRESS).digest == local.digest
    by_node = [len(list(node.rglob("*/*"))) for node in (tmp_path / "seen").iterdir()]
    assert len(by_node) == 2
    assert min(by_node) > 0
    assert sum(by_node) == 8


def test_a_killed_actor_is_replaced_and_nobody_can_tell(local: GraspDataset, engine: Engine, tmp_path: Path) -> None:
    def kill_one(attempt: GraspAttempt, held: int) -> None:
        if held == 2:
            os.kill(int(next((tmp_path / "seen").glob("*/*")).name), signal.SIGKILL)

    factory = SeenStationFactory(config=SimConfig(), seen=tmp_path / "seen")
    alone = replace(SETTINGS, workers=1)
    collect(GraspRepository.create(tmp_path / "grasps"), factory, alone, engine=engine, on_attempt=kill_one)
    assert GraspDataset.open(str(tmp_path / "grasps")).digest == local.digest
    assert len(list((tmp_path / "seen").glob("*/*"))) == 2


def test_answers_are_the_callers_own(engine: Engine) -> None:
    """Not views of Ray's shared memory, which would fill up with what the caller keeps."""
    (answer,) = map_ordered(Context, zeros, [10**6], workers=1, engine=engine)
    assert answer.flags.writeable


class Context:
    def close(self) -> None:
        """Nothing to let go of."""


def zeros(context: Context, task: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.zeros(task)


def test_a_bench_that_cannot_be_opened_is_that_error(engine: Engine, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="missing"):
        next(map_ordered(partial(open, tmp_path / "missing"), read, range(3), workers=2, engine=engine))


def read(context: IO[str], task: int) -> str:
    return context.read(task)


def test_another_version_on_the_cluster_is_refused(engine: Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine_file, "__version__", "0.0.1")
    with pytest.raises(EngineError, match=r"expected 0\.0\.1 as here: install the same"):
        next(map_ordered(Context, zeros, [1], workers=1, engine=engine))


def test_more_workers_than_the_cluster_has_cpus_are_refused(head: str) -> None:
    with pytest.raises(EngineError, match="has 2 of the 3 CPUs"), ray_engine(head, workers=3):
        pytest.fail("the cluster took them")
    assert not ray.is_initialized()


@pytest.mark.usefixtures("bucket")
def test_the_command_prints_its_json_and_nothing_else(local: GraspDataset, head: str) -> None:
    program = "from handsight.cli.app import main; main()"
    words = ["collect", "sim", ADDRESS, "-n", "8", "--seed", "11", "--engine", "ray", "--json"]
    command = [sys.executable, "-P", "-c", program, *words]
    environment = os.environ | {"RAY_ADDRESS": head}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=200)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["attempts"] == 8
    assert GraspDataset.open(ADDRESS).digest == local.digest


COLLECT_AND_TELL = """
import sys
from handsight.collection.collector import CollectSettings, collect
from handsight.jobs.ray_engine import ray_engine
from handsight.collection.sim.config import SimConfig
from handsight.collection.sim.station import SimStationFactory
from handsight.datasets import GraspRepository

def tell(attempt, held):
    print(held, flush=True)

try:
    with ray_engine("local", workers=2) as engine:
        factory, settings = SimStationFactory(config=SimConfig()), CollectSettings(attempts=10_000, seed=11, workers=2)
        collect(GraspRepository.create(sys.argv[1]), factory, settings, engine=engine, on_attempt=tell)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


def test_an_interruption_ends_a_cluster_of_our_own_and_keeps_what_is_finished(tmp_path: Path) -> None:
    """Ctrl-C reaches every process of the group, Ray's too."""
    command = [sys.executable, "-P", "-c", COLLECT_AND_TELL, str(tmp_path / "grasps")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True) as program:
        assert program.stdout is not None
        assert [program.stdout.readline().strip() for _ in range(3)] == ["1", "2", "3"]
        os.killpg(program.pid, signal.SIGINT)
        said = program.stdout.read().split()
    assert program.returncode == 0
    assert said[-1] == "interrupted"
    held = GraspDataset.open(str(tmp_path / "grasps")).info().attempts
    assert held == int(["3", *said][-2])
    with pytest.raises(ProcessLookupError):
        os.killpg(program.pid, 0)


MISTAKES = {
    "no port": (["--ray-address", "nowhere"], "expected HOST:PORT"),
    "Ray's client": (["--ray-address", "ray://127.0.0.1:10001"], "expected HOST:PORT"),
    "port out of range": (["--ray-address", "127.0.0.1:99999"], "expected HOST:PORT"),
    "nobody there": (["--ray-address", "127.0.0.1:1"], "no Ray cluster answers at 127.0.0.1:1"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_get_one_line_and_create_nothing(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words, said = MISTAKES[name]
    assert run(["collect", "sim", str(tmp_path / "new"), "--engine", "ray", *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ")
    assert said in line
    assert not (tmp_path / "new").exists()


def test_an_address_without_the_engine_is_a_mistake(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["collect", "sim", str(tmp_path / "new"), "--ray-address", "127.0.0.1:6379"]) == 2
    assert "--engine ray" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


def test_without_ray_the_error_says_how_to_get_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    assert run(["collect", "sim", str(tmp_path / "new"), "--engine", "ray"]) == 2
    assert "pip install 'handsight[ray]'" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()
