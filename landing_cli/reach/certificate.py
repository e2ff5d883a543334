"""A proof that a facet cannot be reached: a lower bound on the thrust level from any multipliers.

The least thrust level tau (a fraction of T_max) that reaches a facet is a gauge, so weak duality bounds
it. Take multipliers lambda = (q, p) of the matching rows and z_j in Q of the handover cones with
sum_j A_j' z_j = A_y' lambda. Every feasible flight then satisfies, with s = 1 - t,

    tau [ int |p + q s| / m dt + sum_j z_j0 / m_j ]
        >= -lambda' E - int |p + q s| gbar(t) dt - sup sum_j z_j' b_j ,

where E holds the drift without gravity, gbar(t) bounds gravity wherever a flight with tau <= 1 can be at
time t, and m, m_j are the least masses that tau <= 1 allows. A right-hand side that makes tau > 1
therefore contradicts tau <= 1. |p + q s| is convex in t, so the trapezoid rule bounds its integral
from above.

Of the keep-out ellipsoid it takes planes n . r(t_k) >= level at some nodes, each with a multiplier -eta <= 0:
p + q s is then joined by -sum eta (t_k - t)+ n, still convex in size between nodes, and the work by the
drift's. A bound with planes is one for the flights that keep to them; `sides` covers all flights so.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.gravity.bounds import largest_acceleration_outside
from landing_cli.body.gravity.surface_bound import largest_acceleration_on_mesh
from landing_cli.kernel import part
from landing_cli.optimize.conic_records import Model, Point
from landing_cli.reach.descent_model import Layout
from landing_cli.reach.planes import Cuts
from landing_cli.reach.scaled_case import ScaledCase, gravity_on_arc

Floats = NDArray[np.float64]

# Shells around the ellipsoid, up to this multiple of its least semi-axis.
SHELLS, FARTHEST_SHELL = 12, 6.0


class GravityBounds(NamedTuple):
    """Upper bounds of gravity around an asteroid, m/s2; they depend on nothing else."""

    radius_m: Floats  # (S,) ascending
    outside_m_s2: Floats  # (S,) beyond each radius and outside the keep-out ellipsoid
    on_arcs_m_s2: float  # on and above the surface, where the final arcs fly


def gravity_bounds(asteroid: Asteroid, ellipsoid_m: Floats) -> GravityBounds:
    """Bound gravity outside the keep-out ellipsoid, by distance, and on the surface."""
    radii = np.min(ellipsoid_m) * np.geomspace(1.0, FARTHEST_SHELL, SHELLS)
    return GravityBounds(
        radii,
        largest_acceleration_outside(asteroid.gravity, radii, ellipsoid_m),
        largest_acceleration_on_mesh(asteroid.gravity, asteroid.mesh),
    )


def gravity_tube(scaled: ScaledCase, bounds: GravityBounds) -> Floats:
    """Upper bounds of gravity along the descent stage, (N,), scaled.

    In interval k no flight with full thrust can be nearer to the centre than its drift without forces
    minus (1/m + g) t^2 / 2, nor inside the keep-out ellipsoid.
    """
    n = len(scaled.mid_cos)
    outside = bounds.outside_m_s2 / scaled.acceleration_m_s2
    t = np.arange(n + 1) / n
    drift = np.linalg.norm(scaled.position + t[:, None] * scaled.velocity, axis=1)
    strongest = 1.0 / (1.0 - min(scaled.mass_flow, scaled.propellant)) + outside[0]
    distance = drift - 0.5 * strongest * t**2
    # within an interval the drift, which is straight, and the parabola stay this close to their chords
    bend = strongest + float(scaled.velocity @ scaled.velocity) / max(drift.min(), 1e-6)
    nearest = (np.minimum(distance[:-1], distance[1:]) - bend / (8 * n**2)) * scaled.length_m
    shell = np.searchsorted(bounds.radius_m, nearest, side="right") - 1
    return outside[np.maximum(shell, 0)]


@part
def _drift_work(case: ScaledCase, target: Floats, q: Floats, p: Floats) -> float:
    """-lambda' E for the drift without gravity: E_r = r_c - r0 - v0, E_v = w x r_c - v0."""
    r, v = case.position, case.velocity
    total = 0.0
    for i in range(3):
        total -= q[i] * (target[i] - r[i] - v[i]) - p[i] * v[i]
    return total - case.spin * (p[1] * target[0] - p[0] * target[1])


