"""What tests put into a supervised child: a device that answers, hangs, fails and dies on demand."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable

from handsight.collection.errors import DeviceError, PoseRefusedError, RobotStoppedError


class Device:
    """A device."""

    def __init__(self) -> None:
        self.asked = 0
        self.still_at_it: Callable[[], None] = lambda: None

    def count(self) -> int:
        self.asked += 1
        return self.asked

    def pid(self) -> int:
        return os.getpid()

    def hang(self) -> None:
        time.sleep(600)

    def work_then_hang(self, times: int) -> None:
        for _ in range(times):
            time.sleep(0.3)
            self.still_at_it()
        time.sleep(600)

    def work(self, times: int) -> int:
        for _ in range(times):
            time.sleep(0.3)
            self.still_at_it()
        return times

    def die(self) -> None:
        os.kill(os.getpid(), signal.SIGSEGV)

    def fail(self, kind: str) -> None:
        raise {"stopped": RobotStoppedError, "refused": PoseRefusedError, "other": KeyError}[kind]("why")

    def chatter(self) -> None:
        os.write(1, b"noise\n")
        os.write(2, b"noise\n")

    def close(self) -> None:
        pass


def broken() -> Device:
    raise DeviceError("no such device")
