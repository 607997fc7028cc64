"""Ctrl-C: quiet, however often, and with what is kept."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

from handsight.datasets import GraspDataset

PROGRAM = "from handsight.cli.app import main; main()"


def test_several_interrupts_of_a_collection_leave_no_traceback(tmp_path: Path) -> None:
    words = ["collect", "sim", str(tmp_path / "grasps"), "-n", "5000", "-w", "2"]
    started = subprocess.Popen(
        [sys.executable, "-P", "-c", PROGRAM, *words], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    done = threading.Event()

    def interrupt_when_there_is_a_dataset() -> None:
        # The workers start as the dataset appears; the whole group is meant, as by a terminal.
        while not (tmp_path / "grasps").is_dir() and not done.wait(0.02):
            pass
        for _ in range(3):
            with suppress(ProcessLookupError):
                os.killpg(started.pid, signal.SIGINT)
            done.wait(0.1)

    watcher = threading.Thread(target=interrupt_when_there_is_a_dataset)
    watcher.start()
    _, said = started.communicate(timeout=120)
    done.set()
    watcher.join()
    assert started.returncode == 130
    assert "Traceback" not in said
    assert "interrupted: every finished attempt is committed" in said
    assert GraspDataset.open(str(tmp_path / "grasps")).info().attempts >= 0
