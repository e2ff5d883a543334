"""The energy-optimal extremal: state and costate equations in scaled units (Zhao 2022, eqs 1, 8-11).

Lengths are scaled by ``L = a0 tp^2``, times by ``tp``, masses by ``m0`` and thrust by its bound, with
``a0 = T_max / m0``; then lambda0 = 1/2, gravity scales by 1/a0 and its gradient by tp^2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.body.gravity.field import GravityKind
from landing_cli.body.gravity.kernel_types import VectorAndSymmetric
from landing_cli.body.gravity.kernels import acceleration_and_gradient
from landing_cli.kernel import kernel, part

FloatArray = NDArray[np.float64]


class ExtremalScale(NamedTuple):
    """Constants of the scaled equations.

    Attributes
    ----------
    length_m : float, m
        ``a0 tp^2``.
    time_s : float, s
        Flight time of the descent stage.
    spin : float
        Spin rate times ``time_s``.
    flow : float
        Mass flow at full thrust: ``a0 tp / v_e``.
    acceleration_m_s2 : float, m/s2
        ``a0``, full thrust over the initial mass.
    """

    length_m: float
    time_s: float
    spin: float
    flow: float
    acceleration_m_s2: float


def extremal_scale(
    thrust_max_n: float,
    mass_kg: float,
    exhaust_velocity_m_s: float,
    descent_s: float,
    rotation_rate_rad_s: float,
) -> ExtremalScale:
    """Return the scaling of a descent stage.

    Parameters
    ----------
    thrust_max_n : float, N
        Bound on the thrust.
    mass_kg : float, kg
        Initial mass.
    exhaust_velocity_m_s : float, m/s
        Effective exhaust velocity.
    descent_s : float, s
        Flight time of the descent stage.
    rotation_rate_rad_s : float, rad/s
        Spin rate about +z.

    Returns
    -------
    ExtremalScale
    """
    a0 = thrust_max_n / mass_kg
    return ExtremalScale(
        a0 * descent_s**2,
        float(descent_s),
        rotation_rate_rad_s * descent_s,
        a0 * descent_s / exhaust_velocity_m_s,
        a0,
    )


def scaled_start(
    scale: ExtremalScale, position_m: ArrayLike, velocity_m_s: ArrayLike, costates: ArrayLike
) -> FloatArray:
    """Return the scaled state and costates at the start of the descent.

    Parameters
    ----------
    scale : ExtremalScale
        Constants of the scaled equations.
    position_m, velocity_m_s : (3,) float, m, m/s, body frame
        Initial state.
    costates : (7,) float, scaled
        Costates of position, velocity and mass.

    Returns
    -------
    (14,) float
        Position, velocity, mass, then the costates of the three.
    """
    speed = scale.length_m / scale.time_s
    position = np.asarray(position_m, dtype=np.float64) / scale.length_m
    velocity = np.asarray(velocity_m_s, dtype=np.float64) / speed
    return np.concatenate([position, velocity, [1.0], np.asarray(costates, dtype=np.float64)])


@kernel
def thrust_ratio(flow: float, saturated: bool, y: FloatArray) -> tuple[float, float]:
    """Return u and the norm of lambda_v; unsaturated, u is the switching function (Zhao 2022, eqs 10-11)."""
    norm = max(math.sqrt(y[10] * y[10] + y[11] * y[11] + y[12] * y[12]), 1e-12)
    return 1.0 if saturated else norm / y[6] + flow * y[13], norm


@part
def rates_in_gravity(
    scale: ExtremalScale, saturated: bool, y: FloatArray, g: VectorAndSymmetric, out: FloatArray
) -> None:
    """Write the scaled time derivative of state and costates.

    Parameters
    ----------
    scale : ExtremalScale
        Constants of the scaled equations.
    saturated : bool
        Whether the thrust is at its bound; fixed within a step, so that a step stays smooth.
    y : (14,) float, scaled
        Position, velocity, mass and their costates.
    g : tuple of 9 float, m/s2 and 1/s2
        Gravity and its gradient at the position.
    out : (14,) float, scaled
        Receives the rates.
    """
    w, grow = scale.spin, scale.time_s * scale.time_s
    lx, ly, lz, m = y[10], y[11], y[12], y[6]
    u, norm = thrust_ratio(scale.flow, saturated, y)
    a = -u / (m * norm)
    out[0], out[1], out[2] = y[3], y[4], y[5]
    out[3] = g[0] / scale.acceleration_m_s2 + w * (2.0 * y[4] + w * y[0]) + a * lx
    out[4] = g[1] / scale.acceleration_m_s2 + w * (-2.0 * y[3] + w * y[1]) + a * ly
    out[5] = g[2] / scale.acceleration_m_s2 + a * lz
    out[6] = -scale.flow * u
    out[7] = -w * w * lx - grow * (g[3] * lx + g[6] * ly + g[7] * lz)
    out[8] = -w * w * ly - grow * (g[6] * lx + g[4] * ly + g[8] * lz)
    out[9] = -grow * (g[7] * lx + g[8] * ly + g[5] * lz)
    out[10] = -y[7] + 2.0 * w * ly
    out[11] = -y[8] - 2.0 * w * lx
    out[12] = -y[9]
    out[13] = -u * norm / (m * m)


@kernel
def extremal_rates(
    kind: GravityKind,
    params: FloatArray,
    scale: ExtremalScale,
    saturated: bool,
    y: FloatArray,
    out: FloatArray,
) -> None:
    """Write the rates of ``rates_in_gravity`` in a gravity field (kind, params)."""
    length = scale.length_m
    g = acceleration_and_gradient(kind, params, y[0] * length, y[1] * length, y[2] * length)
    rates_in_gravity(scale, saturated, y, g, out)


@kernel
def scaled_thrust(scale: ExtremalScale, saturated: bool, y: FloatArray, out: FloatArray) -> None:
    """Write the thrust vector over its bound (Zhao 2022, eqs 9-10)."""
    u, norm = thrust_ratio(scale.flow, saturated, y)
    for a in range(3):
        out[a] = -u * y[10 + a] / norm
