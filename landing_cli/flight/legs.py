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


@dataclass(frozen=True, eq=False)
class BezierLeg:
    """The thrust that keeps the spacecraft on a Bezier curve (Lyu 2026, eqs 6, 28).

    The thrust cancels gravity, Coriolis and centrifugal acceleration along the curve, so its acceleration is
    a function of time only.

    Attributes
    ----------
    duration_s : float, s
    points_m : (n + 1, 3) float, m, body frame
        Control points P_0 ... P_n.
    gravity : GravityField
        The field that the control was planned in.
    """

    duration_s: float
    points_m: FloatArray
    gravity: GravityField


@dataclass(frozen=True, eq=False)
class LinearAccelerationLeg:
    """Thrust acceleration that is linear between nodes.

    Attributes
    ----------
    times_s : (k,) float, s
        Since the start of the leg; increasing from 0 to its end.
    acceleration_m_s2 : (k, 3) float, m/s2, rotating body frame
        Thrust over mass at the nodes.
    """

    times_s: FloatArray
    acceleration_m_s2: FloatArray

    @property
    def duration_s(self) -> float:
        """Length of the leg, s."""
        return float(self.times_s[-1])


@dataclass(frozen=True, eq=False)
class GaussAccelerationLeg:
    """Thrust acceleration that is a polynomial over each interval, given at its Legendre-Gauss nodes.

    Attributes
    ----------
    edges_s : (k + 1,) float, s
        Ends of the intervals since the start of the leg; increasing from 0.
    acceleration_m_s2 : (k, n, 3) float, m/s2, rotating body frame
        Thrust over mass at the n Legendre-Gauss nodes of each interval; one node is a constant thrust.
    """

    edges_s: FloatArray
    acceleration_m_s2: FloatArray

    @property
    def duration_s(self) -> float:
        """Length of the leg, s."""
        return float(self.edges_s[-1])


AccelerationLeg = BezierLeg | LinearAccelerationLeg | GaussAccelerationLeg
Leg = ThrustNodesLeg | CostateLeg | FinalArcLeg | AccelerationLeg
