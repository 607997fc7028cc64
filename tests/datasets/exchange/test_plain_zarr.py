"""Plain Zarr opens with zarr alone, and folders that are refused."""

from __future__ import annotations

import json
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from tests.support.axes import arrays_of, assert_axes_are_named, axes_of
from tests.support.factories import make_attempt, make_header, record

from handsight.datasets import (
    DatasetError,
    GraspDataset,
    GraspRepository,
    InterchangeError,
    export_dataset,
    import_dataset,
    migrate,
)
from handsight.datasets.curation.curator import Curator
from handsight.datasets.reading.selection import Selection


def test_plain_zarr_opens_with_zarr_alone(dataset: GraspDataset, tmp_path: Path) -> None:
    export_dataset(dataset, tmp_path / "out.zarr", format="zarr")
    root = zarr.open_group(str(tmp_path / "out.zarr"), mode="r")
    attributes: dict[str, Any] = root.attrs.asdict()
    origin = attributes["handsight"]
    assert (origin["digest"], origin["snapshot"]) == (dataset.digest, dataset.snapshot_id)
    identity = dataset.attempts.index[dataset.attempts["overhead_taken"]][-1]
    session, _, number = identity.rpartition("-")
    array = root[f"sessions/{session}/overhead/rgb"]
    assert isinstance(array, zarr.Array)
    np.testing.assert_array_equal(array[int(number)], dataset.frame(identity).rgb)


CORE_CODECS = {"bytes", "blosc", "crc32c"}


@pytest.mark.parametrize("size", [(8, 6), (1, 3)])
def test_any_library_can_decode_an_export(repository: GraspRepository, tmp_path: Path, size: tuple[int, int]) -> None:
    header = make_header(seed=1, width=size[0], height=size[1])
    record(repository, header, [make_attempt(header, number) for number in range(20)])
    Curator(repository, author="jo").exclude(Selection(where="outcome == 'held'"), "dark")
    export_dataset(GraspDataset(repository, ref="main"), tmp_path / "out.zarr", format="zarr")
    root = zarr.open_group(str(tmp_path / "out.zarr"), mode="r")
    assert_axes_are_named(root)
    for path in arrays_of(root):
        metadata = json.loads((tmp_path / "out.zarr" / path / "zarr.json").read_text())
        used = {codec["name"] for codec in metadata["codecs"]}
        assert used <= CORE_CODECS, path
        assert "crc32c" in used, path


def test_axes_are_named_that_had_no_names_when_they_were_recorded(tmp_path: Path) -> None:
    golden = Path(__file__).parents[1] / "scenarios/golden/schema-1.zip"
    with zipfile.ZipFile(golden) as archive:
        archive.extractall(tmp_path / "grasps")
    migrate(GraspRepository.open(tmp_path / "grasps"), "new")
    dataset = GraspDataset.open(f"{tmp_path}/grasps@new")
    assert any(axes_of(array) is None for array in arrays_of(dataset.root).values())
    export_dataset(dataset, tmp_path / "out", format="zarr")
    assert_axes_are_named(zarr.open_group(str(tmp_path / "out"), mode="r"))
    import_dataset(tmp_path / "out", tmp_path / "back")
    assert GraspDataset.open(f"{tmp_path}/back").digest == dataset.digest


@pytest.mark.filterwarnings("ignore:Object at ._:zarr.errors.ZarrUserWarning")
def test_what_macos_keeps_beside_files_is_passed_over(dataset: GraspDataset, tmp_path: Path) -> None:
    export_dataset(dataset, tmp_path / "out", format="zarr")
    for path in list((tmp_path / "out").rglob("*")):
        path.with_name(f"._{path.name}").write_bytes(b"\0\5\x16\7")
    import_dataset(tmp_path / "out", tmp_path / "back")
    assert GraspDataset.open(f"{tmp_path}/back").digest == dataset.digest


def test_all_faults_of_metadata_are_said_at_once(dataset: GraspDataset, tmp_path: Path) -> None:
    export_dataset(dataset, tmp_path / "out", format="zarr")
    for name, key, value in (
        ("number", "shape", [-1]),
        ("outcome", "codecs", [{"name": "bytes"}, {"name": "pickle"}]),
        ("target", "data_type", "object"),
        ("failure", "chunk_grid", {"configuration": {"chunk_shape": [2**30, 512]}}),
        ("digest", "node_type", None),
    ):
        file = next((tmp_path / "out").glob(f"sessions/*/attempts/{name}/zarr.json"))
        file.write_text(json.dumps({**json.loads(file.read_text()), key: value}))
    with pytest.raises(InterchangeError) as caught:
        import_dataset(tmp_path / "out", tmp_path / "back")
    for message in (
        "number/zarr.json: shape is [-1]",
        "codecs hold 'pickle'",
        "data_type is 'object'",
        "failure/zarr.json: chunk_shape is [1073741824, 512], expected at most",
        "node_type is None",
    ):
        assert message in str(caught.value)


def test_arrays_are_what_the_headers_say(dataset: GraspDataset, tmp_path: Path) -> None:
    export_dataset(dataset, tmp_path / "out", format="zarr")
    file = next((tmp_path / "out").glob("sessions/*/overhead/depth/zarr.json"))
    metadata = json.loads(file.read_text())
    file.write_text(json.dumps({**metadata, "shape": [metadata["shape"][0] + 1, *metadata["shape"][1:]]}))
    with pytest.raises(
        InterchangeError, match=r"overhead/depth is uint16 \[\d+, 6, 8\], expected uint16 \[\d+, 6, 8\]"
    ):
        import_dataset(tmp_path / "out", tmp_path / "back")


def _link_out(path: Path) -> None:
    (path / "sessions" / "link").symlink_to("/etc")


def _flip_chunk(path: Path) -> None:
    chunk = max(path.glob("sessions/*/overhead/rgb/c/*/0/0/0"), key=lambda one: one.stat().st_size)
    data = bytearray(chunk.read_bytes())
    data[len(data) // 2] ^= 4
    chunk.write_bytes(data)


def _newer(path: Path) -> None:
    zarr.open_group(str(path), mode="r+").update_attributes({"handsight": {"schema_version": 99}})


def _claim_zarr_rows(path: Path) -> None:
    for name in ("number", "digest"):
        array = zarr.open_array(str(next(path.glob(f"sessions/*/attempts/{name}"))), mode="r+")
        array.resize((10**12, *array.shape[1:]))


def _foreign(path: Path) -> None:
    shutil.rmtree(path)
    zarr.create_group(str(path))


BAD_ZARR: dict[str, tuple[Callable[[Path], object], str]] = {
    "link": (_link_out, "holds a link at"),
    "bit": (_flip_chunk, "is damaged in row"),
    "newer": (_newer, "schema version 99"),
    "foreign": (_foreign, "schema version None"),
    "a bomb of rows": (_claim_zarr_rows, "digest claims 1000000000000 rows"),
    "root": (lambda path: (path / "zarr.json").write_text("{"), "it is no JSON"),
    "missing array": (
        lambda path: shutil.rmtree(next(path.glob("sessions/*/attempts/outcome"))),
        "attempts/outcome cannot be read",
    ),
}


@pytest.mark.parametrize("name", BAD_ZARR)
def test_a_bad_folder_is_refused_and_leaves_nothing(dataset: GraspDataset, tmp_path: Path, name: str) -> None:
    damage, message = BAD_ZARR[name]
    export_dataset(dataset, tmp_path / "out", format="zarr")
    damage(tmp_path / "out")
    with pytest.raises(DatasetError, match=message):
        import_dataset(tmp_path / "out", tmp_path / "new")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["grasps", "out"]
