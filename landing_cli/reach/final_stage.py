"""The final landing stage in closed form (Zhao 2022, eqs 13-14), in SI units and body axes.

With time-to-go s the arc from the handover (r_p, v_p) to the touchdown r_c is

    r - r_c = s^2 (A + B s),   v = -(2 A s + 3 B s^2),   a* = 2 A + 6 B s.

a* is the total acceleration seen in the rotating frame. To fly it, the thrust must also carry gravity and
the frame's accelerations: T / m = a* - g + 2 w x v + w x (w x r). The paper bounds |a*| alone; flown
as thrust without that compensation, a* misses the touchdown by metres.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityKind
from landing_cli.body.gravity.kernels import acceleration
from landing_cli.kernel import part

Floats = NDArray[np.float64]

ARC_SAMPLES = 64


class ArcMeasures(NamedTuple):
    """What a final arc asks of the spacecraft."""

    energy_m2_s3: float  # half the integral of |a*|^2
    delta_v_m_s: float  # integral of the flown thrust per mass
    touchdown_mass_kg: float
    peak_thrust_n: float  # largest flown thrust
    peak_planned_thrust_n: float  # largest m |a*|, the paper's reading
    glide_angle_rad: float  # largest angle of r - r_c to the facet normal


@part
def end_accelerations(
    rx: float, ry: float, rz: float, vx: float, vy: float, vz: float, duration_s: float
) -> tuple[float, float, float, float, float, float]:
    """Total acceleration at touchdown and at handover for r_p - r_c = (rx, ry, rz) and v_p.

    Returns
    -------
    a_e (3), a_s (3) : six floats, m/s2
    """
    p, q, u = 6.0 / duration_s**2, 2.0 / duration_s, 4.0 / duration_s
    return (
        p * rx + q * vx,
        p * ry + q * vy,
        p * rz + q * vz,
        -p * rx - u * vx,
        -p * ry - u * vy,
        -p * rz - u * vz,
    )


@part
def arc_state(
    a: tuple[float, float, float, float, float, float], target: Floats, duration_s: float, s: float
) -> tuple[float, float, float, float, float, float]:
    """Position and velocity on the arc at time-to-go s.

    Returns
    -------
    x, y, z, vx, vy, vz : float, m and m/s
    """
    f, g = s / duration_s, s * s
    r_e, r_s = g * (0.5 - f / 6.0), g * f / 6.0
    v_e, v_s = -s * (1.0 - 0.5 * f), -0.5 * s * f
    return (
        target[0] + r_e * a[0] + r_s * a[3],
        target[1] + r_e * a[1] + r_s * a[4],
        target[2] + r_e * a[2] + r_s * a[5],
        v_e * a[0] + v_s * a[3],
        v_e * a[1] + v_s * a[4],
        v_e * a[2] + v_s * a[5],
    )


@part
def _angle(x: float, y: float, z: float, normal: Floats) -> float:
    along = x * normal[0] + y * normal[1] + z * normal[2]
    square = x * x + y * y + z * z
    return math.atan2(math.sqrt(max(square - along * along, 0.0)), along)


@part
def measure_arc(
    handover: Floats,
    handover_mass: float,
    target: Floats,
    normal: Floats,
    duration_s: float,
    spin: float,
    exhaust_velocity: float,
    kind: GravityKind,
    params: Floats,
    points: Floats,
) -> ArcMeasures:
    """Fly a final arc in closed form and measure it.

    Parameters
    ----------
    handover : (6,) float, m and m/s
        Position and rotating-frame velocity, body axes.
    handover_mass : float, kg
        Mass at the handover.
    target, normal : (3,) float
        Touchdown point (m) and outward unit normal of its facet.
    duration_s, spin, exhaust_velocity : float, s, rad/s, m/s
        Final stage's duration, spin rate, effective exhaust velocity.
    kind, params : GravityKind, (p,) float
        The gravity field.
    points : (ARC_SAMPLES + 1, 3) float
        Filled with positions from the handover to touchdown, m.

    Returns
    -------
    measures : ArcMeasures
        The arc's energy, cost and largest values.
    """
    T = duration_s
    a = end_accelerations(
        handover[0] - target[0],
        handover[1] - target[1],
        handover[2] - target[2],
        handover[3],
        handover[4],
        handover[5],
        T,
    )
    mass, delta_v, last, simpson = handover_mass, 0.0, 0.0, 0.0
    peak = planned = 0.0
    for j in range(ARC_SAMPLES + 1):
        f = 1.0 - j / ARC_SAMPLES
        x, y, z, vx, vy, _vz = arc_state(a, target, T, f * T)
        points[j, 0], points[j, 1], points[j, 2] = x, y, z
        ax, ay, az = a[0] + f * (a[3] - a[0]), a[1] + f * (a[4] - a[1]), a[2] + f * (a[5] - a[2])
        gx, gy, gz = acceleration(kind, params, x, y, z)
        tx = ax - gx - 2.0 * spin * vy - spin * spin * x
        ty = ay - gy + 2.0 * spin * vx - spin * spin * y
        tz = az - gz
        norm = math.sqrt(tx * tx + ty * ty + tz * tz)
        if j > 0:
            delta_v += 0.5 * (norm + last) * T / ARC_SAMPLES
            mass = handover_mass * math.exp(-delta_v / exhaust_velocity)
        last = norm
        simpson += norm * (1.0 if j in (0, ARC_SAMPLES) else 4.0 if j % 2 else 2.0)
        peak = max(peak, mass * norm)
        planned = max(planned, mass * math.sqrt(ax * ax + ay * ay + az * az))
    # the trapezoid rule does for the masses on the way; what is stored is integrated by Simpson's
    delta_v = simpson * T / (3.0 * ARC_SAMPLES)
    mass = handover_mass * math.exp(-delta_v / exhaust_velocity)
    energy = 0.0
    for i in range(3):
        energy += a[i] * a[i] + a[i] * a[3 + i] + a[3 + i] * a[3 + i]
    at_handover = _angle(handover[0] - target[0], handover[1] - target[1], handover[2] - target[2], normal)
    glide = max(at_handover, _angle(a[0], a[1], a[2], normal))
    return ArcMeasures(T / 6.0 * energy, delta_v, mass, peak, planned, glide)
