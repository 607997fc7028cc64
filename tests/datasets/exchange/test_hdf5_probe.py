"""Damage that makes the HDF5 library hang or crash is refused, and the process lives."""

from __future__ import annotations

import base64
import zlib
from pathlib import Path

import pytest

from handsight.datasets import InterchangeError, import_dataset
from handsight.datasets.exchange.hdf5_probe import refuse_unreadable

SOUND = zlib.decompress(
    base64.b85decode(
        "c-rgqaB<`1lHy_j0S*oZ76t(ZWbhvf7$ng6P>=wn8KHCslwQFE6K4j?LA3)-hnTOx4B=-$#Y2KzU6IX4w`UZLY~bPQ7yzOppnMJ}"
        "eS!&99V{INP|03FXnI9Y*E|d!Q2V$TM1ZczNX$zq&P>lJfvS^aWCZIJfV+tU#eJeko?sk}-cc|LM!^68cV~YeMh0j>g<d`ZLA6qG"
        "az<)yVtiR@QE_H|o|2V<Q7w}G6a1rLI0{C=C>RB!U=)mkQ7{Td!6+C7qhJ&ab^rkV#5aQ"
    )
)
"""A file of HDF5 2.0 with one attribute of text."""

DAMAGE = {"hangs": (2072, 3, "does not come to an end"), "crashes": (857, 1, "crashes on it")}
"""Byte and bit that are flipped, and what the library does then."""


@pytest.mark.parametrize("name", DAMAGE)
def test_a_file_on_which_the_library_fails_is_refused(tmp_path: Path, name: str) -> None:
    byte, bit, message = DAMAGE[name]
    damaged = bytearray(SOUND)
    damaged[byte] ^= 1 << bit
    (tmp_path / "bad.hdf5").write_bytes(damaged)
    with pytest.raises(InterchangeError, match=f"is damaged: the HDF5 library {message}"):
        import_dataset(tmp_path / "bad.hdf5", tmp_path / "new")
    assert [path.name for path in tmp_path.iterdir()] == ["bad.hdf5"]


def test_what_can_be_read_passes(tmp_path: Path) -> None:
    (tmp_path / "good.hdf5").write_bytes(SOUND)
    refuse_unreadable(tmp_path / "good.hdf5")
    (tmp_path / "cut.hdf5").write_bytes(SOUND[:3000])
    refuse_unreadable(tmp_path / "cut.hdf5")