@part
def _plane_work(
    case: ScaledCase, multiplier: Floats, cuts: Cuts, planes: int, level: float, h: float
) -> float:
    """What the drift without gravity keeps of the planes, by their multipliers (never positive)."""
    first, total = 7 if case.on_ellipsoid else 6, 0.0
    for c in range(planes):
        kept = -level
        for i in range(3):
            kept += cuts.normal[c, i] * (case.position[i] + cuts.node[c] * h * case.velocity[i])
        total += min(multiplier[first + c], 0.0) * kept
    return total


@part
def _descent_integrals(
    case: ScaledCase, tube: Floats, multiplier: Floats, cuts: Cuts, planes: int
) -> tuple[float, float]:
    """Upper bounds of int |p + q s + ...| / m and int |p + q s + ...| gbar by the trapezoid rule."""
    n = tube.shape[0]
    h = 1.0 / n
    first = 7 if case.on_ellipsoid else 6
    by_thrust = by_gravity = last = 0.0
    for k in range(n + 1):
        s = 1.0 - k * h
        x, y, z = (
            multiplier[3] + s * multiplier[0],
            multiplier[4] + s * multiplier[1],
            multiplier[5] + s * multiplier[2],
        )
        for c in range(planes):
            if cuts.node[c] > k:
                lever = min(multiplier[first + c], 0.0) * (cuts.node[c] - k) * h
                x += lever * cuts.normal[c, 0]
                y += lever * cuts.normal[c, 1]
                z += lever * cuts.normal[c, 2]
        norm = math.sqrt(x * x + y * y + z * z)
        if k > 0:
            area = 0.5 * h * (last + norm)
            by_thrust += area / (1.0 - min(case.mass_flow * k * h, case.propellant))
            by_gravity += area * tube[k - 1]
        last = norm
    return by_thrust, by_gravity


@part
def _dual_feasible(
    case: ScaledCase, model: Model, multiplier: Floats, n_rows: int, cone_dual: Floats, duals: Floats
) -> None:
    """Fill ``duals`` with ``cone_dual``, made to satisfy sum_j A_j' z_j = A_y' lambda.

    This is done by way of the balls at the arc's two ends.
    """
    arcs = case.arc_fractions.shape[0]
    for j in range(arcs + 2):
        for i in range(4):
            duals[j, i] = cone_dual[j, i]
    for j in range(arcs, arcs + 2):
        z = duals[j]
        z[0] = max(z[0], math.sqrt(z[1] * z[1] + z[2] * z[2]))
    e = np.zeros(7)
    for a in range(1, 7):
        for r in range(n_rows):
            e[a] += model.row_y[r, a] * multiplier[r]
        for j in range(arcs + 2):
            for i in range(4):
                e[a] -= model.cone_map[j, i, a] * duals[j, i]
    # handover ball: the block of a_s is ((d, -c, 0), (c, d, 0), (0, 0, f)); solve with its transpose
    A, z = model.cone_map[arcs - 1], duals[arcs - 1]
    d, c = A[1, 4], A[2, 4]
    scale = 1.0 / (d * d + c * c)
    x0, x1, x2 = scale * (d * e[4] - c * e[5]), scale * (c * e[4] + d * e[5]), e[6] / A[3, 6]
    z[1] += x0
    z[2] += x1
    z[3] += x2
    # touchdown ball: its block of a_e is the identity
    for a in range(1, 4):
        duals[0, a] += e[a] - (A[1, a] * x0 + A[2, a] * x1 + A[3, a] * x2)
    for j in range(arcs):
        z = duals[j]
        z[0] = math.sqrt(z[1] * z[1] + z[2] * z[2] + z[3] * z[3])


