"""Where the machine cannot read, nothing is called damaged, and repair sets nothing aside."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.support.factories import make_attempt, make_header, record
from tests.support.fuzz_sources import make_images

from handsight.datasets import GraspDataset, GraspRepository, export_dataset, verify

PROGRAM = Path(__file__).parents[2] / "support" / "limited.py"
CAUSES = {
    "few_files": ("Too many open files", "ulimit -n"),
    "no_threads": ("no thread can be started", "ulimit -u"),
    "little_memory": ("memory", "free some memory"),
    "no_rights": ("Permission denied", "permissions"),
}


@pytest.fixture(scope="module")
def folder() -> Iterator[Path]:
    """A dataset and exports of it where everybody can read them."""
    with tempfile.TemporaryDirectory(prefix="handsight-limits-") as name:
        place = Path(name)
        header = make_header()
        repository = GraspRepository.create(place / "grasps")
        record(repository, header, [make_attempt(header, number) for number in range(6)])
        dataset = GraspDataset(repository, ref="main")
        for target, form in (("grasps.hdf5", "hdf5"), ("grasps.zarr", "zarr"), ("lerobot", "lerobot")):
            export_dataset(dataset, place / target, format=form)
        make_images(place)
        (place / "set").rename(place / "images")
        for path in (place, *place.rglob("*")):
            path.chmod(0o777 if path.is_dir() else 0o666)
        yield place


def limited(limit: str, folder: Path) -> dict[str, Any]:
    words = [sys.executable, "-P", str(PROGRAM), limit, str(folder)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="limits are set as Linux has them")
@pytest.mark.parametrize("limit", CAUSES)
def test_trouble_of_the_machine_is_named_and_nothing_is_called_damaged(folder: Path, limit: str) -> None:
    chunks = folder / "grasps/chunks"
    chunks.chmod(0o000 if limit == "no_rights" else 0o777)
    try:
        found = limited(limit, folder)
    finally:
        chunks.chmod(0o777)
    cause, remedy = CAUSES[limit]
    for status, said in found["commands"]:
        assert status == 2
        assert said.startswith("error: ")
        assert said.count("\n") == 1
        assert cause in said
        assert remedy in said
    # What is open already may do without what has run out.
    refused = [said for said in found["readers"] if said not in ("True", "False")]
    assert [said for said in refused if not said.startswith("StorageError: ")] == []
    assert not any(word in json.dumps(found) for word in ("orrupt", "damage", "from a copy"))
    repository = GraspRepository.open(folder / "grasps")
    assert list(repository.branches()) == ["main"]
    assert verify(GraspDataset(repository, ref="main")).ok
