"""The two-stage landing on one facet, linearised at the solver's current point.

Unknowns: the thrust F_k of the descent stage's intervals, and y = (tau, a_e, a_s): the thrust level and
the final stage's acceleration at touchdown and at handover. With time-to-go s in [0, T] the final arc is
r - r_c = s^2 (A + B s) with total acceleration a* = 2 A + 6 B s (Zhao 2022, eqs 13-14), linear in time,
so that at s = sigma T

    a*      = (1 - sigma) a_e + sigma a_s
    r - r_c = T^2 [ (sigma^2 / 2 - sigma^3 / 6) a_e + sigma^3 / 6 a_s ]
    v       = -T [ (sigma - sigma^2 / 2) a_e + sigma^2 / 2 a_s ]        (rotating frame).

Rows: position and velocity match at the handover (6); the handover on the ellipsoid, in that reading (1);
the handover reached from outside (in that reading), the propellant bound, tangent planes of the ellipsoid at
chosen nodes, planes off the terrain at nodes and points of the final arc (inequalities). Cones on y: the
final stage's thrust at a few points of the arc, and the glide slope at both ends of the arc: r - r_c is
s^2 times an affine function of s, so both ends inside the convex cone mean the whole arc inside.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import inlined, part
from landing_cli.kernel_lanes import choose
from landing_cli.optimize.conic_ipm import fill_row_pull
from landing_cli.optimize.conic_records import Model, Point
from landing_cli.reach.planes import Cuts, arc_weights, refresh_planes
from landing_cli.reach.scaled_case import ScaledCase, ellipsoid_normal, gravity_on_arc
from landing_cli.reach.shooting import Path, fly, pull_back

Floats = NDArray[np.float64]

# Below this thrust the direction of thrust is not used as a direction (derivatives of |F|).
SMALL_THRUST = 1e-3
# |F| is rounded off below this where propellant is counted: where it is scarce flights coast, and |F| has a
# kink at 0. It counts coasting as so much thrust, on the safe side.
COAST = 5e-3


class Layout(NamedTuple):
    """How many rows and cones a facet's problem has, and what it minimises.

    Rows: those of the matching, of the handover on the ellipsoid, of the approach to it, of the propellant,
    where the case has them, then the planes.
    """

    n_equal: int  # equality rows
    first_plane: int
    n_rows: int
    n_cones: int
    energy_weight: float  # weight rho of J in the objective
    tau_free: bool  # minimise tau + rho J instead of rho J at tau = 1


@part
def layout(case: ScaledCase, n_planes: int, energy_weight: float, tau_free: bool) -> Layout:
    """Count rows and cones for a case with ``n_planes`` tangent planes and walls."""
    n_equal = 7 if case.on_ellipsoid else 6
    first = n_equal + (1 if case.on_ellipsoid else 0) + (1 if case.propellant < 1.0 else 0)
    n_cones = case.arc_fractions.shape[0] + 2
    return Layout(n_equal, first, first + n_planes, n_cones, energy_weight, tau_free)


@part
def fill_handover_rows(case: ScaledCase, model: Model) -> None:
    """Constant derivatives of the six matching rows with respect to y and to the basis."""
    spin = case.spin
    _, _, r_e, r_s, v_e, v_s = arc_weights(1.0, case.final_time)
    for i in range(6):
        for a in range(7):
            model.row_y[i, a] = 0.0
        for b in range(model.row_mix.shape[1]):
            model.row_mix[i, b] = 1.0 if i == b else 0.0
        model.row_end[i] = float(model.basis.shape[0])
    for i in range(3):
        model.row_y[i, 1 + i], model.row_y[i, 4 + i] = -r_e, -r_s
        model.row_y[3 + i, 1 + i], model.row_y[3 + i, 4 + i] = -v_e, -v_s
    # inertial velocity = rotating velocity + w x r
    model.row_y[3, 2] += spin * r_e
    model.row_y[3, 5] += spin * r_s
    model.row_y[4, 1] -= spin * r_e
    model.row_y[4, 4] -= spin * r_s


@part
def fill_arc_cones(case: ScaledCase, model: Model) -> None:
    """Constant derivatives of the final stage's thrust with respect to (a_e, a_s).

    Thrust per mass is a* - g + 2 w x v + w x (w x r) when compensated, a* in the paper's reading.
    """
    spin = case.spin
    for j in range(case.arc_fractions.shape[0]):
        A = model.cone_map[j]
        A[:, :] = 0.0
        a_e, a_s, r_e, r_s, v_e, v_s = arc_weights(case.arc_fractions[j], case.final_time)
        for end in range(2):
            a, r, v = (a_e, r_e, v_e) if end == 0 else (a_s, r_s, v_s)
            c = 1 + 3 * end
            for i in range(3):
                A[1 + i, c + i] = a
            if case.compensated:
                A[1, c] -= spin * spin * r
                A[2, c + 1] -= spin * spin * r
                A[1, c + 1] -= 2.0 * spin * v
                A[2, c] += 2.0 * spin * v


@part
def fill_glide_cones(case: ScaledCase, normal: Floats, model: Model) -> None:
    """Glide slope at handover (2 a_e + a_s) and at touchdown (a_e), about the facet normal."""
    first = case.arc_fractions.shape[0]
    n0, n1, n2 = normal[0], normal[1], normal[2]
    # any two unit vectors that complete the normal
    flat = abs(n2) < 0.9
    scale = 1.0 / math.sqrt(choose(flat, n0 * n0 + n1 * n1, n1 * n1 + n2 * n2))
    e0, e1, e2 = scale * choose(flat, -n1, 0.0), scale * choose(flat, n0, -n2), scale * choose(flat, 0.0, n1)
    f0, f1, f2 = n1 * e2 - n2 * e1, n2 * e0 - n0 * e2, n0 * e1 - n1 * e0
    frame = ((n0, n1, n2), (e0, e1, e2), (f0, f1, f2))
    for j in range(2):
        A = model.cone_map[first + j]
        A[:, :] = 0.0
        model.cone_offset[first + j, :] = 0.0
        for i in range(3):
            wide = case.tan_half_angle if i == 0 else 1.0
            for c in range(3):
                if j == 0:
                    A[i, 1 + c] = 2.0 * wide * frame[i][c]
                    A[i, 4 + c] = wide * frame[i][c]
                else:
                    A[i, 1 + c] = wide * frame[i][c]


@part
def fill_energy(case: ScaledCase, rho: float, model: Model) -> None:
    """Hessian of rho J in y: J2 = T/6 (|a_e|^2 + a_e . a_s + |a_s|^2)."""
    weight = rho * case.final_time / 6.0
    model.y_hessian[:, :] = 0.0
    for i in range(3):
        model.y_hessian[1 + i, 1 + i] = model.y_hessian[4 + i, 4 + i] = 2.0 * weight
        model.y_hessian[1 + i, 4 + i] = model.y_hessian[4 + i, 1 + i] = weight


@part
def handover_point(case: ScaledCase, target: Floats, y: Floats) -> tuple[float, float, float]:
    """Handover position of the final arc, solver axes."""
    _, _, r_e, r_s, _, _ = arc_weights(1.0, case.final_time)
    return (
        target[0] + r_e * y[1] + r_s * y[4],
        target[1] + r_e * y[2] + r_s * y[5],
        target[2] + r_e * y[3] + r_s * y[6],
    )


@part
def refresh_arc(case: ScaledCase, target: Floats, handover_mass: float, model: Model, y: Floats) -> float:
    """Gravity and mass along the final arc; returns the mass at touchdown.

    Gravity enters the thrust cones as an offset, the mass as the radius tau / m of each ball. Both are
    taken from the current arc, from the handover (sigma = 1) down to touchdown.
    """
    mass, last_sigma, last_norm = handover_mass, 1.0, 0.0
    W2 = case.spin * case.spin
    for j in range(case.arc_fractions.shape[0] - 1, -1, -1):
        sigma = case.arc_fractions[j]
        offset, A = model.cone_offset[j], model.cone_map[j]
        offset[:] = 0.0
        if case.compensated:
            _, _, r_e, r_s, _, _ = arc_weights(sigma, case.final_time)
            gx, gy, gz = gravity_on_arc(
                case,
                target[0] + r_e * y[1] + r_s * y[4],
                target[1] + r_e * y[2] + r_s * y[5],
                target[2] + r_e * y[3] + r_s * y[6],
            )
            offset[1], offset[2], offset[3] = -gx - W2 * target[0], -gy - W2 * target[1], -gz
        norm2 = 0.0
        for i in range(1, 4):
            total = offset[i]
            for a in range(1, 7):
                total += A[i, a] * y[a]
            norm2 += total * total
        norm = math.sqrt(norm2)
        if sigma < 1.0:
            rate = 0.5 * case.mass_flow * (norm + last_norm)
            mass *= math.exp(-rate * case.final_time * (last_sigma - sigma))
        A[0, 0] = case.arc_share / mass
        last_sigma, last_norm = sigma, norm
    return mass


@part
def _refresh_matching(case: ScaledCase, target: Floats, path: Path, model: Model, y: Floats) -> None:
    """Values and thrust derivatives of the six matching rows."""
    n = path.gradient.shape[0]
    _, _, _, _, v_e, v_s = arc_weights(1.0, case.final_time)
    x, yy, z = handover_point(case, target, y)
    end, speed = path.position[n], path.velocity[n]
    model.row_value[0], model.row_value[1], model.row_value[2] = end[0] - x, end[1] - yy, end[2] - z
    model.row_value[3] = speed[0] + case.spin * yy - v_e * y[1] - v_s * y[4]
    model.row_value[4] = speed[1] - case.spin * x - v_e * y[2] - v_s * y[5]
    model.row_value[5] = speed[2] - v_e * y[3] - v_s * y[6]
    pull_back(path, model.basis)


@part
def _refresh_handover_on_ellipsoid(case: ScaledCase, target: Floats, model: Model, point: Point) -> None:
    """Row 6: the handover on the ellipsoid, |xi(r_p)| = 1, linearised in y.

    Where its multiplier is positive the constraint bends the way of the objective, and its curvature
    goes into the Hessian.
    """
    x, y, z = handover_point(case, target, point.y)
    nx, ny, nz = ellipsoid_normal(case, 1.0, 0.0, x, y, z)
    level = nx * x + ny * y + nz * z
    _, _, r_e, r_s, _, _ = arc_weights(1.0, case.final_time)
    normal, weights, wx = (nx, ny, nz), (r_e, r_s), case.inverse_axes
    model.row_value[6] = level - 1.0
    model.row_end[6] = 0.0
    model.row_y[6, 0] = 0.0
    bend = max(point.multiplier[6], 0.0) / level
    for p in range(2):
        for a in range(3):
            model.row_y[6, 1 + a + 3 * p] = weights[p] * normal[a]
            for q in range(2):
                for b in range(3):
                    curvature = (wx[a] * wx[a] if a == b else 0.0) - normal[a] * normal[b]
                    model.y_hessian[1 + a + 3 * p, 1 + b + 3 * q] += (
                        bend * curvature * weights[p] * weights[q]
                    )


@part
def _refresh_approach(case: ScaledCase, target: Floats, model: Model, y: Floats, r: int) -> None:
    """Row r: an ellipsoid is reached from outside, -n . v_p >= 0, in the rotating frame.

    Between its last two nodes a path could else pass below and come up to the handover from inside.
    """
    px, py, pz = handover_point(case, target, y)
    nx, ny, nz = ellipsoid_normal(case, 1.0, 0.0, px, py, pz)
    _, _, r_e, r_s, v_e, v_s = arc_weights(1.0, case.final_time)
    normal, wx = (nx, ny, nz), case.inverse_axes
    level = nx * px + ny * py + nz * pz
    model.row_end[r] = 0.0
    model.row_y[r, 0] = model.row_value[r] = 0.0
    for i in range(3):
        turn = 0.0  # of the normal, as the handover moves along i
        for j in range(3):
            curvature = ((wx[i] * wx[i] if i == j else 0.0) - normal[i] * normal[j]) / level
            turn += curvature * (v_e * y[1 + j] + v_s * y[4 + j])
        model.row_y[r, 1 + i] = -v_e * normal[i] - r_e * turn
        model.row_y[r, 4 + i] = -v_s * normal[i] - r_s * turn
        model.row_value[r] -= normal[i] * (v_e * y[1 + i] + v_s * y[4 + i])


@part
def _refresh_propellant(
    case: ScaledCase, point: Point, path: Path, model: Model, r: int, touchdown_mass: float
) -> None:
    """Row r: propellant left, P - (1 - m_touchdown) >= 0, with an isotropic bound of its curvature."""
    n = path.gradient.shape[0]
    h, flow, own = 1.0 / n, case.mass_flow, model.basis.shape[1] - 1
    rounded = 0.0  # what the rounded cones of thrust burn more than the flight
    model.row_end[r], model.row_mix[r, own] = float(n), 1.0
    eta = -point.multiplier[r]
    for k in range(n):
        F = point.thrust[k]
        square = F[0] * F[0] + F[1] * F[1] + F[2] * F[2]
        norm = math.sqrt(square + COAST * COAST)
        rounded += flow * h * (norm - math.sqrt(square))
        for i in range(3):
            model.basis[k, own, i] = -flow * h * F[i] / norm
        model.thrust_curvature[k] += eta * flow * h / norm
    model.row_value[r] = case.propellant - (1.0 - touchdown_mass) - rounded
    model.row_y[r, :] = 0.0
    fractions = case.arc_fractions
    last = fractions.shape[0] - 1
    for j in range(last + 1):
        width = 0.5 * (fractions[min(j + 1, last)] - fractions[max(j - 1, 0)])
        A, b = model.cone_map[j], model.cone_offset[j]
        t0, t1, t2 = b[1], b[2], b[3]
        for a in range(1, 7):
            t0 += A[1, a] * point.y[a]
            t1 += A[2, a] * point.y[a]
            t2 += A[3, a] * point.y[a]
        norm = max(math.sqrt(t0 * t0 + t1 * t1 + t2 * t2), SMALL_THRUST)
        for a in range(1, 7):
            along = (A[1, a] * t0 + A[2, a] * t1 + A[3, a] * t2) / norm
            model.row_y[r, a] -= flow * touchdown_mass * case.final_time * width * along


@part
def _add_mass_gradient(case: ScaledCase, point: Point, path: Path, model: Model) -> float:
    """Gradient through the mass: -c h lambda_m F / |F|, the mass costate carried back from the handover.

    The rows hold the mass fixed; this term makes the stationarity residual exact (Zhao 2022, eqs 8, 11).
    Returns the mass costate at the start.
    """
    n = path.gradient.shape[0]
    h, costate = 1.0 / n, 0.0
    for j in range(case.arc_fractions.shape[0]):
        inverse = model.cone_map[j, 0, 0]
        costate += point.cone_dual[j, 0] * point.y[0] * inverse * inverse / case.arc_share
    for k in range(n - 1, -1, -1):
        F, pull = point.thrust[k], model.row_pull[k]
        power = pull[0] * F[0] + pull[1] * F[1] + pull[2] * F[2]
        slope = -power * 2.0 / (path.mass[k] + path.mass[k + 1])
        norm = max(math.sqrt(F[0] * F[0] + F[1] * F[1] + F[2] * F[2]), SMALL_THRUST)
        gain = case.mass_flow * h * (costate + 0.5 * slope) / norm
        for i in range(3):
            model.thrust_gradient[k, i] -= gain * F[i]
        costate += slope
    return costate


@inlined
def refresh(
    case: ScaledCase,
    target: Floats,
    plan: Layout,
    cuts: Cuts,
    retake: bool,
    point: Point,
    path: Path,
    model: Model,
) -> tuple[float, float]:
    """Linearise the whole problem at ``point``: fly it, and fill every row, cone and gradient.

    Where ``retake``, the tangent planes are moved to the path. What is constant while a facet is solved has
    been filled before.

    Returns
    -------
    energy : float
        J (Zhao 2022, eq 7), scaled.
    mass_costate : float
        Mass costate at the start.
    """
    n = point.thrust.shape[0]
    h, rho, y = 1.0 / n, plan.energy_weight, point.y
    fly(case, point.thrust, path)
    fill_energy(case, rho, model)
    touchdown_mass = refresh_arc(case, target, path.mass[n], model, y)
    _refresh_matching(case, target, path, model, y)
    energy = 0.0
    for k in range(n):
        F = point.thrust[k]
        energy += 0.5 * h * (F[0] * F[0] + F[1] * F[1] + F[2] * F[2])
        model.thrust_curvature[k] = rho * h
        for i in range(3):
            model.thrust_gradient[k, i] = rho * h * F[i]
    weight = case.final_time / 6.0
    model.y_gradient[0] = 1.0 if plan.tau_free else 0.0
    for i in range(1, 4):
        e, s = y[i], y[3 + i]
        energy += weight * (e * e + e * s + s * s)
        model.y_gradient[i] = rho * weight * (2.0 * e + s)
        model.y_gradient[3 + i] = rho * weight * (2.0 * s + e)
    if case.on_ellipsoid:
        _refresh_handover_on_ellipsoid(case, target, model, point)
        _refresh_approach(case, target, model, y, plan.n_equal)
    if case.propellant < 1.0:
        _refresh_propellant(case, point, path, model, plan.first_plane - 1, touchdown_mass)
    n_planes = plan.n_rows - plan.first_plane
    refresh_planes(case, target, path, model, cuts, plan.first_plane, n_planes, retake, y)
    fill_row_pull(point, model, plan.n_rows)
    return energy, _add_mass_gradient(case, point, path, model)