@part
def certified_thrust_level(
    case: ScaledCase,
    target: Floats,
    tube: Floats,
    arc_bound: float,
    model: Model,
    multiplier: Floats,
    cone_dual: Floats,
    duals: Floats,
    cuts: Cuts,
    planes: int,
    level: float,
) -> float:
    """Lower bound on the thrust level; above 1 it proves the facet unreachable.

    With planes, it proves that of the flights that keep to all of them.

    Parameters
    ----------
    case : ScaledCase
        The case.
    target : (3,) float
        Touchdown point, scaled.
    tube : (N,) float
        Bounds of gravity from :func:`gravity_tube`.
    arc_bound : float
        Bound of gravity along the final arcs, scaled.
    model : Model
        Its matching rows' and cones' constant derivatives.
    multiplier : (R,) float
        The first six are used, and those of the planes; any values give a valid bound.
    cone_dual : (J, 4) float
        Any values; projected to dual feasibility.
    duals : (J, 4) float
        Scratch space.
    cuts : Cuts
        Planes n . r >= level, each at one node.
    planes : int
        How many of them count; 0 for a bound on all flights.
    level : float
        What they keep.

    Returns
    -------
    bound : float
    """
    q, p = multiplier[0:3], multiplier[3:6]
    _dual_feasible(case, model, multiplier, q.shape[0] + p.shape[0], cone_dual, duals)
    by_thrust, by_gravity = _descent_integrals(case, tube, multiplier, cuts, planes)
    work = _drift_work(case, target, q, p) - by_gravity
    work += _plane_work(case, multiplier, cuts, planes, level, 1.0 / tube.shape[0])
    W2 = case.spin * case.spin
    for j in range(case.arc_fractions.shape[0]):
        z = duals[j]
        mass = 1.0 - min(
            case.mass_flow * (1.0 + case.final_time * (1.0 - case.arc_fractions[j])), case.propellant
        )
        by_thrust += z[0] / mass
        if case.compensated:
            # z' b_j with b_j = -g + w x (w x r_c)
            work += W2 * (z[1] * target[0] + z[2] * target[1])
            if case.arc_fractions[j] == 0.0:
                gx, gy, gz = gravity_on_arc(case, target[0], target[1], target[2])
                work += z[1] * gx + z[2] * gy + z[3] * gz
            else:  # the handover is outside the ellipsoid
                work -= z[0] * (tube[-1] if case.arc_fractions[j] == 1.0 else arc_bound)
    return work / by_thrust


@part
def linearised_thrust_level(
    case: ScaledCase, plan: Layout, point: Point, model: Model, duals: Floats
) -> float:
    """Lower bound on the thrust level of the problem as it is linearised now, tangent planes included.

    The same weak duality with frozen gravity, masses and planes: no proof about the facet, but once it
    is above 1 the least-energy iterations at full thrust have nothing to converge to.
    """
    work = by_thrust = 0.0
    for r in range(plan.n_rows):
        value = model.row_value[r]
        for a in range(1, 7):
            value -= model.row_y[r, a] * point.y[a]
        work += point.multiplier[r] * value
    for k in range(point.thrust.shape[0]):
        pull, F = model.row_pull[k], point.thrust[k]
        work -= pull[0] * F[0] + pull[1] * F[1] + pull[2] * F[2]
        by_thrust += math.sqrt(pull[0] * pull[0] + pull[1] * pull[1] + pull[2] * pull[2])
    _dual_feasible(case, model, point.multiplier, plan.n_rows, point.cone_dual, duals)
    for j in range(plan.n_cones):
        for i in range(4):
            work -= duals[j, i] * model.cone_offset[j, i]
        by_thrust += duals[j, 0] * model.cone_map[j, 0, 0]
    return work / by_thrust
