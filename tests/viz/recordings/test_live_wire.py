"""Messages of a servo run through a pipe: equal to the last bit, and arrays that PyTorch takes."""

from __future__ import annotations

import io
import os
import threading

import numpy as np
import pytest
import torch

from handsight.evaluation.trial import TrialRecording
from handsight.viz.recordings.live_wire import Ended, Passed, receive, send


def through_a_pipe(*messages: object) -> list[object]:
    """What comes out; more than a pipe holds, so that writing takes several turns."""
    ours, theirs = os.pipe()

    def write() -> None:
        with os.fdopen(theirs, "wb", buffering=0) as pipe:
            for message in messages:
                send(pipe, message)  # type: ignore[arg-type]

    writer = threading.Thread(target=write)
    writer.start()
    with os.fdopen(ours, "rb") as pipe:
        taken = [receive(pipe) for _ in messages]
        with pytest.raises(EOFError):
            receive(pipe)
    writer.join()
    return taken


def test_a_step_arrives_as_it_was(trial: TrialRecording) -> None:
    sent = trial.trace.steps[0]
    (message,) = through_a_pipe(Passed(3, sent))
    assert isinstance(message, Passed)
    got = message.step
    assert message.trial == 3
    assert (got.pose, got.score, got.predicted, got.view.camera) == (
        sent.pose,
        sent.score,
        sent.predicted,
        sent.view.camera,
    )
    np.testing.assert_array_equal(got.view.rgb, sent.view.rgb)
    np.testing.assert_array_equal(got.view.depth_m, sent.view.depth_m)
    assert torch.equal(got.inputs, sent.inputs)
    assert got.proposal is not None
    assert sent.proposal is not None
    for name in ("step", "samples", "scores"):
        assert torch.equal(getattr(got.proposal, name), getattr(sent.proposal, name))


def test_the_messages_of_a_run_follow_each_other(trial: TrialRecording) -> None:
    recorded, aborted = through_a_pipe(Ended(1, trial), Ended(2, None))
    assert isinstance(recorded, Ended)
    assert recorded.recording is not None
    assert recorded.recording.trial == trial.trial
    assert aborted == Ended(2, None)


def test_a_message_that_breaks_off_is_the_end(trial: TrialRecording) -> None:
    whole = io.BytesIO()
    send(whole, Passed(1, trial.trace.steps[0]))
    for size in (0, 2, 30, len(whole.getvalue()) - 1):
        with pytest.raises(EOFError):
            receive(io.BufferedReader(io.BytesIO(whole.getvalue()[:size])))
