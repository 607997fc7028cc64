"""Processes that leave Ctrl-C to the one that started them, and end with it even when it is killed."""

from __future__ import annotations

import multiprocessing
import os
import select
import signal
import subprocess
import sys
from pathlib import Path
from subprocess import PIPE, Popen

import pytest

from handsight.jobs.processes import bound_command, process_pool

SLEEPER = [sys.executable, "-I", "-S", "-c", "import sys; sys.stdin.read()"]


def blocks_interrupts(pid: int | None) -> bool:
    (blocked,) = [line for line in Path(f"/proc/{pid}/status").read_text().splitlines() if line.startswith("SigBlk")]
    return bool(int(blocked.split()[1], 16) & 1 << signal.SIGINT - 1)


def test_a_worker_is_deaf_to_interrupts_from_its_first_moment_on() -> None:
    """Before it has imported anything, where an interrupt would print a traceback."""
    with process_pool(1) as pool:
        answer = pool.submit(os.getpid)
        (worker,) = multiprocessing.active_children()
        assert blocks_interrupts(worker.pid)
        assert not blocks_interrupts(os.getpid())
        assert answer.result() == worker.pid


INTERRUPTED = """
import operator, os, signal, sys
from handsight.jobs.processes import process_pool

if __name__ == "__main__":
    pool = process_pool(3)
    try:
        pool.submit(operator.index, 1)
        os.killpg(0, signal.SIGINT)
        pool.submit(operator.index, 2).result()
    except KeyboardInterrupt:
        pool.shutdown(cancel_futures=True)
        print("interrupted")
"""


def test_an_interrupt_while_workers_start_is_quiet(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(INTERRUPTED)
    command = [sys.executable, "-P", str(program)]
    run = subprocess.run(command, capture_output=True, text=True, start_new_session=True, timeout=60, check=False)
    assert (run.returncode, run.stdout, run.stderr) == (0, "interrupted\n", "")


STARTER = """
import subprocess, sys
from handsight.jobs.processes import bound_command
process = subprocess.Popen(bound_command(sys.argv[1:]), stdin=subprocess.PIPE)
print(process.pid, flush=True)
sys.stdin.read()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="asks the kernel for what others do not have")
def test_a_bound_program_ends_with_a_killed_parent() -> None:
    with Popen([sys.executable, "-P", "-c", STARTER, *SLEEPER], stdin=PIPE, stdout=PIPE) as parent:
        assert parent.stdout is not None
        program = os.pidfd_open(int(parent.stdout.readline()))
        gone = select.poll()
        gone.register(program, select.POLLIN)
        parent.kill()
    assert gone.poll(60_000), "it goes on without its parent"
    os.close(program)


def test_a_bound_program_gets_its_arguments_and_tells_its_status() -> None:
    command = bound_command([sys.executable, "-c", "import sys; print(sys.argv[1:]); sys.exit(3)", "a b", "--c"])
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout) == (3, "['a b', '--c']\n")


@pytest.mark.skipif(sys.platform != "linux", reason="asks the kernel for what others do not have")
def test_a_program_whose_parent_is_gone_already_does_not_begin() -> None:
    command = bound_command(["true"])
    command[5] = "1"
    assert subprocess.run(command, check=False).returncode == 1


POOL = """
import os, sys
from handsight.jobs.processes import process_pool

if __name__ == "__main__":
    pool = process_pool(2)
    workers = [pool.submit(os.getpid) for _ in range(2)]
    print(*{worker.result() for worker in workers}, flush=True)
    pool.submit(sys.stdin.read)
    sys.stdin.read()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="waits for processes that are no children of its own")
def test_workers_end_with_a_killed_parent_also_while_they_work(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(POOL)
    gone = select.poll()
    with Popen([sys.executable, "-P", str(program)], stdin=PIPE, stdout=PIPE) as parent:
        assert parent.stdout is not None
        workers = [os.pidfd_open(int(pid)) for pid in parent.stdout.readline().split()]
        for worker in workers:
            gone.register(worker, select.POLLIN)
        parent.kill()
    for _ in workers:
        ended = gone.poll(60_000)
        assert ended, "one goes on without its parent"
        gone.unregister(ended[0][0])
    for worker in workers:
        os.close(worker)
