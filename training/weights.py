"""The weights of a run: written whole, and read only where they are those that the record names."""

from __future__ import annotations

import hashlib
import math
import reprlib
from pathlib import Path

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor

from handsight.datasets.atomic import atomic_file
from handsight.training.gqn import GqnConfig, GraspQualityNetwork
from handsight.training.run_folder import NEXT_WEIGHTS, WEIGHTS
from handsight.training.run_record import damaged

_LARGEST_HEADER_BYTES = 1 << 20


def write_next_weights(folder: Path, network: GraspQualityNetwork) -> str:
    """Write the weights beside those that are there; returns their SHA-256.

    Not by safetensors' own ``save_file``, which hides the file from everybody but its owner, whatever the umask says.
    """
    # Training leaves weights channels-last.
    data = save({name: tensor.contiguous() for name, tensor in network.state_dict().items()})
    with atomic_file(folder / NEXT_WEIGHTS, durable=True) as unfinished:
        unfinished.write_bytes(data)
    return hashlib.sha256(data).hexdigest()


def read_weights(folder: Path, config: GqnConfig, sha256: str | None) -> tuple[dict[str, Tensor], str]:
    """Weights of a network of that shape, and their SHA-256.

    Args:
        folder: Of the run.
        config: The network that the record describes.
        sha256: What the record says of them; None in a record that was written before it did.

    Raises:
        CheckpointError: They are missing, are not those that the record names, or do not fit the network.
        OSError: They cannot be read.
    """
    # A process that saved the run and was killed between its last two steps has left the weights at their other name.
    paths = (folder / WEIGHTS, folder / NEXT_WEIGHTS)
    there = [path for path in paths if path.is_file()] or [folder / WEIGHTS]
    files = [(path, data, hashlib.sha256(data).hexdigest()) for path in there for data in [_read(path, config)]]
    path, data, found = next((file for file in files if file[2] == sha256), files[0])
    faults = []
    if sha256 not in (None, found):
        faults.append(f"its SHA-256 is {found[:12]}…, expected {str(sha256)[:12]}… by run.json")
    tensors = _parse(path, data, faults)
    faults += _shape_faults(tensors, config)
    faults += [
        f"{name} holds numbers that are none"
        for name, tensor in tensors.items()
        if tensor.is_floating_point() and not torch.isfinite(tensor).all()
    ]
    if faults:
        raise damaged(path, faults)
    return tensors, found


def _read(path: Path, config: GqnConfig) -> bytes:
    """The whole file, unless it is larger than any with weights of this network."""
    if not path.is_file():
        raise damaged(path, ["it is missing"])
    most = 8 * sum(math.prod(shape) for shape in config.shapes.values()) + _LARGEST_HEADER_BYTES
    size = path.stat().st_size
    if size > most:
        raise damaged(path, [f"it has {size} bytes, expected at most {most} for the network of run.json"])
    return path.read_bytes()


def _parse(path: Path, data: bytes, faults: list[str]) -> dict[str, Tensor]:
    try:
        return load(data)
    except (SafetensorError, KeyError, TypeError, ValueError, RuntimeError, OverflowError) as error:
        raise damaged(path, [*faults, f"it holds no weights: {error}"]) from error


def _shape_faults(tensors: dict[str, Tensor], config: GqnConfig) -> list[str]:
    """How the weights differ from what the network of the record needs."""
    faults = []
    for name, shape in config.shapes.items():
        if name not in tensors:
            faults.append(f"{name} is missing")
            continue
        dtype = torch.float32 if shape else torch.int64
        found = tensors[name]
        if tuple(found.shape) != shape or found.dtype != dtype:
            faults.append(f"{name} is {found.dtype} {tuple(found.shape)}, expected {dtype} {shape} by run.json")
    unknown = [name for name in tensors if name not in config.shapes]
    faults += [f"{reprlib.repr(name)} belongs to no layer of the network of run.json" for name in unknown]
    return faults
