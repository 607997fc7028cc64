"""A device in a child process: answers, errors, and what becomes of one that hangs or dies."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

from handsight.collection.errors import DeviceError, DeviceLostError, PoseRefusedError, RobotStoppedError
from handsight.collection.ur10.child import SupervisedChild

LONG_S = 60.0


@pytest.fixture
def devices(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Devices by a name under which a spawned process finds them too."""
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "support")
    return import_module("child_device")


@pytest.fixture
def child(devices: ModuleType) -> Iterator[SupervisedChild]:
    supervised = SupervisedChild("device", devices.Device, open_timeout_s=LONG_S)
    yield supervised
    supervised.kill()


def test_it_answers_from_another_process(child: SupervisedChild) -> None:
    assert [child.ask("count", timeout_s=LONG_S) for _ in range(3)] == [1, 2, 3]
    assert child.ask("pid", timeout_s=LONG_S) not in (os.getpid(), None)


def test_what_hangs_is_killed_and_replaced(child: SupervisedChild) -> None:
    first = child.ask("pid", timeout_s=LONG_S)
    with pytest.raises(DeviceLostError, match="hang took longer than"):
        child.ask("hang", timeout_s=0.2)
    assert not child.alive
    assert child.ask("pid", timeout_s=LONG_S) != first
    assert child.respawns == 1


def test_what_hangs_is_told_from_what_works(child: SupervisedChild) -> None:
    child.start()
    assert child.ask("work", 6, timeout_s=LONG_S, silence_s=1.2) == 6
    with pytest.raises(DeviceLostError, match=r"work_then_hang said nothing for 1.2 s"):
        child.ask("work_then_hang", 3, timeout_s=LONG_S, silence_s=1.2)
    assert child.ask("count", timeout_s=LONG_S) == 1


def test_a_crash_is_told_with_its_signal(child: SupervisedChild) -> None:
    with pytest.raises(DeviceLostError, match="status -11"):
        child.ask("die", timeout_s=LONG_S)
    assert child.ask("count", timeout_s=LONG_S) == 1


@pytest.mark.parametrize(
    ("kind", "expected"), [("stopped", RobotStoppedError), ("refused", PoseRefusedError), ("other", DeviceError)]
)
def test_errors_keep_their_kind_and_the_child_lives(
    child: SupervisedChild, kind: str, expected: type[DeviceError]
) -> None:
    child.ask("count", timeout_s=LONG_S)
    with pytest.raises(expected, match="why") as raised:
        child.ask("fail", kind, timeout_s=LONG_S)
    assert type(raised.value) is expected
    assert child.ask("count", timeout_s=LONG_S) == 2


def test_a_device_that_does_not_open_leaves_no_child(devices: ModuleType) -> None:
    supervised = SupervisedChild("device", devices.broken, open_timeout_s=LONG_S)
    with pytest.raises(DeviceError, match="no such device"):
        supervised.ask("count", timeout_s=LONG_S)
    assert supervised.pid is None


def test_what_a_library_prints_reaches_nobody(child: SupervisedChild, capfd: pytest.CaptureFixture[str]) -> None:
    child.ask("chatter", timeout_s=LONG_S)
    child.close()
    sys.stdout.flush()
    assert capfd.readouterr() == ("", "")
