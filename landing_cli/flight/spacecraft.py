"""The spacecraft: mass, thrust and propellant."""

from __future__ import annotations

from dataclasses import dataclass

STANDARD_GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True)
class Spacecraft:
    """A point mass with one throttleable thruster that points anywhere.

    Attributes
    ----------
    mass_kg : float
        Initial mass.
    thrust_max_n : float
        Largest thrust.
    isp_s : float
        Specific impulse, s.
    propellant_kg : float or None
        Propellant on board; None leaves it unbounded.
    """

    mass_kg: float
    thrust_max_n: float
    isp_s: float
    propellant_kg: float | None = None

    @property
    def exhaust_velocity_m_s(self) -> float:
        """Effective exhaust velocity, m/s."""
        return self.isp_s * STANDARD_GRAVITY_M_S2
