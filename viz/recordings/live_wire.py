"""What a servo run tells the program that shows it, and how that goes through a pipe.

Making a message is to cost the run next to nothing: pictures go from where they lie into the pipe, tensors as arrays.
"""

from __future__ import annotations

import io
import pickle
import struct
from dataclasses import dataclass
from io import BufferedIOBase
from typing import IO, TYPE_CHECKING, Any

import torch
from torch import Tensor

from handsight.evaluation.trial import TrialRecording
from handsight.evaluation.watching import TrialStart
from handsight.servoing.loop import ServoStep

if TYPE_CHECKING:
    from handsight.viz.recordings.arm_drawing import DrawnArm

_COUNT = struct.Struct("<I")
_SIZE = struct.Struct("<Q")


@dataclass(frozen=True, slots=True)
class Watch:
    """The first of all messages: where to show what follows."""

    url: str
    """Of the viewer."""
    arm: DrawnArm | None
    """The station's arm; None draws its gripper alone."""


@dataclass(frozen=True, slots=True)
class Begun:
    """A trial begins."""

    trial: int
    """Which of the trials that were begun, from 1: what comes of another than the one shown is not for its log."""
    start: TrialStart


@dataclass(frozen=True, slots=True)
class Passed:
    """The loop of a trial has looked and chosen."""

    trial: int
    step: ServoStep


@dataclass(frozen=True, slots=True)
class Ended:
    """The grasp of a trial was executed; without a recording it was aborted before."""

    trial: int
    recording: TrialRecording | None


Event = Begun | Passed | Ended


class _Pickler(pickle.Pickler):
    def reducer_override(self, obj: Any) -> Any:
        if isinstance(obj, Tensor):
            # PyTorch would write a file in memory for each; an array is handed over as it lies.
            return torch.from_numpy, (obj.numpy(force=True),)
        return NotImplemented


def send(pipe: IO[bytes], message: Watch | Event) -> None:
    """Write a message; arrays go from where they lie into the pipe.

    Raises:
        OSError: Nobody reads.
    """
    arrays: list[pickle.PickleBuffer] = []
    body = io.BytesIO()
    # What the callback returns decides where an array goes: nothing, as of ``append``, leaves it out of the body.
    _Pickler(body, protocol=pickle.HIGHEST_PROTOCOL, buffer_callback=arrays.append).dump(message)
    pieces = [body.getbuffer(), *(array.raw() for array in arrays)]
    _write(pipe, _COUNT.pack(len(pieces)) + b"".join(_SIZE.pack(len(piece)) for piece in pieces))
    for piece in pieces:
        _write(pipe, piece)


def receive(pipe: BufferedIOBase) -> Any:
    """The next message.

    Raises:
        EOFError: There is none, or whoever sent it ended in the middle of it.
    """
    (count,) = _COUNT.unpack(_read(pipe, _COUNT.size))
    sizes = [_SIZE.unpack(_read(pipe, _SIZE.size))[0] for _ in range(count)]
    body, *arrays = (_read(pipe, size) for size in sizes)
    return pickle.loads(body, buffers=arrays)


def first_line(error: Exception) -> str:
    """What an error says, in a line."""
    return (str(error).splitlines() or [type(error).__name__])[0]


def _write(pipe: IO[bytes], piece: bytes | memoryview) -> None:
    """All of it: a pipe without a buffer may take less at a time."""
    left = memoryview(piece)
    while left:
        left = left[pipe.write(left) :]


def _read(pipe: BufferedIOBase, size: int) -> bytearray:
    """So many bytes, which can be written to, as PyTorch wants of what its arrays are made of."""
    taken = bytearray(size)
    if pipe.readinto(taken) < size:
        raise EOFError
    return taken
