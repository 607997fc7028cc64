"""Datasets: batches for training, writing, size on disk, commits, verification, a million attempts."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from benchmarks import Figure, median_rate, median_s
from benchmarks._recording import recording_figures
from benchmarks.floors.frames import png
from benchmarks.floors.million import write_million
from handsight.datasets import GraspDataset, GraspRepository
from handsight.datasets.inputs.loader import GraspLoader, epoch_order
from handsight.datasets.inputs.materialize import GraspInputs
from handsight.datasets.inputs.torch_dataset import TorchGrasps
from handsight.datasets.reading.diff import diff_versions

SAMPLES = 20_000
PEER_SAMPLES = 2_000
"""Peers are read for so many samples of the same data: they take minutes for all of it."""
BATCH = 200
SEED = 0


def run() -> list[Figure]:
    """All figures of datasets."""
    with tempfile.TemporaryDirectory(prefix="handsight-bench-") as folder:
        path = Path(folder)
        figures = [_batches(path / "inputs")]
        figures += recording_figures(path / "recording")
        figures += _million(path / "million")
    return figures


def _batches(folder: Path) -> Figure:
    """Shuffled batches of network inputs, against a bare gather and against what others read the same data from."""
    folder.mkdir()
    data = _inputs(folder / "inputs.npy")
    order = epoch_order(SAMPLES, seed=SEED, epoch=0)
    some = order[order < PEER_SAMPLES]
    mapped = np.load(folder / "inputs.npy", mmap_mode="r")
    dataset = TorchGrasps(data)

    def ours() -> None:
        for _ in GraspLoader(dataset, batch_size=BATCH, seed=SEED):
            pass

    def bare() -> None:
        for start in range(0, SAMPLES, BATCH):
            mapped[order[start : start + BATCH]]

    _write_hdf5(folder / "inputs.hdf5", mapped[:PEER_SAMPLES])
    _write_parquet(folder / "inputs.parquet", mapped[:PEER_SAMPLES])
    return Figure(
        name="shuffled GQN batches",
        ours=median_rate(ours, SAMPLES),
        unit="samples/s",
        floor=median_rate(bare, SAMPLES),
        peers={
            "HDF5+gzip": median_rate(lambda: _read_hdf5(folder / "inputs.hdf5", some), PEER_SAMPLES, runs=3),
            "parquet+PNG": median_rate(lambda: _read_parquet(folder / "inputs.parquet", some), PEER_SAMPLES, runs=3),
        },
        n=SAMPLES,
        what=(
            f"Globally shuffled batches of {BATCH} inputs (4x64x64, float16) with labels, from a warm memory map; the "
            "floor is the same gather from a bare NumPy memory map. Peers hold the same inputs: one gzip HDF5 demo for "
            "each, read as robomimic does without a cache, and one row for each with RGB and 16-bit height as PNG in "
            "Parquet, as LeRobotDataset keeps images; both also shuffled and stacked."
        ),
    )


def _inputs(path: Path) -> GraspInputs:
    """Inputs with the statistics of pictures rather than noise, so that compression has something to do."""
    rng = np.random.default_rng(SEED)
    inputs = np.lib.format.open_memmap(path, mode="w+", dtype=np.float16, shape=(SAMPLES, 4, 64, 64))
    for start in range(0, SAMPLES, BATCH):
        coarse = rng.integers(0, 256, (BATCH, 8, 8, 4), dtype=np.uint8)
        smooth = [cv2.resize(one, (64, 64), interpolation=cv2.INTER_CUBIC) for one in coarse]
        inputs[start : start + BATCH] = np.stack(smooth).transpose(0, 3, 1, 2) / np.float16(255)
    inputs.flush()
    attempts = pd.DataFrame({"success": np.arange(SAMPLES) % 5 == 0})
    return GraspInputs(inputs=np.load(path, mmap_mode="r"), attempts=attempts)


def _write_hdf5(path: Path, inputs: NDArray[np.float16]) -> None:
    with h5py.File(path, "w") as file:
        for row, one in enumerate(inputs):
            file.create_dataset(
                f"data/demo_{row}/obs/input", data=one[None], chunks=(1, *one.shape), compression="gzip", shuffle=True
            )
            file[f"data/demo_{row}/rewards"] = np.zeros(1, np.float32)


def _read_hdf5(path: Path, order: NDArray[np.int64]) -> None:
    with h5py.File(path) as file:
        for start in range(0, len(order), BATCH):
            rows = order[start : start + BATCH]
            np.stack([file[f"data/demo_{row}/obs/input"][0] for row in rows])
            np.array([file[f"data/demo_{row}/rewards"][0] for row in rows])


def _write_parquet(path: Path, inputs: NDArray[np.float16]) -> None:
    colours, heights = [], []
    for one in inputs:
        colours.append(png((one[:3].transpose(1, 2, 0) * np.float16(255)).astype(np.uint8)))
        heights.append(png((one[3].astype(np.float32) * 65535).astype(np.uint16)))
    labels = np.zeros(len(inputs), np.float32)
    pq.write_table(pa.table({"rgb": colours, "height": heights, "success": labels}), path, row_group_size=1000)


def _read_parquet(path: Path, order: NDArray[np.int64]) -> None:
    table = pq.read_table(path, memory_map=True)
    for start in range(0, len(order), BATCH):
        rows = table.take(order[start : start + BATCH])
        samples = []
        for rgb, height in zip(rows["rgb"], rows["height"], strict=True):
            colour = _decoded(rgb.as_buffer()).transpose(2, 0, 1) / np.float16(255)
            depth = (_decoded(height.as_buffer()) / 65535).astype(np.float16)
            samples.append(np.concatenate([colour, depth[None]]))
        np.stack(samples)


def _decoded(data: pa.Buffer) -> NDArray[Any]:
    return np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED))


def _million(path: Path) -> list[Figure]:
    """What a person types, on a dataset of a million attempts, opening included."""
    repository = write_million(path)
    first = repository.log()[-2].snapshot_id
    actions: dict[str, Callable[[], object]] = {
        "info": lambda: GraspDataset.open(str(path)).info(),
        "log": lambda: GraspRepository.open(path).log(),
        "ls": lambda: GraspDataset.open(str(path)).tail(20),
        "diff": lambda: diff_versions(GraspDataset.open(f"{path}@{first}"), GraspDataset.open(str(path))),
    }
    return [
        Figure(
            name=f"{name} of a million attempts",
            ours=median_s(action, runs=3, warm_up=False),
            unit="s",
            n=1_000_000,
            what=f"'{name}' on 20 sessions of 50,000 attempts without pictures, opening the dataset included.",
        )
        for name, action in actions.items()
    ]
