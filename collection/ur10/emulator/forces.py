"""What the emulated controller reports as the force on the tool.

``actual_TCP_force`` is what the world does to the tool, in base axes: an upward push of the table is positive z, the
weight of a payload that the controller was not told of is negative z, and its lever on the tool a torque. An e-Series
arm has a sensor in its flange, whose offset turns with it; a CB3 estimates from the currents of its joints, with an
error of up to 10 N that changes with the pose and grows while the arm accelerates. Both are filtered, so that a blow
shows within some ten milliseconds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handsight.collection.ur10.emulator.generation import Generation

GRAVITY_M_S2 = 9.81
FILTER_S = 0.01
"""Time constant of the filter."""
NEGLIGIBLE_N = 1e-6
ACCELERATION_ERROR_N = 1.0
"""Error of an estimate from currents for each rad/s2 of the joint that accelerates most."""
MOST_ACCELERATION_ERROR_N = 25.0


@dataclass(frozen=True, slots=True)
class Payload:
    """What hangs on the flange."""

    mass_kg: float = 1.3
    centre_m: tuple[float, ...] = (0.0, 0.0, 0.06)
    """Of mass, in the flange frame."""

    def moment_kg_m(self, about_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Mass times lever about a point of the flange frame. Shape (3,)."""
        return self.mass_kg * (np.asarray(self.centre_m) - about_m)


class ForceSensor:
    """One controller's force reading."""

    def __init__(self, generation: Generation, rng: np.random.Generator, *, true_payload: Payload) -> None:
        self._generation = generation
        self._rng = rng
        self._true_payload = true_payload
        self._rotation = np.eye(3)
        # How the error of the estimate depends on the joints: slow waves of its own for each axis.
        self._waves = rng.normal(size=(3, 6))
        self._constant_n = rng.uniform(-1, 1, size=3) * generation.force_bias_n
        self._zero_n = np.zeros(3)
        self._raw_n = np.zeros(3)
        self.contact_n = np.zeros(3)
        """Force of the contacts, filtered and without any error: what the safety system stops on."""
        self._touching = False
        self.wrench: list[float] = [0.0] * 6
        self.extra_noise_n = 0.0
        """Fault: additional noise."""
        self.drift_n_s = 0.0
        """Fault: the vertical reading walks away."""
        self._drifted_n = 0.0

    @property
    def pressing_n(self) -> float:
        """Size of the filtered force [N]."""
        return math.sqrt(float(self.contact_n @ self.contact_n)) if self._touching else 0.0

    def feel(self, seconds: float, contact_n: NDArray[np.float64]) -> None:
        """Filter what presses on the arm, for one period."""
        touches = bool(contact_n.any())
        if touches or self._touching:
            self.contact_n = self.contact_n + min(seconds / FILTER_S, 1.0) * (contact_n - self.contact_n)
            self._touching = touches or float(np.abs(self.contact_n).max()) > NEGLIGIBLE_N
            if not self._touching:
                self.contact_n = np.zeros(3)

    def read(
        self,
        seconds: float,
        *,
        joints_rad: NDArray[np.float64],
        acceleration_rad_s2: float,
        pose_base_tool: NDArray[np.float64],
        tool_m: NDArray[np.float64],
        told: Payload,
    ) -> None:
        """Take a reading, so long after the last one.

        Args:
            seconds: Since the last one.
            joints_rad: Shape (6,).
            acceleration_rad_s2: Of the joint that accelerates most.
            pose_base_tool: Shape (4, 4); the tool is not turned against the flange.
            tool_m: Where the tool is in the flange frame. Shape (3,).
            told: What the controller thinks that hangs there.
        """
        self._rotation = pose_base_tool[:3, :3]
        error_n = self._rotation @ self._constant_n
        if not self._generation.force_sensor:
            error_n = self._generation.force_bias_n * np.sin(self._waves @ joints_rad)
            worse_n = min(ACCELERATION_ERROR_N * acceleration_rad_s2, MOST_ACCELERATION_ERROR_N)
            error_n = error_n + worse_n * np.sin(self._waves @ joints_rad[::-1])
        self._drifted_n += self.drift_n_s * seconds
        true = self._true_payload
        gravity_m_s2 = np.array([0.0, 0.0, -GRAVITY_M_S2])
        unknown_n = (true.mass_kg - told.mass_kg) * gravity_m_s2
        unknown_kg_m = self._rotation @ (true.moment_kg_m(tool_m) - told.moment_kg_m(tool_m))
        torque_nm = np.cross(unknown_kg_m, gravity_m_s2)
        self._raw_n = self.contact_n + error_n + unknown_n + np.array([0.0, 0.0, self._drifted_n])
        noise_n = math.hypot(self._generation.force_noise_n, self.extra_noise_n)
        noise = self._rng.standard_normal(6)
        force_n = self._raw_n - self._rotation @ self._zero_n + noise_n * noise[:3]
        self.wrench = [*force_n.tolist(), *(torque_nm + self._generation.torque_noise_nm * noise[3:]).tolist()]

    def zero(self) -> None:
        """``zero_ftsensor``: what is felt now counts as nothing. An arm without a sensor has nothing to zero."""
        if self._generation.force_sensor:
            self._zero_n = self._rotation.T @ self._raw_n

    def calm(self) -> None:
        """Take the faults out."""
        self.extra_noise_n = self.drift_n_s = self._drifted_n = 0.0
