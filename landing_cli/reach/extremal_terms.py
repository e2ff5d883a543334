"""Cost and constraints of a two-stage extremal landing, with their derivatives.

What the handover state x = (r_p, v_p, m_p) decides is in closed form: the final stage's energy, thrust and
glide slope (Zhao 2022, eqs 13-14). The descent adds its energy, lambda_m(t_p) = 0 (eq 12), and the least
distance from the ellipsoid at every dip of the path towards it (eq 5).

Rows, each >= 0 or = 0, in scaled units:

    thrust      (1 - (m T)^2) / 2 at points of the final arc, from touchdown to handover
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
from numpy.typing import NDArray

from landing_cli.body.gravity.kernels import acceleration_and_gradient
from landing_cli.flight.extremal import extremal_scale
from landing_cli.kernel import inlined, part
from landing_cli.kernel_record import by_reference
from landing_cli.reach.costate_dynamics import Field, gravity_point
from landing_cli.reach.ellipsoid_dips import MAX_DIPS, add_level_bend, level_and_gradient
from landing_cli.reach.records import LandingCase

Floats = NDArray[np.float64]

# Intervals of the final arc, at whose ends its thrust bound is imposed. a* is linear in time, so two ends
# would do for it alone; gravity along the arc bends the real thrust between them.
ARC_INTERVALS = 8
N_ARC = ARC_INTERVALS + 1
ROW_GLIDE = N_ARC
ROW_HANDOVER = N_ARC + 2
ROW_PROPELLANT = N_ARC + 3
ROW_MASS = N_ARC + 4
ROW_DIPS = N_ARC + 5
MAX_ROWS = ROW_DIPS + MAX_DIPS


@by_reference
class ExtremalProblem(NamedTuple):
    """One landing case in scaled units, body frame."""

    field: Field
    position: Floats  # (3,) at the start
    velocity: Floats  # (3,) at the start, relative to the rotating frame
    final_time: float
    propellant: float  # bound on the mass used; more than 1 when unbounded
    cos_half_angle: float
    compensated: bool
    on_ellipsoid: bool


@by_reference
class ArcWork(NamedTuple):
    """Scratch space for the final arc's terms."""

    vector: Floats  # (3,)
    slopes: Floats  # (3, 6) of the vector
    r: Floats  # (3,)
    v: Floats  # (3,)
    normal: Floats  # (3,)
    gravity: Floats  # (3, 3) gradient of gravity
    of_norm: Floats  # (7,)
    of_last: Floats  # (7,)
    of_pull: Floats  # (7,)
    of_mass: Floats  # (7,)


def new_arc_work() -> ArcWork:
    """Allocate scratch space."""
    return ArcWork(
        np.zeros(3),
        np.zeros((3, 6)),
        np.zeros(3),
        np.zeros(3),
        np.zeros(3),
        np.zeros((3, 3)),
        np.zeros(7),
        np.zeros(7),
        np.zeros(7),
        np.zeros(7),
    )


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
        # writable, as they come out of a pickle
        field=Field(gravity.kind, gravity.params.copy(), scale, inverse_axes),
        position=np.array(case.position_m, dtype=np.float64) / scale.length_m,
        velocity=np.array(case.velocity_m_s, dtype=np.float64) * scale.time_s / scale.length_m,
        final_time=case.final_stage_s / case.descent_s,
        propellant=2.0 if bound is None else bound / craft.mass_kg,
        cos_half_angle=math.cos(case.glide_slope_half_angle_rad),
        compensated=case.final_stage_thrust == "compensated",
        on_ellipsoid=case.handover == "on_ellipsoid",
    )


@part
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


@part
def _arc_acceleration(
    problem: ExtremalProblem, target: Floats, x: Floats, sigma: float, work: ArcWork
) -> None:
    """Total acceleration a* on the final arc (3,), and its derivative (3, 6) with respect to (r_p, v_p)."""
    star, D = work.vector, work.slopes
    ad, av, _, _, _, _ = _arc_weights(sigma, problem.final_time)
    for i in range(3):
        star[i] = ad * (x[i] - target[i]) + av * x[3 + i]
        for j in range(6):
            D[i, j] = 0.0
        D[i, i], D[i, 3 + i] = ad, av


@part
def _arc_thrust(problem: ExtremalProblem, target: Floats, x: Floats, sigma: float, work: ArcWork) -> None:
    """Thrust per mass on the final arc and its derivative: a* less gravity and the frame's accelerations."""
    thrust, D, r, v, G = work.vector, work.slopes, work.r, work.v, work.gravity
    _arc_acceleration(problem, target, x, sigma, work)
    _, _, rd, rv, vd, vv = _arc_weights(sigma, problem.final_time)
    field, w = problem.field, problem.field.scale.spin
    for i in range(3):
        r[i] = target[i] + rd * (x[i] - target[i]) + rv * x[3 + i]
        v[i] = vd * (x[i] - target[i]) + vv * x[3 + i]
    px, py, pz = gravity_point(field, r)
    g = acceleration_and_gradient(field.kind, field.params, px, py, pz)
    grow = field.scale.time_s * field.scale.time_s
    thrust[0] -= g[0] / field.scale.acceleration_m_s2 + w * (2.0 * v[1] + w * r[0])
    thrust[1] -= g[1] / field.scale.acceleration_m_s2 + w * (-2.0 * v[0] + w * r[1])
    thrust[2] -= g[2] / field.scale.acceleration_m_s2
    G[0, 0], G[1, 1], G[2, 2] = g[3], g[4], g[5]
    G[0, 1], G[0, 2], G[1, 2] = g[6], g[7], g[8]
    G[1, 0], G[2, 0], G[2, 1] = g[6], g[7], g[8]
    for b in range(2):
        of_r, of_v = (rd, vd) if b == 0 else (rv, vv)
        c = 3 * b
        for i in range(3):
            for j in range(3):
                D[i, c + j] -= grow * G[i, j] * of_r
        D[0, c] -= w * w * of_r
        D[1, c + 1] -= w * w * of_r
        D[0, c + 1] -= 2.0 * w * of_v
        D[1, c] += 2.0 * w * of_v


