"""Shuffled batches whose order follows from seed and epoch alone, and that go on where they stopped."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from torch.utils.data import DataLoader, Sampler

from handsight.datasets.errors import LoaderStateError
from handsight.datasets.inputs.torch_dataset import Batch, TorchGrasps


def epoch_order(size: int, *, seed: int, epoch: int) -> NDArray[np.int64]:
    """A permutation of ``range(size)`` that depends on nothing else. Shape (size,)."""
    return np.random.default_rng([seed, epoch]).permutation(size)


class ShuffledBatches(Sampler[NDArray[np.int64]]):
    """The batches of one epoch, as arrays of positions, from batch ``start`` on.

    For a ``DataLoader`` of one's own: ``DataLoader(dataset, sampler=ShuffledBatches(…), batch_size=None)``.
    """

    def __init__(self, rows: NDArray[np.int64], *, batch_size: int, seed: int, epoch: int, start: int = 0) -> None:
        order = rows[epoch_order(len(rows), seed=seed, epoch=epoch)]
        self._batches = [order[at : at + batch_size] for at in range(start * batch_size, len(rows), batch_size)]

    def __iter__(self) -> Iterator[NDArray[np.int64]]:
        return iter(self._batches)

    def __len__(self) -> int:
        return len(self._batches)


class GraspLoader:
    """Iterates over epochs of globally shuffled batches.

    Each ``for batch in loader`` runs the rest of the current epoch. The order depends on seed, epoch and batch size,
    never on the number of workers. :meth:`state_dict` after any batch, in this process, says what has been delivered;
    a loader that is given it goes on with the next batch.

    Args:
        dataset: Where the batches come from; a ``FlippedGrasps`` has every attempt in all four flips.
        batch_size: Samples in a batch; the last of an epoch may have fewer.
        seed: Of the order.
        rows: Positions in ``dataset`` to draw from, such as those of a training fold; None for all. Shape (M,).
        workers: Processes that gather batches; with none, which is the fastest on few cores, it is done here.
        start_method: How workers are started.

    Raises:
        ValueError: The batch size or a position is out of range.
    """

    def __init__(
        self,
        dataset: TorchGrasps,
        *,
        batch_size: int,
        seed: int,
        rows: NDArray[np.int64] | None = None,
        workers: int = 0,
        start_method: Literal["fork", "forkserver", "spawn"] = "forkserver",
    ) -> None:
        self._rows = np.arange(len(dataset)) if rows is None else np.asarray(rows, dtype=np.int64)
        if batch_size < 1 or seed < 0 or workers < 0:
            raise ValueError(
                f"batch_size is {batch_size}, seed {seed}, workers {workers}, expected at least 1, 0 and 0"
            )
        if len(self._rows) and not 0 <= self._rows.min() <= self._rows.max() < len(dataset):
            raise ValueError(f"rows go from {self._rows.min()} to {self._rows.max()}, expected 0 to {len(dataset) - 1}")
        self._dataset = dataset
        self._batch_size = batch_size
        self._seed = seed
        self._workers = workers
        self._start_method = start_method
        self._epoch = 0
        self._batch = 0

    @property
    def epoch(self) -> int:
        """The epoch that is running or comes next, from 0."""
        return self._epoch

    def __len__(self) -> int:
        """Batches in a whole epoch."""
        return -(-len(self._rows) // self._batch_size)

    def __iter__(self) -> Iterator[Batch]:
        sampler = ShuffledBatches(
            self._rows, batch_size=self._batch_size, seed=self._seed, epoch=self._epoch, start=self._batch
        )
        for batch in self._batches(sampler):
            # Counted before it is handed out: a state taken while the batch is used counts it as delivered.
            self._batch += 1
            yield batch
        self._epoch, self._batch = self._epoch + 1, 0

    def state_dict(self) -> dict[str, int]:
        """What has been delivered, as JSON values."""
        return {"epoch": self._epoch, "batch": self._batch, **self._identity()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Go on where the loader that made the state stood.

        Raises:
            LoaderStateError: The state belongs to another order of batches; the message lists every difference.
        """
        identity = self._identity()
        faults = [
            f"{name} was {state.get(name)}, now {value}" for name, value in identity.items() if state.get(name) != value
        ]
        batch, epoch = state.get("batch"), state.get("epoch")
        if not (isinstance(batch, int) and isinstance(epoch, int) and 0 <= batch <= len(self) and epoch >= 0):
            faults.append(f"epoch is {epoch} and batch {batch}, expected 0 or more and at most {len(self)}")
        if faults:
            raise LoaderStateError(f"the state does not belong to these batches: {'; '.join(faults)}")
        self._epoch, self._batch = int(state["epoch"]), int(state["batch"])

    def _batches(self, sampler: ShuffledBatches) -> Iterable[Batch]:
        if not self._workers:
            return (self._dataset[positions] for positions in sampler)
        loader: DataLoader[Batch] = DataLoader(
            self._dataset,
            sampler=sampler,
            batch_size=None,
            num_workers=self._workers,
            multiprocessing_context=self._start_method,
        )
        return loader

    def _identity(self) -> dict[str, int]:
        """What the order of the batches depends on."""
        checksum = zlib.crc32(self._rows.astype("<i8").tobytes())
        return {"seed": self._seed, "batch_size": self._batch_size, "rows": len(self._rows), "rows_checksum": checksum}
