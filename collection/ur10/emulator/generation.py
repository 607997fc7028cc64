"""The two controllers that a UR10 can have, as far as their clients can tell."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Generation:
    """One generation of controllers."""

    name: str
    version: tuple[int, int, int, int]
    released: str
    control_hz: float
    force_sensor: bool
    """Whether forces are measured at the flange, or estimated from the currents of the joints."""
    force_noise_n: float
    """Standard deviation of a force reading at standstill [N]."""
    torque_noise_nm: float
    force_bias_n: float
    """Largest error that stays the same as long as the arm does: what subtracting a baseline takes out [N]."""
    remote_control: bool
    """Whether the controller knows remote and local control."""

    @property
    def dashboard_version(self) -> str:
        """The answer to ``PolyscopeVersion``."""
        return f"URSoftware {'.'.join(map(str, self.version))} ({self.released})"


CB3 = Generation(
    name="cb3",
    version=(3, 15, 8, 106339),
    released="Aug 10 2022",
    control_hz=125.0,
    force_sensor=False,
    # Estimated from currents: +-10 N and +-5 Nm, most of it slow error.
    force_noise_n=2.0,
    torque_noise_nm=0.7,
    force_bias_n=8.0,
    remote_control=False,
)
E_SERIES = Generation(
    name="e-series",
    version=(5, 11, 1, 108318),
    released="Oct 05 2021",
    control_hz=500.0,
    force_sensor=True,
    force_noise_n=0.6,
    torque_noise_nm=0.05,
    force_bias_n=2.0,
    remote_control=True,
)
GENERATIONS = {generation.name: generation for generation in (CB3, E_SERIES)}