@part
def _norm_and_slope(vector: Floats, D: Floats, slope: Floats) -> float:
    """Norm of a vector, and the norm's derivative (6,) from the vector's."""
    norm = max(math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2), 1e-9)
    for a in range(6):
        slope[a] = (vector[0] * D[0, a] + vector[1] * D[1, a] + vector[2] * D[2, a]) / norm
    return norm


@part
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


@inlined
def _thrust_rows(
    problem: ExtremalProblem,
    guard: float,
    target: Floats,
    x: Floats,
    values: Floats,
    jacobian: Floats,
    work: ArcWork,
) -> None:
    """Thrust along the final arc, and the propellant left at touchdown.

    The thrust that is bounded is the real one, or m a* alone in the paper's reading; the mass flows with the
    real one.
    """
    n = ARC_INTERVALS
    width = 0.5 * problem.field.scale.flow * problem.final_time / n
    vector, D, mass, last = work.vector, work.slopes, x[6], 0.0
    d_norm, d_last, d_pull, d_mass = work.of_norm, work.of_last, work.of_pull, work.of_mass
    for a in range(7):
        d_norm[a] = d_last[a] = d_mass[a] = 0.0
    d_mass[6] = 1.0
    for j in range(n, -1, -1):
        _arc_thrust(problem, target, x, j / n, work)
        norm = _norm_and_slope(vector, D, d_norm)
        if j < n:
            decay = math.exp(-width * (norm + last))
            mass *= decay
            for a in range(7):
                d_mass[a] = decay * d_mass[a] - width * mass * (d_norm[a] + d_last[a])
        pull = norm
        for a in range(7):
            d_last[a], d_pull[a] = d_norm[a], d_norm[a]
        if not problem.compensated:
            _arc_acceleration(problem, target, x, j / n, work)
            pull = _norm_and_slope(vector, D, d_pull)
        values[j] = 0.5 * (1.0 - (mass * pull) ** 2) - guard
        for a in range(7):
            jacobian[j, a] = -mass * pull * (d_mass[a] * pull + mass * d_pull[a])
        last = norm
    values[ROW_PROPELLANT] = problem.propellant - 1.0 + mass
    for a in range(7):
        jacobian[ROW_PROPELLANT, a] = d_mass[a]


@part
def handover_rows(
    problem: ExtremalProblem,
    guard: float,
    target: Floats,
    facet_normal: Floats,
    x: Floats,
    values: Floats,
    jacobian: Floats,
    work: ArcWork,
) -> None:
    """Fill values and derivatives (.., 7) of the rows that the handover state decides.

    The guard is kept from the thrust bound of the final arc, for what the thrust bulges between the points.
    """
    normal = work.normal
    _thrust_rows(problem, guard, target, x, values, jacobian, work)
    _glide_rows(problem, target, facet_normal, x, values, jacobian)
    values[ROW_HANDOVER] = level_and_gradient(problem.field.inverse_axes, x, normal) - 1.0
    for a in range(7):
        jacobian[ROW_HANDOVER, a] = normal[a] if a < 3 else 0.0


@part
def glide_weights(end: int, T: float) -> tuple[float, float]:
    """Weights of (d, v) in the two directions that the cone must hold: 2 a_e + a_s, then a_e."""
    return (6.0 / (T * T), 0.0) if end == 0 else (6.0 / (T * T), 2.0 / T)


@inlined
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


@part
def handover_hessian(
    problem: ExtremalProblem, target: Floats, x: Floats, multipliers: Floats, K: Floats, work: ArcWork
) -> None:
    """Hessian (7, 7) of J2 less the multipliers times the handover's rows; the mass is held fixed."""
    T = problem.final_time
    for i in range(7):
        for j in range(7):
            K[i, j] = 0.0
    for i in range(3):
        K[i, i] += 12.0 / T**3
        K[3 + i, 3 + i] += 4.0 / T
        K[i, 3 + i] += 6.0 / T**2
        K[3 + i, i] += 6.0 / T**2
    D, w, normal = work.slopes, work.vector, work.normal
    for j in range(N_ARC):
        if multipliers[j] > 0.0:
            sigma = j / ARC_INTERVALS
            if problem.compensated:
                _arc_thrust(problem, target, x, sigma, work)
            else:
                _arc_acceleration(problem, target, x, sigma, work)
            weight = multipliers[j] * x[6] * x[6]
            for a in range(6):
                for b in range(6):
                    K[a, b] += weight * (D[0, a] * D[0, b] + D[1, a] * D[1, b] + D[2, a] * D[2, b])
    for end in range(2):
        wd, wv = glide_weights(end, T)
        norm2 = 0.0
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
    level = level_and_gradient(problem.field.inverse_axes, x, normal)
    add_level_bend(problem.field.inverse_axes, level, normal, -multipliers[ROW_HANDOVER], K)
