"""The camera as the station sees it: pictures that were looked at, and the ladder for when there are none."""

from __future__ import annotations

import hashlib
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

from handsight.collection.errors import CameraLostError, DeviceError, DeviceLostError
from handsight.collection.ur10.camera_client import OpenCamera, Picture
from handsight.collection.ur10.camera_source import CameraDescription
from handsight.collection.ur10.child import SupervisedChild
from handsight.collection.ur10.rig import CameraConfig

OPEN_S = 30.0
RESET_S = 40.0
POWER_CYCLE_S = 60.0
BACK_S, BACK_POLL_S = 20.0, 0.5
"""How long a camera that was switched off and on is waited for."""
SLACK_S = 5.0
BLACK_LEVEL = 4
"""Mean of a picture's levels up to which it shows nothing."""

Note = Callable[[str], None]
"""Told about every step of the ladder."""


class Camera:
    """The camera on the gripper."""

    def __init__(self, config: CameraConfig, *, note: Note = lambda text: None, log: Path | None = None) -> None:
        """Nothing is started yet.

        Args:
            config: Which one, and its limits.
            note: Told what the ladder does.
            log: File for what the library prints.
        """
        self.config = config
        self.child = SupervisedChild("camera", OpenCamera(config), open_timeout_s=OPEN_S, log=log)
        self._note = note
        self._last: tuple[int, float, bytes] | None = None
        self.recoveries = 0
        """Pictures that took more than a retry."""

    def description(self) -> CameraDescription:
        """What the camera says it is."""
        found: CameraDescription = self.child.ask("description", timeout_s=OPEN_S)
        return found

    def picture(self) -> Picture:
        """A picture that is new and shows something, if need be by way of the ladder.

        Raises:
            CameraLostError: No step of the ladder helped.
        """
        reason = ""
        for number, (name, step) in enumerate(self._ladder()):
            try:
                step()
                picture = self._checked()
            except DeviceError as error:
                reason = str(error)
                self._note(f"camera: {name}: {reason}")
                continue
            self.recoveries += number > 1
            return picture
        raise CameraLostError(f"no usable picture, whatever was tried; last: {reason}")

    def _ladder(self) -> list[tuple[str, Callable[[], None]]]:
        steps: list[tuple[str, Callable[[], None]]] = [
            ("picture", lambda: None),
            ("retry", lambda: None),
            ("stream restarted", lambda: self.child.ask("restart", timeout_s=OPEN_S)),
            ("hardware reset", lambda: self.child.ask("hardware_reset", timeout_s=RESET_S)),
            ("process replaced", self._respawn),
        ]
        if self.config.power_cycle:
            steps.append(("USB power switched", self._power_cycle))
        return steps

    def _respawn(self) -> None:
        self.child.kill()
        self.child.start()

    def _power_cycle(self) -> None:
        """Run the operator's command, as replugging cures what a reset does not."""
        self.child.kill()
        try:
            done = subprocess.run(
                self.config.power_cycle, timeout=POWER_CYCLE_S, capture_output=True, text=True, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise DeviceError(f"camera.power_cycle: {error}") from error
        if done.returncode:
            raise DeviceError(f"camera.power_cycle ended with status {done.returncode}: {done.stderr.strip()[:200]}")
        until = time.monotonic() + BACK_S
        while True:
            try:
                self.child.start()
                return
            except DeviceError:
                # The bus takes seconds to find it again.
                if time.monotonic() > until:
                    raise
                time.sleep(BACK_POLL_S)

    def _checked(self) -> Picture:
        timeout_s = self.config.timeout_s
        picture: Picture = self.child.ask("picture", timeout_s, timeout_s=timeout_s + SLACK_S)
        digest = hashlib.blake2b(picture.rgb.tobytes(), digest_size=16).digest()
        last, self._last = self._last, (picture.number, picture.timestamp_ms, digest)
        fault = picture_fault(picture, digest, last, self.config.least_valid)
        if fault:
            raise DeviceLostError(f"camera: {fault}")
        return picture

    def close(self) -> None:
        """End the child."""
        self.child.close()


def picture_fault(picture: Picture, digest: bytes, last: tuple[int, float, bytes] | None, least_valid: float) -> str:
    """What is wrong with a picture; empty where nothing is.

    Args:
        picture: The picture.
        digest: Of its colours.
        last: Number, time [ms] and digest of the one before.
        least_valid: Share of the depth that must have been measured.
    """
    if last is not None and (picture.number, picture.timestamp_ms) == last[:2]:
        return f"frame {picture.number} came again: the stream is stale"
    if picture.rgb.mean() <= BLACK_LEVEL:
        return f"the picture is black (mean level {picture.rgb.mean():.1f})"
    if last is not None and digest == last[2]:
        return f"frame {picture.number} has the pixels of the one before: the stream is frozen"
    if picture.valid < least_valid:
        return f"{picture.valid:.0%} of the depth is valid, expected at least {least_valid:.0%}"
    return ""
