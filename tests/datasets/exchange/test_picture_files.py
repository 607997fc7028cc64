"""Picture files are looked at before they are decoded, and refused for what is wrong with them."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from handsight.datasets import InterchangeError
from handsight.datasets.exchange.picture_files import read_colours, read_depth

SIZE = (6, 8)
RNG = np.random.default_rng(0)
COLOURS = RNG.integers(0, 256, (*SIZE, 3), dtype=np.uint8)
DEPTH = RNG.integers(0, 2**16, SIZE, dtype=np.uint16)


def encoded(picture: NDArray[Any], suffix: str = ".png") -> bytes:
    return cv2.imencode(suffix, picture)[1].tobytes()


@pytest.mark.parametrize("suffix", [".png", ".tiff", ".bmp", ".ppm"])
def test_colours_come_back_to_the_bit(tmp_path: Path, suffix: str) -> None:
    (tmp_path / "c").write_bytes(encoded(COLOURS, suffix))
    np.testing.assert_array_equal(read_colours(tmp_path, "c", SIZE), COLOURS[:, :, ::-1])


@pytest.mark.parametrize("suffix", [".png", ".tiff", ".pgm"])
def test_depth_comes_back_to_the_bit(tmp_path: Path, suffix: str) -> None:
    (tmp_path / "d").write_bytes(encoded(DEPTH, suffix))
    np.testing.assert_array_equal(read_depth(tmp_path, "d", SIZE), DEPTH)


def claiming(width: int, height: int) -> bytes:
    """A PNG whose head claims a size, with a checksum that fits."""
    data = bytearray(encoded(COLOURS))
    data[16:24] = struct.pack(">II", width, height)
    data[29:33] = struct.pack(">I", zlib.crc32(bytes(data[12:29])))
    return bytes(data)


def flipped() -> bytes:
    data = bytearray(encoded(COLOURS))
    data[60] ^= 4
    return bytes(data)


BAD_COLOURS: dict[str, tuple[bytes, str]] = {
    "depth": (encoded(DEPTH), "is uint16 \\(6, 8\\), expected three 8-bit colours"),
    "16 bits": (encoded(COLOURS.astype(np.uint16)), "is uint16 \\(6, 8, 3\\), expected"),
    "grey": (encoded(COLOURS[:, :, 0]), "is uint8 \\(6, 8\\)"),
    "transparent": (encoded(np.dstack([COLOURS, COLOURS[:, :, 0]])), "uint8 \\(6, 8, 4\\), with transparency"),
    "other size": (encoded(COLOURS[1:]), "has 8x5 pixels, expected 8x6"),
    "bomb": (claiming(200_000, 200_000), r"cannot be decoded \(Image size \(40000000000 pixels\) exceeds"),
    "large": (claiming(8000, 8000), "has 8000x8000 pixels, expected 8x6"),
    "no width": (claiming(0, 6), "'c' (has 0x6|cannot be decoded)"),
    "cut": (encoded(COLOURS)[:-40], "cannot be decoded"),
    "a bit": (flipped(), r"cannot be decoded \(.*\), expected an undamaged file of PNG, TIFF"),
    "empty": (b"", "does not exist or is empty"),
    "text": (b"overhead_rgb,overhead_depth", "cannot be decoded"),
    "a float picture": (encoded(COLOURS, ".hdr"), "cannot be decoded"),
    "a flood": (encoded(COLOURS) + bytes(2**24 + 2**20), r"takes \d+ bytes, expected at most"),
}


@pytest.mark.parametrize("case", BAD_COLOURS)
def test_a_bad_picture_is_refused_by_name(tmp_path: Path, case: str) -> None:
    data, message = BAD_COLOURS[case]
    (tmp_path / "c").write_bytes(data)
    with pytest.raises(InterchangeError, match=message) as caught:
        read_colours(tmp_path, "c", SIZE)
    assert "picture 'c'" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_depth_of_8_bits_is_refused(tmp_path: Path) -> None:
    (tmp_path / "d").write_bytes(encoded(COLOURS[:, :, 0]))
    with pytest.raises(InterchangeError, match="is uint8 \\(6, 8\\), expected one 16-bit channel"):
        read_depth(tmp_path, "d", SIZE)


def link_outside(folder: Path) -> None:
    (folder.parent / "c.png").write_bytes(encoded(COLOURS))
    (folder / "link").symlink_to(folder.parent / "c.png")


def link_in_a_circle(folder: Path) -> None:
    (folder / "link").symlink_to("link")


PLACES: dict[str, tuple[Callable[[Path], object], str, str]] = {
    "outside": (link_outside, "link", "is not in the folder"),
    "a circle": (link_in_a_circle, "link", "cannot be read|does not exist|is not in the folder"),
    "a folder": (lambda folder: (folder / "c").mkdir(), "c", "does not exist or is empty"),
    "a pipe": (lambda folder: os.mkfifo(folder / "c"), "c", "does not exist or is empty"),
    "nothing": (lambda folder: None, "c", "does not exist or is empty"),
    "no name": (lambda folder: None, "", "is not in the folder"),
    "a NUL": (lambda folder: None, "a\0b", "cannot be read|does not exist|is not in the folder"),
    "a long name": (lambda folder: None, "a" * 300, "cannot be read: File name too long|does not exist"),
}


@pytest.mark.parametrize("case", PLACES)
def test_what_is_no_file_of_the_folder_is_refused(tmp_path: Path, case: str) -> None:
    make, name, message = PLACES[case]
    folder = tmp_path / "photos"
    folder.mkdir()
    make(folder)
    with pytest.raises(InterchangeError, match=message):
        read_colours(folder, name, SIZE)
