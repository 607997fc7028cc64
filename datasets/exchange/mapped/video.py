"""Frames of videos, decoded one after the other, because seeking is inexact between key frames."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handsight.datasets.errors import InterchangeError
from handsight.datasets.format.quantities import PICTURE_SIDE
from handsight.datasets.machine import machine_blamed

_QUIET = "-8"
"""FFmpeg's level for no messages: what is wrong with a video is in the error that is raised."""


class VideoFrames:
    """The frames of one video after another; asking for one before the last that was asked for begins anew."""

    def __init__(self) -> None:
        self._path: Path | None = None
        self._capture: Any = None
        self._next = 0

    def close(self) -> None:
        """Close the file that is open."""
        if self._capture is not None:
            self._capture.release()
        self._path, self._capture, self._next = None, None, 0

    def frame(self, path: Path, number: int, *, codec: str) -> NDArray[np.uint8]:
        """A frame, counted from 0. Shape (H, W, 3).

        Raises:
            InterchangeError: The video cannot be decoded up to there.
        """
        if path != self._path or number < self._next:
            self._open(path, codec)
        while self._next < number and self._capture.grab():
            self._next += 1
        found, bgr = self._capture.read() if self._next == number else (False, np.empty(0))
        if not found:
            raise InterchangeError(
                f"frame {number} of the video {path} (codec {codec}) cannot be decoded: encode it as H.264, or store "
                "the pictures as images"
            )
        self._next += 1
        rgb: NDArray[np.uint8] = cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB).astype(np.uint8)
        return rgb

    def _open(self, path: Path, codec: str) -> None:
        self.close()
        if not path.is_file():
            raise InterchangeError(f"there is no video {path}")
        # OpenCV says of every video that it cannot open it, and never why.
        with machine_blamed(f"the video {path} cannot be read"):
            path.open("rb").close()
        os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", _QUIET)
        level = cv2.utils.logging.getLogLevel()
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        try:
            capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
        finally:
            cv2.utils.logging.setLogLevel(level)
        sides = [capture.get(side) for side in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)]
        if not capture.isOpened() or any(PICTURE_SIDE.impossible(side) for side in sides):
            capture.release()
            raise InterchangeError(
                f"the video {path} (codec {codec}) cannot be decoded: encode it as H.264, or store its pictures as "
                "images"
            )
        self._path, self._capture = path, capture
