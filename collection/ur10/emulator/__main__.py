"""``python -m handsight.collection.ur10.emulator``: an emulated rig in a process of its own.

It prints one line of JSON once everything listens, and ends on SIGTERM, on SIGINT, or with the process that started
it.
"""

from __future__ import annotations

import argparse
import asyncio
import ctypes
import json
import os
import signal
import sys
from collections.abc import Sequence

from handsight.collection.ur10.emulator.generation import E_SERIES, GENERATIONS
from handsight.collection.ur10.emulator.rig import EmulatedRig, RigSettings, serve_until
from handsight.collection.ur10.emulator.world import BareWorld

_PR_SET_PDEATHSIG = 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Run until told to end."""
    parser = argparse.ArgumentParser(prog="python -m handsight.collection.ur10.emulator", description=__doc__)
    parser.add_argument("--robot", default="127.0.0.2", help="loopback address of controller and gripper")
    parser.add_argument("--generation", choices=sorted(GENERATIONS), default=E_SERIES.name)
    parser.add_argument("--control", type=int, metavar="PORT", help="port of the robot's address for faults")
    parser.add_argument("--speed", type=float, default=1.0, help="robot time per wall time, at most")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    _end_with_parent()
    settings = RigSettings(
        robot=options.robot, generation=GENERATIONS[options.generation], speed=options.speed, seed=options.seed
    )
    return asyncio.run(_serve(settings))


async def _serve(settings: RigSettings) -> int:
    rig = EmulatedRig(settings, BareWorld())
    try:
        await rig.open()
    except OSError as error:
        sys.stderr.write(f"cannot listen on {settings.robot}: {error}\n")
        return 2
    stopped = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stopped.set)
    sys.stdout.write(
        json.dumps({"ready": True, "robot": settings.robot, "generation": settings.generation.name, "pid": os.getpid()})
        + "\n"
    )
    sys.stdout.flush()
    await serve_until(rig, stopped)
    return 0


def _end_with_parent() -> None:
    """Have the kernel end this process when the one that started it is gone, even killed."""
    parent = os.getppid()
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != parent:
            raise SystemExit(0)


if __name__ == "__main__":
    sys.exit(main())
