"""Contact, told from the vertical force over a baseline that was taken at standstill.

A CB3 has no sensor to be zeroed, and ``moveUntilContact`` signals success there without having moved.
"""

from __future__ import annotations

from dataclasses import dataclass

from handsight.collection.ur10.arm_state import ArmState


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """How a descent ended."""

    contact: bool
    force_n: float
    """Upward, over the baseline: the greatest until the arm stood; 0 without contact."""
    baseline_n: float
    tcp_pose: tuple[float, ...]
    """Where the arm stands afterwards."""
    first_tcp_pose: tuple[float, ...]
    """Where the first of the readings over the threshold was taken: as ``tcp_pose`` without contact."""


class ContactWatch:
    """Looks for so many readings in a row over a threshold, since a single one may be noise.

    Args:
        baseline_n: Vertical force at standstill.
        threshold_n: Over the baseline.
        samples: How many in a row are a contact.
    """

    def __init__(self, baseline_n: float, threshold_n: float, samples: int) -> None:
        self._baseline_n, self._threshold_n, self._samples = baseline_n, threshold_n, samples
        self._over = 0
        self._peak_n = 0.0
        self._first_tcp_pose: tuple[float, ...] = ()

    @property
    def contact(self) -> bool:
        """Whether the last readings are one."""
        return self._over >= self._samples

    def seen(self, state: ArmState) -> bool:
        """Count a reading; returns whether there is contact."""
        force_n = state.force_n[2] - self._baseline_n
        self._over = self._over + 1 if force_n >= self._threshold_n else 0
        if self._over == 1:
            self._first_tcp_pose = state.tcp_pose
        self._peak_n = max(self._peak_n, force_n)
        return self.contact

    def touch(self, standing: ArmState) -> Touch:
        """How the descent ended, from the reading at which the arm stands."""
        if not self.contact:
            pose = standing.tcp_pose
            return Touch(contact=False, force_n=0.0, baseline_n=self._baseline_n, tcp_pose=pose, first_tcp_pose=pose)
        return Touch(
            contact=True,
            force_n=max(self._peak_n, standing.force_n[2] - self._baseline_n),
            baseline_n=self._baseline_n,
            tcp_pose=standing.tcp_pose,
            first_tcp_pose=self._first_tcp_pose,
        )
