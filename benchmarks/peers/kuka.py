"""The grasping environment that comes with PyBullet, as a peer: installed beside handsight, run on the same core."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from benchmarks.floors.processes import pinned
from handsight.datasets.address import cache_folder

NAME = "KukaDiverseObjectEnv"
REQUIREMENTS = ("gym==0.25.2", "setuptools<81", "numpy<2", f"pybullet=={version('pybullet')}")
SCRIPT = Path(__file__).with_name("kuka_episodes.py")
INSTALL_LIMIT_S = 300.0
RUN_LIMIT_S = 600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer:
    """What was measured of a peer, or why nothing was."""

    per_hour: dict[str, float]
    """Rates by name; empty where the peer could not be run."""
    what: str
    """How they were measured, or why not, as a sentence."""


def kuka_peer(episodes: int, core: int) -> Peer:
    """Play episodes on one core; the peer is left out, with the reason, where it cannot be installed or run."""
    try:
        python = environment(cache_folder() / "benchmarks" / "kuka", REQUIREMENTS)
        with pinned({core}):
            printed = _call([python, "-P", SCRIPT, str(episodes)], limit_s=RUN_LIMIT_S)
    except (OSError, subprocess.SubprocessError) as error:
        return Peer(per_hour={}, what=f"{NAME} is left out: {_reason(error)}.")
    counts = json.loads(printed.splitlines()[-1])
    hours = counts["elapsed_s"] / 3600
    return Peer(
        per_hour={NAME: counts["attempts"] / hours, f"{NAME} episodes": counts["episodes"] / hours},
        what=(
            f"{NAME} of PyBullet plays {episodes} episodes of random actions with its own settings, 48x48 pictures and "
            f"nothing stored; an attempt is an episode in which the gripper closed ({counts['attempts']} did)."
        ),
    )


def environment(folder: Path, requirements: Sequence[str]) -> Path:
    """The interpreter of a virtual environment with ``requirements``, made on first use.

    Raises:
        OSError: The folder cannot be written.
        subprocess.SubprocessError: The environment could not be made or filled, or that took too long.
    """
    python, stamp = folder / "bin" / "python", folder / "requirements.txt"
    wanted = "\n".join(requirements) + "\n"
    if stamp.is_file() and stamp.read_text() == wanted:
        return python
    _call([sys.executable, "-m", "venv", "--clear", folder], limit_s=INSTALL_LIMIT_S)
    install = (python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--retries", "1")
    _call([*install, *requirements], limit_s=INSTALL_LIMIT_S)
    # Written last, so that an environment without it is one that was never finished.
    stamp.write_text(wanted)
    return python


def _call(command: Sequence[str | Path], *, limit_s: float) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=limit_s).stdout


def _reason(error: OSError | subprocess.SubprocessError) -> str:
    if isinstance(error, subprocess.CalledProcessError):
        said = (error.stderr or error.stdout).strip().splitlines()
        return said[-1].rstrip(".") if said else f"its exit status is {error.returncode}"
    return str(error)
