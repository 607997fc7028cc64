"""Walking through a file comes to an end, whatever links it holds."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from handsight.datasets.exchange.hdf5_walk import walk


def test_walking_comes_to_an_end_and_follows_no_link(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "odd.hdf5", "w") as file:
        group = file
        for _ in range(40):
            below = group.create_group("left")
            group["right"] = below
            group = below
        group["up"] = file
        file["nowhere"] = h5py.SoftLink("/missing")
        file["outside"] = h5py.ExternalLink("/dev/null", "/")
        file["numbers"] = np.arange(3)
        file.create_dataset("large", shape=(10**9,), dtype="u1", chunks=(10**6,))
        seen: set[int] = set()
        walk(file, seen)
        assert len(seen) == 40 + 3
