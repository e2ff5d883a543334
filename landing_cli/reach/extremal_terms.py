"""Cost and constraints of a two-stage extremal landing, with their derivatives.

What the handover state x = (r_p, v_p, m_p) decides is in closed form: the final stage's energy, thrust and
glide slope (Zhao 2022, eqs 13-14). The descent adds its energy, lambda_m(t_p) = 0 (eq 12), and the least
distance from the ellipsoid at every dip of the path towards it (eq 5).

Rows, each >= 0 or = 0, in scaled units:

    thrust      (1 - (m T)^2) / 2 at points of the final arc
    glide       n.w - cos(theta) |w| for w = 2 a_e + a_s (handover) and w = a_e (touchdown): r - r_c is s^2
                times a mix of the two, and the cone is convex, so that both ends inside mean the whole arc
    handover    |xi(r_p)| - 1
    propellant  P - (1 - m at touchdown)
    mass        lambda_m(t_p)
    dips        |xi(r(t))| - 1 at local minima over time
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from landing_cli.body.gravity.kernels import acceleration_and_gradient
from landing_cli.flight.extremal import extremal_scale
from landing_cli.reach.costate_dynamics import COLUMNS, Extremal, Field, gravity_point
from landing_cli.reach.records import LandingCase

Floats = NDArray[np.float64]

# Fractions of the final stage's time-to-go at which its thrust bound is imposed. a* is linear in time, so
# two ends would do for it alone; gravity along the arc bends the real thrust between them.
ARC_FRACTIONS = (0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0)
N_ARC = len(ARC_FRACTIONS)
# Kept from the thrust bound at those points: between them the thrust bulges, and the search's steps are coarse.
BULGE = 3e-5
ROW_GLIDE = N_ARC
ROW_HANDOVER = N_ARC + 2
ROW_PROPELLANT = N_ARC + 3
ROW_MASS = N_ARC + 4
ROW_DIPS = N_ARC + 5
MAX_DIPS = 4
MAX_ROWS = ROW_DIPS + MAX_DIPS
# Dips that stay above this level of |xi| do not become rows.
FAR = 1.2


class ExtremalProblem(NamedTuple):
    """One landing case in scaled units, body frame."""

    field: Field
    position: Floats  # (3,) at the start
    velocity: Floats  # (3,) at the start, relative to the rotating frame
    final_time: float
    propellant: float  # bound on the mass used; more than 1 when unbounded
    cos_half_angle: float
    arc_fractions: Floats  # (A,)
    compensated: bool
    on_ellipsoid: bool


def extremal_problem(case: LandingCase) -> ExtremalProblem:
    """Scale a landing case.

    Parameters
    ----------
    case : LandingCase
        The case to solve.

    Returns
    -------
    ExtremalProblem
    """
    craft, gravity = case.spacecraft, case.asteroid.gravity
    spin = case.asteroid.rotation_rate_rad_s
    scale = extremal_scale(
        craft.thrust_max_n, craft.mass_kg, craft.exhaust_velocity_m_s, case.descent_s, spin
    )
    inverse_axes = scale.length_m / np.array(case.ellipsoid_m, dtype=np.float64)
    bound = craft.propellant_kg
    return ExtremalProblem(
        field=Field(int(gravity.kind), gravity.params, scale, inverse_axes),
        position=np.array(case.position_m, dtype=np.float64) / scale.length_m,
        velocity=np.array(case.velocity_m_s, dtype=np.float64) * scale.time_s / scale.length_m,
        final_time=case.final_stage_s / case.descent_s,
        propellant=2.0 if bound is None else bound / craft.mass_kg,
        cos_half_angle=math.cos(case.glide_slope_half_angle_rad),
        arc_fractions=np.array(ARC_FRACTIONS),
        compensated=case.final_stage_thrust == "compensated",
        on_ellipsoid=case.handover == "on_ellipsoid",
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _arc_weights(sigma: float, T: float) -> tuple[float, float, float, float, float, float]:
    """Weights of (d, v), offset and velocity at handover, in a*, r - r_c and v at time-to-go sigma T."""
    s2 = sigma * sigma
    return (
        6.0 * (1.0 - 2.0 * sigma) / (T * T),
        (2.0 - 6.0 * sigma) / T,
        s2 * (3.0 - 2.0 * sigma),
        T * s2 * (1.0 - sigma),
        -6.0 * sigma * (1.0 - sigma) / T,
        -sigma * (2.0 - 3.0 * sigma),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _arc_thrust(
    problem: ExtremalProblem, target: Floats, x: Floats, sigma: float, thrust: Floats, D: Floats
) -> None:
    """Thrust per mass on the final arc (3,), and its derivative (3, 6) with respect to (r_p, v_p).

    Real thrust: a* less gravity, Coriolis and centrifugal acceleration; a* alone in the paper's reading.
    """
    ad, av, rd, rv, vd, vv = _arc_weights(sigma, problem.final_time)
    for i in range(3):
        thrust[i] = ad * (x[i] - target[i]) + av * x[3 + i]
        for j in range(6):
            D[i, j] = 0.0
        D[i, i], D[i, 3 + i] = ad, av
    if not problem.compensated:
        return
    field, w = problem.field, problem.field.scale.spin
    r, v = np.zeros(3), np.zeros(3)
    for i in range(3):
        r[i] = target[i] + rd * (x[i] - target[i]) + rv * x[3 + i]
        v[i] = vd * (x[i] - target[i]) + vv * x[3 + i]
    px, py, pz = gravity_point(field, r)
    g = acceleration_and_gradient(field.kind, field.params, px, py, pz)
    grow = field.scale.time_s * field.scale.time_s
    thrust[0] -= g[0] / field.scale.acceleration_m_s2 + w * (2.0 * v[1] + w * r[0])
    thrust[1] -= g[1] / field.scale.acceleration_m_s2 + w * (-2.0 * v[0] + w * r[1])
    thrust[2] -= g[2] / field.scale.acceleration_m_s2
    G = ((g[3], g[6], g[7]), (g[6], g[4], g[8]), (g[7], g[8], g[5]))
    for b in range(2):
        of_r, of_v = (rd, vd) if b == 0 else (rv, vv)
        c = 3 * b
        for i in range(3):
            for j in range(3):
                D[i, c + j] -= grow * G[i][j] * of_r
        D[0, c] -= w * w * of_r
        D[1, c + 1] -= w * w * of_r
        D[0, c + 1] -= 2.0 * w * of_v
        D[1, c] += 2.0 * w * of_v


@njit(cache=True, nogil=True, error_model="numpy")
def level_and_gradient(inverse_axes: Floats, r: Floats, normal: Floats) -> float:
    """|xi| = sqrt(r' Re r), and its gradient into ``normal``."""
    level2 = 0.0
    for i in range(3):
        level2 += (inverse_axes[i] * r[i]) ** 2
    level = max(math.sqrt(level2), 1e-9)
    for i in range(3):
        normal[i] = inverse_axes[i] ** 2 * r[i] / level
    return level


@njit(cache=True, nogil=True, error_model="numpy")
def final_energy(problem: ExtremalProblem, target: Floats, x: Floats, gradient: Floats) -> float:
    """J2 of the final arc, and its gradient (7,) with respect to the handover state."""
    T = problem.final_time
    total = 0.0
    for i in range(3):
        d, v = x[i] - target[i], x[3 + i] * T
        total += 2.0 * (3.0 * d * d + 3.0 * d * v + v * v)
        gradient[i] = (12.0 * d + 6.0 * v) / T**3
        gradient[3 + i] = (6.0 * d + 4.0 * v) / T**2
    gradient[6] = 0.0
    return total / T**3


@njit(cache=True, nogil=True, error_model="numpy")
def handover_rows(
    problem: ExtremalProblem,
    target: Floats,
    facet_normal: Floats,
    x: Floats,
    values: Floats,
    jacobian: Floats,
) -> None:
    """Values and derivatives (.., 7) of the rows that the handover state decides."""
    T, flow = problem.final_time, problem.field.scale.flow
    thrust, D = np.zeros(3), np.zeros((3, 6))
    log_mass, d_log, d_norm, last_norm = math.log(x[6]), np.zeros(7), np.zeros(7), 0.0
    last_d_norm = np.zeros(7)
    d_log[6] = 1.0 / x[6]
    for j in range(N_ARC - 1, -1, -1):
        sigma = problem.arc_fractions[j]
        _arc_thrust(problem, target, x, sigma, thrust, D)
        norm = max(math.sqrt(thrust[0] ** 2 + thrust[1] ** 2 + thrust[2] ** 2), 1e-9)
        for a in range(6):
            d_norm[a] = (thrust[0] * D[0, a] + thrust[1] * D[1, a] + thrust[2] * D[2, a]) / norm
        if j < N_ARC - 1:
            width = 0.5 * flow * T * (problem.arc_fractions[j + 1] - sigma)
            log_mass -= width * (norm + last_norm)
            for a in range(7):
                d_log[a] -= width * (d_norm[a] + last_d_norm[a])
        mass = math.exp(log_mass)
        pull2 = (mass * norm) ** 2
        values[j] = 0.5 * (1.0 - pull2) - BULGE
        for a in range(7):
            jacobian[j, a] = -pull2 * (d_norm[a] / norm + d_log[a])
            last_d_norm[a] = d_norm[a]
        last_norm = norm
    values[ROW_PROPELLANT] = problem.propellant - 1.0 + math.exp(log_mass)
    for a in range(7):
        jacobian[ROW_PROPELLANT, a] = math.exp(log_mass) * d_log[a]
    _glide_rows(problem, target, facet_normal, x, values, jacobian)
    normal = np.zeros(3)
    values[ROW_HANDOVER] = level_and_gradient(problem.field.inverse_axes, x, normal) - 1.0
    jacobian[ROW_HANDOVER, :] = 0.0
    for i in range(3):
        jacobian[ROW_HANDOVER, i] = normal[i]


@njit(cache=True, nogil=True, error_model="numpy")
def glide_weights(end: int, T: float) -> tuple[float, float]:
    """Weights of (d, v) in the two directions that the cone must hold: 2 a_e + a_s, then a_e."""
    return (6.0 / (T * T), 0.0) if end == 0 else (6.0 / (T * T), 2.0 / T)


@njit(cache=True, nogil=True, error_model="numpy")
def _glide_rows(
    problem: ExtremalProblem,
    target: Floats,
    facet_normal: Floats,
    x: Floats,
    values: Floats,
    jacobian: Floats,
) -> None:
    for end in range(2):
        wd, wv = glide_weights(end, problem.final_time)
        along, norm2 = 0.0, 0.0
        for i in range(3):
            w = wd * (x[i] - target[i]) + wv * x[3 + i]
            along += facet_normal[i] * w
            norm2 += w * w
        norm = max(math.sqrt(norm2), 1e-9)
        row = ROW_GLIDE + end
        values[row] = along - problem.cos_half_angle * norm
        jacobian[row, 6] = 0.0
        for i in range(3):
            w = wd * (x[i] - target[i]) + wv * x[3 + i]
            slope = facet_normal[i] - problem.cos_half_angle * w / norm
            jacobian[row, i], jacobian[row, 3 + i] = wd * slope, wv * slope


@njit(cache=True, nogil=True, error_model="numpy")
def handover_hessian(
    problem: ExtremalProblem, target: Floats, x: Floats, multipliers: Floats, K: Floats
) -> None:
    """Hessian (7, 7) of J2 less the multipliers times the handover's rows; the mass is held fixed."""
    T = problem.final_time
    K[:, :] = 0.0
    for i in range(3):
        K[i, i] += 12.0 / T**3
        K[3 + i, 3 + i] += 4.0 / T
        K[i, 3 + i] += 6.0 / T**2
        K[3 + i, i] += 6.0 / T**2
    thrust, D = np.zeros(3), np.zeros((3, 6))
    for j in range(N_ARC):
        if multipliers[j] > 0.0:
            _arc_thrust(problem, target, x, problem.arc_fractions[j], thrust, D)
            weight = multipliers[j] * x[6] * x[6]
            for a in range(6):
                for b in range(6):
                    K[a, b] += weight * (D[0, a] * D[0, b] + D[1, a] * D[1, b] + D[2, a] * D[2, b])
    for end in range(2):
        wd, wv = glide_weights(end, T)
        w, norm2 = np.zeros(3), 0.0
        for i in range(3):
            w[i] = wd * (x[i] - target[i]) + wv * x[3 + i]
            norm2 += w[i] * w[i]
        norm = max(math.sqrt(norm2), 1e-9)
        weight = multipliers[ROW_GLIDE + end] * problem.cos_half_angle / norm
        for i in range(3):
            for j in range(3):
                bend = weight * ((1.0 if i == j else 0.0) - w[i] * w[j] / norm2)
                K[i, j] += wd * wd * bend
                K[i, 3 + j] += wd * wv * bend
                K[3 + i, j] += wd * wv * bend
                K[3 + i, 3 + j] += wv * wv * bend
    normal = np.zeros(3)
    level = level_and_gradient(problem.field.inverse_axes, x, normal)
    add_level_bend(problem.field.inverse_axes, level, normal, -multipliers[ROW_HANDOVER], K)


@njit(cache=True, nogil=True, error_model="numpy")
def add_level_bend(inverse_axes: Floats, level: float, normal: Floats, weight: float, K: Floats) -> None:
    """Add ``weight`` times the Hessian of |xi| to the leading 3 x 3 block."""
    for i in range(3):
        K[i, i] += weight * inverse_axes[i] ** 2 / level
        for j in range(3):
            K[i, j] -= weight * normal[i] * normal[j] / level


class Dips(NamedTuple):
    """Local minima over time of the path's distance from the ellipsoid."""

    step: NDArray[np.int64]  # (D,) the step it lies in
    fraction: Floats  # (D,) where in the step
    level: Floats  # (D,) |xi|
    bend: Floats  # (D,) second derivative of |xi| over time


@njit(cache=True, nogil=True, error_model="numpy")
def new_dips() -> Dips:
    """Room for the dips of one path."""
    return Dips(
        np.zeros(MAX_DIPS, dtype=np.int64), np.zeros(MAX_DIPS), np.zeros(MAX_DIPS), np.zeros(MAX_DIPS)
    )


@njit(cache=True, nogil=True, error_model="numpy")
def hermite(f: float) -> tuple[float, float, float, float, float, float, float, float]:
    """Cubic Hermite weights of (r0, h v0, r1, h v1) for the value and for h times the rate at f in [0, 1]."""
    g = 1.0 - f
    return (
        g * g * (1.0 + 2.0 * f),
        g * g * f,
        f * f * (3.0 - 2.0 * f),
        -f * f * g,
        -6.0 * f * g,
        g * (1.0 - 3.0 * f),
        6.0 * f * g,
        f * (3.0 * f - 2.0),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def interpolate(h: float, f: float, before: Floats, after: Floats, r: Floats, v: Floats) -> None:
    """Position and velocity within a step, from the states at its ends."""
    a, b, c, d, ta, tb, tc, td = hermite(f)
    for i in range(3):
        r[i] = a * before[i] + b * h * before[3 + i] + c * after[i] + d * h * after[3 + i]
        v[i] = (ta * before[i] + tc * after[i]) / h + tb * before[3 + i] + td * after[3 + i]


@njit(cache=True, nogil=True, error_model="numpy")
def find_dips(inverse_axes: Floats, extremal: Extremal, n: int, dips: Dips) -> int:
    """Find where the path comes near the ellipsoid and leaves again; returns how many places.

    The rate of |xi| changes sign from - to + within a step; the place is refined on the cubic Hermite
    interpolant. The last node belongs to the handover's row.
    """
    count = 0
    normal, r, v = np.zeros(3), np.zeros(3), np.zeros(3)
    level_and_gradient(inverse_axes, extremal.state[0], normal)
    before = _dot3(normal, extremal.state[0], 3)
    for k in range(n):
        level = level_and_gradient(inverse_axes, extremal.state[k + 1], normal)
        after = _dot3(normal, extremal.state[k + 1], 3)
        if before < 0.0 and after >= 0.0 and level < 1.5 * FAR and count < MAX_DIPS:
            lo, hi, f_lo, f_hi = 0.0, 1.0, before, after
            f = 0.0
            for _ in range(30):
                f = hi - f_hi * (hi - lo) / (f_hi - f_lo)
                interpolate(extremal.step[k], f, extremal.state[k], extremal.state[k + 1], r, v)
                level = level_and_gradient(inverse_axes, r, normal)
                rate = _dot3(normal, v, 0)
                if abs(rate) < 1e-13 or hi - lo < 1e-12:
                    break
                if rate > 0.0:
                    hi, f_hi, f_lo = f, rate, 0.5 * f_lo
                else:
                    lo, f_lo, f_hi = f, rate, 0.5 * f_hi
            if level < FAR:
                dips.step[count], dips.fraction[count], dips.level[count] = k, f, level
                dips.bend[count] = max((after - before) / extremal.step[k], 1e-9)
                count += 1
        before = after
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def _dot3(a: Floats, b: Floats, offset: int) -> float:
    return a[0] * b[offset] + a[1] * b[offset + 1] + a[2] * b[offset + 2]


@njit(cache=True, nogil=True, error_model="numpy")
def dip_row(
    problem: ExtremalProblem,
    extremal: Extremal,
    node_tangents: Floats,
    dips: Dips,
    place: int,
    row: Floats,
    weight: float,
    hessian: Floats,
) -> None:
    """Derivative (7,) of |xi| at a dip with respect to the initial costates.

    At a dip the time of it does not matter to first order. To second order it does: the Hessian without the
    path's own second derivative, times ``weight``, is added to ``hessian`` (7, 7).
    """
    k, f, bend = dips.step[place], dips.fraction[place], dips.bend[place]
    before, after = extremal.state[k], extremal.state[k + 1]
    a, b, c, d, ta, tb, tc, td = hermite(f)
    h = extremal.step[k]
    r, v, normal = np.zeros(3), np.zeros(3), np.zeros(3)
    dr, dv = np.zeros((3, COLUMNS)), np.zeros((3, COLUMNS))
    interpolate(h, f, before, after, r, v)
    level = level_and_gradient(problem.field.inverse_axes, r, normal)
    X, Y = node_tangents[k], node_tangents[k + 1]
    for i in range(3):
        for j in range(7):
            dr[i, j] = a * X[i, j] + b * h * X[3 + i, j] + c * Y[i, j] + d * h * Y[3 + i, j]
            dv[i, j] = (ta * X[i, j] + tc * Y[i, j]) / h + tb * X[3 + i, j] + td * Y[3 + i, j]
    Q = np.zeros((3, 3))
    add_level_bend(problem.field.inverse_axes, level, normal, 1.0, Q)
    rate = np.zeros(7)
    for j in range(7):
        row[j] = 0.0
        for i in range(3):
            row[j] += normal[i] * dr[i, j]
            rate[j] += normal[i] * dv[i, j]
            for q in range(3):
                rate[j] += Q[i, q] * v[q] * dr[i, j]
    for j in range(7):
        for q in range(7):
            total = -rate[j] * rate[q] / bend
            for i in range(3):
                for p in range(3):
                    total += dr[i, j] * Q[i, p] * dr[p, q]
            hessian[j, q] += weight * total
