"""One landing case in the solver's units and axes.

Units: length a0 t_p^2, time t_p, thrust T_max, mass m0, where t_p is the descent stage's duration and
a0 = T_max / m0. Axes: inertial, equal to the body axes at the handover, so that thrust which is constant
in space is constant here and the final stage, flown in body axes, starts in the same frame.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityKind
from landing_cli.kernel import part
from landing_cli.kernel_lanes import choose
from landing_cli.kernel_record import by_reference
from landing_cli.reach.gravity_in_lanes import acceleration, acceleration_and_gradient
from landing_cli.reach.records import LandingCase

Floats = NDArray[np.float64]

# Fractions of the final stage's time-to-go at which its thrust bound is imposed. a* is linear in time, so
# two ends would do for it alone; gravity along the arc bends the real thrust between them, the more so the
# stronger it is against the thrust.
FEW_FRACTIONS, MANY_FRACTIONS, STRONG_GRAVITY = 5, 17, 0.02

# Inside this fraction of the ellipsoid an iterate's gravity is taken at its radial projection: no path
# that is accepted goes there, and the iterates must not meet the field's singularities.
CORE = 0.6


@by_reference
class ScaledCase(NamedTuple):
    """A landing case, scaled (see the module's docstring), discretised in N equal intervals."""

    position: Floats  # (3,) at the start
    velocity: Floats  # (3,) at the start, inertial
    spin: float
    mass_flow: float  # mass used per unit of time at full thrust
    final_time: float
    propellant: float  # bound on the mass used; more than 1 when unbounded
    inverse_axes: Floats  # (3,) of the keep-out ellipsoid
    tan_half_angle: float
    arc_fractions: Floats  # (A,)
    arc_share: float  # share of the thrust bound that the final stage may use
    compensated: bool
    on_ellipsoid: bool
    gravity_kind: GravityKind
    gravity_params: Floats
    length_m: float
    acceleration_m_s2: float
    node_cos: Floats  # (N + 1,) of the body's angle at the interval ends, relative to the handover
    node_sin: Floats
    mid_cos: Floats  # (N,) and at the interval midpoints
    mid_sin: Floats


def scale_case(case: LandingCase, n_intervals: int) -> ScaledCase:
    """Scale a landing case for ``n_intervals`` thrust intervals."""
    craft, spin = case.spacecraft, case.asteroid.rotation_rate_rad_s
    duration = case.descent_s
    a0 = craft.thrust_max_n / craft.mass_kg
    length = a0 * duration**2
    angle = -spin * duration
    turn = np.array(
        [[math.cos(angle), -math.sin(angle), 0.0], [math.sin(angle), math.cos(angle), 0.0], [0.0, 0.0, 1.0]]
    )
    inertial_velocity = case.velocity_m_s + np.cross([0.0, 0.0, spin], case.position_m)
    scaled_spin = spin * duration
    node_angle = scaled_spin * (np.arange(n_intervals + 1) / n_intervals - 1.0)
    mid_angle = scaled_spin * ((np.arange(n_intervals) + 0.5) / n_intervals - 1.0)
    unbounded = craft.propellant_kg is None
    strong = case.asteroid.gm_m3_s2 / np.min(case.ellipsoid_m) ** 2 > STRONG_GRAVITY * a0
    return ScaledCase(
        position=turn @ case.position_m / length,
        velocity=turn @ inertial_velocity * duration / length,
        spin=scaled_spin,
        mass_flow=craft.thrust_max_n * duration / (craft.exhaust_velocity_m_s * craft.mass_kg),
        final_time=case.final_stage_s / duration,
        propellant=2.0 if unbounded else float(craft.propellant_kg or 0.0) / craft.mass_kg,
        inverse_axes=length / np.asarray(case.ellipsoid_m, dtype=np.float64),
        tan_half_angle=math.tan(case.glide_slope_half_angle_rad),
        arc_fractions=np.linspace(0.0, 1.0, MANY_FRACTIONS if strong else FEW_FRACTIONS),
        arc_share=1.0,
        compensated=case.final_stage_thrust == "compensated",
        on_ellipsoid=case.handover == "on_ellipsoid",
        gravity_kind=case.asteroid.gravity.kind,
        gravity_params=case.asteroid.gravity.params.copy(),  # writable, as it comes out of a pickle
        length_m=length,
        acceleration_m_s2=a0,
        node_cos=np.cos(node_angle),
        node_sin=np.sin(node_angle),
        mid_cos=np.cos(mid_angle),
        mid_sin=np.sin(mid_angle),
    )


@part
def core_scale(case: ScaledCase, x: float, y: float, z: float) -> float:
    """Metres per unit of length, more where a body-frame point lies in the ellipsoid's core."""
    a, b, c = x * case.inverse_axes[0], y * case.inverse_axes[1], z * case.inverse_axes[2]
    level = a * a + b * b + c * c
    return case.length_m * choose(level >= CORE * CORE, 1.0, CORE / math.sqrt(level + 1e-30))


@part
def gravity_and_gradient(
    case: ScaledCase, cosine: float, sine: float, x: float, y: float, z: float
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Gravity and its gradient at a point in solver axes, the body being turned by the given angle.

    Returns
    -------
    gx, gy, gz, gxx, gyy, gzz, gxy, gxz, gyz : float
        Scaled, in solver axes.
    """
    bx, by = cosine * x + sine * y, cosine * y - sine * x
    scale = core_scale(case, bx, by, z)
    ax, ay, az, xx, yy, zz, xy, xz, yz = acceleration_and_gradient(
        case.gravity_kind, case.gravity_params, scale * bx, scale * by, scale * z
    )
    p, q = 1.0 / case.acceleration_m_s2, case.length_m / case.acceleration_m_s2
    cc, ss, cs = cosine * cosine, sine * sine, cosine * sine
    return (
        p * (cosine * ax - sine * ay),
        p * (sine * ax + cosine * ay),
        p * az,
        q * (cc * xx - 2.0 * cs * xy + ss * yy),
        q * (ss * xx + 2.0 * cs * xy + cc * yy),
        q * zz,
        q * (cs * (xx - yy) + (cc - ss) * xy),
        q * (cosine * xz - sine * yz),
        q * (sine * xz + cosine * yz),
    )


@part
def gravity_in_space(
    case: ScaledCase, cosine: float, sine: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Gravity at a point in solver axes, scaled, the body being turned by the given angle."""
    bx, by = cosine * x + sine * y, cosine * y - sine * x
    scale = core_scale(case, bx, by, z)
    ax, ay, az = acceleration(case.gravity_kind, case.gravity_params, scale * bx, scale * by, scale * z)
    p = 1.0 / case.acceleration_m_s2
    return p * (cosine * ax - sine * ay), p * (sine * ax + cosine * ay), p * az


@part
def gravity_on_arc(case: ScaledCase, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Gravity at a point of the final arc, scaled, body axes; arcs may fly deep in the ellipsoid."""
    L, p = case.length_m, 1.0 / case.acceleration_m_s2
    ax, ay, az = acceleration(case.gravity_kind, case.gravity_params, L * x, L * y, L * z)
    return p * ax, p * ay, p * az


@part
def ellipsoid_level(case: ScaledCase, cosine: float, sine: float, x: float, y: float, z: float) -> float:
    """|xi| = sqrt(r' Re r) of a point in solver axes: 1 on the ellipsoid, homogeneous of degree 1."""
    a = (cosine * x + sine * y) * case.inverse_axes[0]
    b = (cosine * y - sine * x) * case.inverse_axes[1]
    c = z * case.inverse_axes[2]
    return math.sqrt(a * a + b * b + c * c)


@part
def least_between(first: float, middle: float, last: float) -> float:
    """Least value of the parabola through three evenly spaced values, between the outer two."""
    slope, bend = 0.5 * (last - first), 0.5 * (first + last) - middle
    dips = (bend > 0.0) & (abs(slope) < 2.0 * bend)
    return choose(dips, middle - slope * slope / (4.0 * bend), min(min(first, middle), last))


@part
def ellipsoid_normal(
    case: ScaledCase, cosine: float, sine: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Gradient n of |xi| at a point, in solver axes: n . r = |xi|, and n . r >= 1 is a tangent plane."""
    wx, wy, wz = case.inverse_axes[0], case.inverse_axes[1], case.inverse_axes[2]
    a, b, c = (cosine * x + sine * y) * wx, (cosine * y - sine * x) * wy, z * wz
    inverse = 1.0 / math.sqrt(a * a + b * b + c * c)
    a, b, c = a * wx * inverse, b * wy * inverse, c * wz * inverse
    return cosine * a - sine * b, sine * a + cosine * b, c
