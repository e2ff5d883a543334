"""Stored controls: what suffices to fly a stage of a landing again, open loop."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityField

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ThrustNodesLeg:
    """Thrust that is constant over equal intervals.

    Attributes
    ----------
    duration_s : float, s
    thrust_n : (n, 3) float, N
        In the inertial axes that coincide with the body axes at the end of the leg.
    """

    duration_s: float
    thrust_n: FloatArray


@dataclass(frozen=True, eq=False)
class CostateLeg:
    """The energy-optimal thrust that follows from initial costates (Zhao 2022, eqs 8-11).

    Attributes
    ----------
    duration_s : float, s
    costates : (7,) float
        Initial costates of position, velocity and mass in the body frame, scaled by length
        ``a0 duration^2``, time ``duration`` and mass ``mass_kg``, with lambda0 = 1/2, where
        ``a0 = thrust_max_n / mass_kg``.
    position_m, velocity_m_s : (3,) float, m, m/s, body frame
        Planned state at the start of the leg.
    mass_kg : float, kg
        Planned mass at the start of the leg.
    thrust_max_n : float, N
    gravity : GravityField
        The field that the control was planned in.
    """

    duration_s: float
    costates: FloatArray
    position_m: FloatArray
    velocity_m_s: FloatArray
    mass_kg: float
    thrust_max_n: float
    gravity: GravityField


@dataclass(frozen=True, eq=False)
class FinalArcLeg:
    """The final landing stage: a cubic arc to rest on the target (Zhao 2022, eqs 13-14).

    With time-to-go s the planned arc is ``r - r_c = s^2 (A + B s)`` in the rotating frame. The thrust
    cancels gravity, Coriolis and centrifugal acceleration along the planned arc, so it is a function
    of time only.

    Attributes
    ----------
    duration_s : float, s
    position_m, velocity_m_s : (3,) float, m, m/s, body frame
        Planned handover state.
    target_m : (3,) float, m, body frame
    gravity : GravityField
        The field that the control was planned in.
    """

    duration_s: float
    position_m: FloatArray
    velocity_m_s: FloatArray
    target_m: FloatArray
    gravity: GravityField

    @property
    def coefficients(self) -> tuple[FloatArray, FloatArray]:
        """Return A (m/s2) and B (m/s3) of the planned arc, (3,) float each."""
        offset = np.asarray(self.position_m, dtype=np.float64) - self.target_m
        drift = self.duration_s * np.asarray(self.velocity_m_s, dtype=np.float64)
        return (3.0 * offset + drift) / self.duration_s**2, -(2.0 * offset + drift) / self.duration_s**3


Leg = ThrustNodesLeg | CostateLeg | FinalArcLeg
