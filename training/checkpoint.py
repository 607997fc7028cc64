"""A training that was interrupted, on disk: after every pass, all that the passes to come depend on.

The file is a SHA-256 and, after it, tensors with a text in the format of safetensors, so that reading one from
elsewhere runs none of its code, and a file that was cut short or changed is known before anything is made of it.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import safetensors.torch
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from torch import Tensor

from handsight.datasets.atomic import atomic_file
from handsight.datasets.errors import LoaderStateError
from handsight.datasets.inputs.mixture import LabelledInputs
from handsight.training.course import Course, Epoch
from handsight.training.errors import CheckpointError
from handsight.training.metrics import Metrics
from handsight.training.passes import Passes, PassesState
from handsight.training.settings import TrainSettings

LARGEST_CHECKPOINT_BYTES = 1 << 30
_DIGEST_BYTES = hashlib.sha256().digest_size


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkpoint:
    """Where a training is kept while it goes on."""

    path: Path
    identity: str
    """Of the recipe and the data: what is trained otherwise cannot go on from it."""

    def write(self, course: Course, passes: Passes) -> None:
        """Put the training as it stands in the place of what is there.

        Raises:
            OSError: The disk is full or not writable.
        """
        state = passes.state()
        tensors = {**state.tensors, **{f"kept.{name}": tensor for name, tensor in course.weights.items()}}
        said = {
            "identity": self.identity,
            "history": [asdict(epoch) for epoch in course.history],
            "kept": course.kept,
            "passes": state.numbers,
        }
        payload = safetensors.torch.save(
            {name: tensor.contiguous() for name, tensor in tensors.items()}, metadata={"training": json.dumps(said)}
        )
        with atomic_file(self.path) as unfinished:
            unfinished.write_bytes(hashlib.sha256(payload).digest() + payload)

    def read_into(self, course: Course, passes: Passes) -> None:
        """Let a training that has not begun go on from what is there; nothing happens where nothing is.

        Raises:
            CheckpointError: The file is damaged, or belongs to another training.
            OSError: It cannot be read.
        """
        if not self.path.is_file():
            return
        tensors, said = _parse(self.path)
        if said.get("identity") != self.identity:
            raise CheckpointError(
                f"{self.path} is of a training with other data, another recipe or another PyTorch, expected the same: "
                "give the options that it was begun with, or delete it to train from the beginning"
            )
        try:
            passes.load_state(PassesState(tensors=tensors, numbers=said["passes"]))
            course.history[:] = [
                Epoch(**{**epoch, "held_out": Metrics(**epoch["held_out"])}) for epoch in said["history"]
            ]
            course.kept = said["kept"]
            course.weights = {
                name.removeprefix("kept."): tensor for name, tensor in tensors.items() if name.startswith("kept.")
            }
        except (KeyError, TypeError, ValueError, RuntimeError, LoaderStateError) as error:
            raise _damaged(self.path, str(error)) from error

    def remove(self) -> None:
        """The training has come to its end."""
        self.path.unlink(missing_ok=True)


def identity_of(data: LabelledInputs, rows: NDArray[Any], settings: TrainSettings, device: torch.device) -> str:
    """What a training is known by: data, recipe, and what decides the last bits of its numbers."""
    said = {
        "settings": {**asdict(settings), "network": settings.network.to_json()},
        "attempts": hashlib.sha256("\n".join(map(str, data.attempts.index[rows])).encode()).hexdigest(),
        "labels": hashlib.sha256(data.labels[rows].tobytes()).hexdigest(),
        "torch": torch.__version__,
        "device": device.type,
        "threads": torch.get_num_threads(),
    }
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()


def _parse(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    size = path.stat().st_size
    if not _DIGEST_BYTES < size <= LARGEST_CHECKPOINT_BYTES:
        raise _damaged(path, f"it has {size} bytes")
    content = path.read_bytes()
    digest, payload = content[:_DIGEST_BYTES], content[_DIGEST_BYTES:]
    if hashlib.sha256(payload).digest() != digest:
        raise _damaged(path, "its bytes are not those that were written")
    try:
        header_bytes = int.from_bytes(payload[:8], "little")
        said = json.loads(json.loads(payload[8 : 8 + header_bytes])["__metadata__"]["training"])
        return safetensors.torch.load(payload), dict(said)
    except (SafetensorError, ValueError, KeyError, TypeError) as error:
        raise _damaged(path, f"it is no checkpoint: {error}") from error


def _damaged(path: Path, fault: str) -> CheckpointError:
    return CheckpointError(f"{path} is damaged ({fault}): delete it to train from the beginning")
