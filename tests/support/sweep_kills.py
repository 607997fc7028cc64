"""``python -P tests/support/sweep_kills.py --kills 30``: a sweep killed at random moments, and finished all the same.

The whole process group is killed with SIGKILL, workers included, and the same call begins again. What is there of a
cell that was done never changes: no cell is trained twice. In the end every cell is as in a sweep that was left alone.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import types
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
if "tests" not in sys.modules:
    # The root stays off the import path: its folder ``datasets`` shadows a well-known package.
    sys.modules["tests"] = types.ModuleType("tests")
    sys.modules["tests"].__path__ = [str(ROOT / "tests")]

import numpy as np  # noqa: E402 -- once `tests` is known
from tests.support.swept import make_swept  # noqa: E402

LIMIT_S = 300.0
_EARLIEST_S = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Killed:
    """What was seen."""

    kills: int
    done_at: tuple[int, ...]
    """Cells that were done after each kill."""
    changed: tuple[str, ...]
    """Cells that were done, and were written to again."""
    differing: tuple[str, ...]
    """Cells that came out otherwise than in a sweep that was left alone."""
    left: tuple[str, ...]
    """Locks, checkpoints and unfinished files that were left in the end."""


def kill_sweep(folder: Path, *, kills: int, seed: int, trials: int = 10) -> Killed:
    """Run a sweep of ``6 * trials`` cells in an empty folder, killing it again and again."""
    data = make_swept(folder / "grasps")
    words = [sys.executable, "-P", "-c", "from handsight.cli.app import main; main()", "ablate", "run", data]
    words += ["--sizes", "12,20", "--held-out", "0.34", "--trials", str(trials), "--epochs", "6"]
    whole, out = folder / "whole", folder / "out"
    subprocess.run([*words, "--out", str(whole)], check=True, capture_output=True, timeout=LIMIT_S)
    rng, done, done_at, changed = np.random.default_rng(seed), {}, [], set()
    latest_s = _EARLIEST_S + 6.0
    for _ in range(kills):
        started = subprocess.Popen(
            [*words, "--out", str(out)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )
        try:
            started.wait(rng.uniform(_EARLIEST_S, latest_s))
        except subprocess.TimeoutExpired:
            os.killpg(started.pid, signal.SIGKILL)
            started.wait()
        now = _metrics(out)
        changed |= {name for name, content in done.items() if now.get(name) != content}
        done = now
        done_at.append(len(done))
    subprocess.run([*words, "--out", str(out)], check=True, capture_output=True, timeout=LIMIT_S)
    now, expected = _metrics(out), _metrics(whole)
    changed |= {name for name, content in done.items() if now.get(name) != content}
    return Killed(
        kills=kills,
        done_at=tuple(done_at),
        changed=tuple(sorted(changed)),
        differing=tuple(sorted(name for name in expected if _found(now.get(name)) != _found(expected[name]))),
        left=tuple(sorted(str(path.relative_to(out)) for path in out.rglob("*") if _is_leftover(path))),
    )


def _metrics(out: Path) -> dict[str, bytes]:
    return {path.parent.name: path.read_bytes() for path in out.glob("cells/*/metrics.json")}


def _found(content: bytes | None) -> Any:
    """What a cell found, without the time that it took."""
    if content is None:
        return None
    result = json.loads(content)["result"]
    return {name: value for name, value in result.items() if name not in ("seconds", "processor_s")}


def _is_leftover(path: Path) -> bool:
    return path.name.startswith(".") or path.suffix in (".lock", ".ckpt")


def main() -> int:
    """Print what was seen; exit status 1 where something was lost, done twice or left."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="sweep-kills-") as folder:
        seen = kill_sweep(Path(folder), kills=options.kills, seed=options.seed)
    print(seen)
    return int(bool(seen.changed or seen.differing or seen.left))


if __name__ == "__main__":
    sys.exit(main())
