"""Training: samples per second of the trainer on one thread, beside the network's own work, and sweeps of cells."""

from __future__ import annotations

import resource
import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from torch.nn import functional

from benchmarks import Figure
from benchmarks._sweeping import sweeping_figures
from benchmarks.peers.plain_training import PlainTraining
from handsight.datasets.inputs.materialize import GraspInputs
from handsight.jobs.processes import process_pool
from handsight.training.gqn import GraspQualityNetwork
from handsight.training.passes import Passes
from handsight.training.precision import dtype_for
from handsight.training.settings import TrainSettings
from handsight.training.trainer import train

ATTEMPTS = 1_000
"""Of which each pass makes four samples."""
LARGE = 30_000
"""Attempts of the dataset of which a cell's memory is measured."""
PASSES = 4
"""Of a training."""
REPEATS = 3


def run() -> list[Figure]:
    """All figures of training, of inputs of noise, which take as long as others."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        return [_speed(), _memory(), *sweeping_figures()]
    finally:
        torch.set_num_threads(threads)


def _speed() -> Figure:
    """A training, beside as many steps on a batch that is ready; by turns, so that a busy machine slows both."""
    data, settings = _drawn(ATTEMPTS), replace(TrainSettings(), epochs=PASSES, patience=PASSES)
    # The last batch of a pass may be smaller.
    samples = 4 * (ATTEMPTS - int(settings.holdout * ATTEMPTS))
    steps = samples // settings.batch
    floor, formed = _bare_steps(settings), _bare_steps(settings, formed=True)
    # In a process of its own, which gives its memory back to the system.
    with tempfile.TemporaryDirectory() as folder, process_pool(1) as other:

        def ours() -> None:
            train(data, settings, checkpoint=Path(folder) / "checkpoint.ckpt")
            (Path(folder) / "checkpoint.ckpt").unlink()

        calls: dict[str, tuple[Callable[[], object], int]] = {
            "ours": (ours, PASSES * samples),
            "floor": (lambda: [floor() for _ in range(PASSES * steps)], PASSES * steps * settings.batch),
            "formed": (lambda: [formed() for _ in range(PASSES * steps)], PASSES * steps * settings.batch),
        }
        timed: dict[str, list[float]] = {name: [] for name in (*calls, "plain")}
        for turn in range(1 + REPEATS):
            rates = {name: count / _processor_s(call) for name, (call, count) in calls.items()}
            rates["plain"] = other.submit(_plain_rate).result()
            if turn:
                for name, rate in rates.items():
                    timed[name].append(rate)
    ours_rate, bare, strict, before = (statistics.median(rates) for rates in timed.values())
    return Figure(
        name="training",
        ours=ours_rate,
        unit="samples/s",
        floor=bare,
        peers={
            "the floor on inputs normalised ahead": strict,
            "jitter and noise drawn for each batch, float32": before,
        },
        n=PASSES * samples * REPEATS,
        what=(
            f"Samples that a second of one thread's time is enough for, in batches of {settings.batch} with all that "
            "train() does: gathered, flipped, turned, shifted, brightened, made noisy, mixed, learnt from, averaged, "
            "after every pass evaluated and kept on disk. The floor is forward, backward and AdamW alone on one batch "
            "that is ready, in the same precision "
            f"({str(dtype_for(settings.precision, torch.device('cpu'))).removeprefix('torch.')}). The first peer does "
            "not even normalise its inputs. The second resamples, flips and draws noise in steps of their own and "
            "computes in float32, as handsight did before."
        ),
    )


@cache
def _plain() -> PlainTraining:
    torch.set_num_threads(1)
    return PlainTraining(_drawn(ATTEMPTS), TrainSettings(), dtype=torch.float32)


def _plain_rate() -> float:
    return 4 * ATTEMPTS / _processor_s(_plain().run_one)


def _memory() -> Figure:
    """What a worker has of its own while it trains on a large dataset; mapped inputs can be dropped at any time."""
    settings = replace(TrainSettings(), epochs=1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "inputs.npy"
        inputs = np.lib.format.open_memmap(path, mode="w+", dtype=np.float16, shape=(LARGE, 4, 64, 64))
        labels = np.random.default_rng(0).random(LARGE) < 0.2
        data = GraspInputs(inputs=inputs, attempts=pd.DataFrame({"success": pd.array(labels, dtype="boolean")}))
        rows = np.random.default_rng(0).permutation(LARGE)[:ATTEMPTS]
        Passes(_network(settings), data, rows, settings, torch.Generator().manual_seed(0)).run_one()
        own_mb = _own_bytes() / 1e6
    return Figure(
        name="memory of a cell",
        ours=own_mb,
        unit="MB",
        peers={
            "most that was resident, mapped inputs included": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        },
        n=1,
        what=(
            f"Memory of this process that nothing else could use, PyTorch included, with the inputs of {LARGE:,} "
            "attempts mapped and a network trained on a thousand of them."
        ),
    )


def _network(settings: TrainSettings) -> GraspQualityNetwork:
    torch.manual_seed(0)
    return GraspQualityNetwork(settings.network)


def _drawn(count: int) -> GraspInputs:
    rng = np.random.default_rng(0)
    inputs = rng.random((count, 4, 64, 64), dtype=np.float32).astype(np.float16)
    labels = pd.array(rng.random(count) < 0.2, dtype="boolean")
    return GraspInputs(inputs=inputs, attempts=pd.DataFrame({"success": labels}))


def _bare_steps(settings: TrainSettings, *, formed: bool = False) -> Callable[[], None]:
    """Forward, backward and optimiser on one batch, and nothing else; ``formed`` if that is as layers read it."""
    network = _network(settings).to(memory_format=torch.channels_last).train()  # type: ignore[call-overload]
    optimiser = torch.optim.AdamW(network.parameters(), lr=settings.learning_rate, weight_decay=settings.weight_decay)
    dtype = dtype_for(settings.precision, torch.device("cpu"))
    side = settings.network.reach_px if formed else settings.network.size_px
    inputs = torch.rand(settings.batch, 4, side, side, dtype=dtype if formed else torch.float32)
    inputs = inputs.contiguous(memory_format=torch.channels_last)
    labels = (torch.rand(settings.batch) < 0.2).float()
    score = network.logits_of if formed else network

    def step() -> None:
        with torch.autocast("cpu", dtype, enabled=dtype != torch.float32):
            logits = score(inputs)
        loss = functional.binary_cross_entropy_with_logits(logits.float(), labels)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        optimiser.step()

    return step


def _processor_s(call: Callable[[], object]) -> float:
    began = time.process_time()
    call()
    return time.process_time() - began


def _own_bytes() -> int:
    """Anonymous memory of this process, in bytes."""
    status = Path("/proc/self/status").read_text()
    (line,) = (line for line in status.splitlines() if line.startswith("RssAnon"))
    return 1024 * int(line.split()[1])
