"""Which code and which packages recorded a session."""

from __future__ import annotations

import functools
import platform
import shutil
import subprocess
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import handsight

_PACKAGES = ("icechunk", "numcodecs", "numpy", "pybullet", "pyrealsense2", "torch", "ur-rtde", "zarr")
"""Packages whose version can change what is recorded."""


def utc_now() -> str:
    """The time, to the second, in ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="seconds")


@functools.cache
def code_version() -> dict[str, Any]:
    """The release of handsight and, where it runs from a git checkout, its commit and whether files differ from it."""
    package = Path(handsight.__file__).resolve()
    root = package.parents[2]
    code: dict[str, Any] = {"version": handsight.__version__, "commit": None, "dirty": None}
    # Asking git only where the checkout is ours: an installed copy may lie inside a checkout of something else.
    if (root / ".git").exists() and package.parent == root / "src" / "handsight" and shutil.which("git"):
        commit = _git(root, "rev-parse", "HEAD")
        if commit:
            changes = _git(root, "status", "--porcelain")
            code.update(commit=commit, dirty=None if changes is None else changes != "")
    return code


@functools.cache
def package_versions() -> dict[str, str]:
    """Versions of Python and of the packages that can change what is recorded, where they are installed."""
    versions = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    return versions


def _git(root: Path, *arguments: str) -> str | None:
    command = ["git", "-C", str(root), *arguments]
    answer = subprocess.run(command, capture_output=True, text=True, check=False, timeout=30)
    return answer.stdout.strip() if answer.returncode == 0 else None
