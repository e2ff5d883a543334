"""A bound on the thrust level of all flights that stay outside the keep-out ellipsoid, on whichever side.

The outside |xi| >= 1 is not convex, but its Lagrangian is a quadratic form, and so is everything else here
but the glide slope, which is linear. Every flight with tau <= 1 has

- |a(t) - c(t)| <= A_k in interval k of the descent, with A_k = 1/m + sup |g - c|: a is its acceleration, m
  the least mass that it can have, c any acceleration that is chosen beforehand (none, or about gravity's);
- |xi(t_i)| >= level at the nodes t_i, the last one being the handover; where that is to be on the ellipsoid,
  |xi| <= level there as well, which enters below with the other sign;
- |B_j s + b_j| <= C_j at both ends of the final arc, whose thrust per mass is affine in the handover state
  s = (r, v) but for gravity: C_j = 1/m_j + sup of what gravity differs by from what b_j takes it to be;
- S_c s + d_c in the second-order cone Q for the glide slope, at the handover and at touchdown.

For weights w_k, mu_i, omega_j >= 0 and z_c in Q, no such flight therefore makes

    L = sum w_k int |a - c|^2 - sum mu_i (|xi_i|^2 - level^2) + sum omega_j |B_j s + b_j|^2
        - sum z_c'(S_c s + d_c) - D,        D = sum w_k h A_k^2 + sum omega_j C_j^2,

positive: where the least value of L over all paths is, no flight exists. With G the Gramian of the outputs
o = (r(t_1), ..., r(t_K), v(1)) under the weight 1/w, int w |a - c|^2 is at least e'(G^-1 x I)e, where e is o
less the outputs of a = c, and some control attains it: the least value over paths is that over o, exact in
continuous time. It is finite where the form H of L in o is positive definite. With the multipliers of a
flight of least thrust L falls no lower than tau^2 - 1 says, so there is no gap, unless flights of about the
same tau on several sides make H lose rank before.

A flight with less thrust, tau = T, keeps all this with T/m in place of 1/m, which lowers D to D(T). So the T
with L + D - D(T) = 0 is a bound on tau like that of `certificate`: up to 1 it is one, and above 1 it
contradicts tau <= 1 and tells no more.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.field_values import accelerations
from landing_cli.kernel import kernel
from landing_cli.optimize.conic_records import Model, new_model
from landing_cli.reach.certificate import GravityBounds, gravity_tube
from landing_cli.reach.descent_model import fill_arc_cones
from landing_cli.reach.planes import arc_weights
from landing_cli.reach.records import LandingCase
from landing_cli.reach.scaled_case import ScaledCase, scale_case

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Nodes at which flights are held outside the ellipsoid, and intervals of the weights between two of them.
NODES, PER_NODE = 8, 2
INTERVALS = NODES * PER_NODE
# |xi| that flights keep, and have at most at a handover on the ellipsoid: delivered ones may be so far off 1.
LEVEL, HIGHEST = 1.0 - 1e-5, 1.0 + 1e-5


@kernel
def _fill_arc_cones(case: ScaledCase, model: Model) -> None:
    fill_arc_cones(case, model)


class Descent(NamedTuple):
    """What all facets of a case share: K nodes, N intervals, outputs o = (r(t_1), ..., r(t_K), v(1))."""

    case: ScaledCase
    roots: Floats  # (N, K + 1, 2) R_k: R_k R_k' holds the integrals over interval k of the kernels' products
    kernels: Floats  # (N, K + 1) integrals of the kernels themselves
    drift: Floats  # (K + 1, 3) outputs of a = 0
    places: Ints  # (M,) outputs that are held to the ellipsoid: every node, and the last again from inside
    outside: Floats  # (M,) 1, or -1 for a position that may be no farther out
    levels: Floats  # (M,) of |xi|
    axes: Floats  # (M, 3, 3) xi(t_i) from r(t_i)
    keep_out: Floats  # (M, 3, 3) Q_i with |xi(t_i)|^2 = r'Q_i r
    least_mass: Floats  # (N,) at tau <= 1
    ends_mass: Floats  # (2,) at touchdown and at handover
    gravity: Floats  # (N,) bounds of gravity along the descent
    arc_maps: Floats  # (2, 3, 6) B_j of the handover state
    to_ends: Floats  # (6, 6) handover state, less that of the landing point, from (a_e, a_s)


class Facets(NamedTuple):
    """What is supposed of the flights to each of n facets."""

    reference: Floats  # (n, N, 3) c_k
    centre: Floats  # (n, K + 1, 3) outputs of a = c
    accelerations: Floats  # (n, N) bounds A_k
    handover_gravity: Floats  # (n, 3) what b_j at the handover takes gravity to be
    arc_offsets: Floats  # (n, 2, 3) b_j
    arc_limits: Floats  # (n, 2) C_j
    slopes: Floats  # (n, 2, 3, 6) S_c
    slope_offsets: Floats  # (n, 2, 3) d_c


class Weights(NamedTuple):
    """Multipliers of n facets."""

    thrust: Floats  # (n, N) w
    ellipsoid: Floats  # (n, M) mu
    arc: Floats  # (n, 2) omega
    slope: Floats  # (n, 2, 3) z


class Least(NamedTuple):
    """The least value of L, and where it is attained."""

    value: Floats  # (n,) -inf where the form is not positive definite
    outputs: Floats  # (n, K + 1, 3)
    form: Floats  # (n, 3 (K + 1), 3 (K + 1)) H
    volume: Floats  # (n,) log det H, or -inf
    inverse_gramian: Floats  # (n, K + 1, K + 1)


def descent_of(case: LandingCase, bounds: GravityBounds) -> Descent:
    """Compute what all facets of a case share."""
    scaled = scale_case(case, INTERVALS)._replace(propellant=2.0)
    h, nodes = 1.0 / INTERVALS, np.arange(1, NODES + 1) / NODES
    # kernels of the outputs, (t_i - s)+ and 1 for the last velocity: linear between ends of intervals
    ends = np.arange(INTERVALS + 1) * h
    at = np.concatenate([np.maximum(nodes - ends[:, None], 0.0), np.ones((INTERVALS + 1, 1))], axis=1)
    middle, slope = 0.5 * (at[1:] + at[:-1]), at[1:] - at[:-1]
    roots = np.stack([math.sqrt(h) * middle, math.sqrt(h / 12.0) * slope], axis=2)
    drift = np.concatenate([scaled.position + nodes[:, None] * scaled.velocity, scaled.velocity[None]])
    c, s = scaled.node_cos[PER_NODE::PER_NODE], scaled.node_sin[PER_NODE::PER_NODE]
    zero, one = np.zeros(NODES), np.ones(NODES)
    turns = np.moveaxis(np.array([[c, s, zero], [-s, c, zero], [zero, zero, one]]), 2, 0)
    places = np.arange(NODES + 1 if scaled.on_ellipsoid else NODES)
    places[NODES:] = NODES - 1
    outside = np.where(np.arange(len(places)) < NODES, 1.0, -1.0)
    axes = scaled.inverse_axes[:, None] * turns[places]
    used = scaled.mass_flow * np.concatenate([ends[1:], [1.0 + scaled.final_time, 1.0]])
    model = new_model(INTERVALS, len(scaled.arc_fractions) + 2, 7)
    _fill_arc_cones(scaled, model)
    to_ends = _handover_from_ends(scaled)
    arc_maps = model.cone_map[[0, len(scaled.arc_fractions) - 1], 1:4, 1:7] @ np.linalg.inv(to_ends)
    return Descent(
        scaled,
        roots,
        h * middle,
        drift,
        places,
        outside,
        np.where(outside > 0.0, LEVEL, HIGHEST),
        axes,
        axes.transpose(0, 2, 1) @ axes,
        1.0 - used[:-2],
        1.0 - used[-2:],
        gravity_tube(scaled, bounds),
        arc_maps,
        to_ends,
    )


def _handover_from_ends(case: ScaledCase) -> Floats:
    """Map of (a_e, a_s) to the handover state in space, less that of standing on the landing point."""
    _, _, r_e, r_s, v_e, v_s = arc_weights(1.0, case.final_time)
    eye, cross = np.eye(3), _cross(case)
    position = np.concatenate([r_e * eye, r_s * eye], axis=1)
    velocity = np.concatenate([v_e * eye, v_s * eye], axis=1)
    return np.concatenate([position, velocity + cross @ position])


def _cross(case: ScaledCase) -> Floats:
    """W x, as a matrix."""
    return np.array([[0.0, -case.spin, 0.0], [case.spin, 0.0, 0.0], [0.0, 0.0, 0.0]])


def facets_of(descent: Descent, targets: Floats, normals: Floats) -> Facets:
    """Suppose of the flights to some facets what the tube of gravity lets every flight do.

    Parameters
    ----------
    descent : Descent
        The case.
    targets, normals : (n, 3) float
        Touchdown points (scaled) and outward facet normals, body axes.

    Returns
    -------
    Facets
    """
    case, n = descent.case, len(targets)
    still = np.concatenate([targets, applied(_cross(case), targets)], axis=1)
    slopes = _slope_cones(case, normals) @ np.linalg.inv(descent.to_ends)
    offsets, limits = np.zeros((n, 2, 3)), np.tile(1.0 / descent.ends_mass, (n, 1))
    if case.compensated:
        # thrust per mass is a* - g + 2 w x v + w x (w x r): gravity is known where it lands
        offsets[:, :, :2] -= case.spin**2 * targets[:, None, :2]
        field = GravityField(case.gravity_kind, case.gravity_params)
        offsets[:, 0] -= accelerations(field, targets * case.length_m) / case.acceleration_m_s2
        limits[:, 1] += descent.gravity[-1]
    offsets -= applied(descent.arc_maps, still[:, None])
    return Facets(
        np.zeros((n, INTERVALS, 3)),
        np.tile(descent.drift, (n, 1, 1)),
        np.tile(1.0 / descent.least_mass + descent.gravity, (n, 1)),
        np.zeros((n, 3)),
        offsets,
        limits,
        slopes,
        -applied(slopes, still[:, None]),
    )


def _slope_cones(case: ScaledCase, normals: Floats) -> Floats:
    """Rows in (a_e, a_s) of the glide slope's cones at the handover and at touchdown, (n, 2, 3, 6)."""
    helpers = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    across = np.cross(normals, helpers)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    frames = np.stack([case.tan_half_angle * normals, across, np.cross(normals, across)], axis=1)
    handover = np.concatenate([2.0 * frames, frames], axis=2)
    touchdown = np.concatenate([frames, np.zeros_like(frames)], axis=2)
    return np.stack([handover, touchdown], axis=1)


def least_value(descent: Descent, facets: Facets, weights: Weights) -> Least:
    """Find the least value of L over all paths.

    Parameters
    ----------
    descent : Descent
        The case.
    facets : Facets
        What flights keep.
    weights : Weights
        Not negative, and in the cone; any such give a valid bound.

    Returns
    -------
    Least
    """
    w, mu, omega, z = weights
    n, last = len(w), 3 * (NODES - 1)
    centre, ends = facets.centre, facets.centre.reshape(n, -1)[:, last:]
    # sums run within a facet, never across them: a facet's numbers do not depend on its company
    products = (descent.roots @ descent.roots.transpose(0, 2, 1)).reshape(INTERVALS, -1)
    gramian = ((1.0 / w)[:, None] @ products).reshape(n, NODES + 1, NODES + 1)
    inverse = np.linalg.inv(gramian)
    inverse = 0.5 * (inverse + inverse.transpose(0, 2, 1))
    form = (inverse[:, :, None, :, None] * np.eye(3)[:, None, :]).reshape(n, 3 * NODES + 3, 3 * NODES + 3)
    signed, held = descent.outside * mu, centre[:, descent.places]
    blocks = signed[:, :, None, None] * descent.keep_out
    pulled = applied(blocks, held)
    linear = np.zeros((n, 3 * NODES + 3))
    for i, place in enumerate(descent.places):
        at = slice(3 * place, 3 * place + 3)
        form[:, at, at] -= blocks[:, i]
        linear[:, at] -= pulled[:, i]
    maps = descent.arc_maps
    form[:, last:, last:] += (omega[:, :, None, None] * (maps.transpose(0, 2, 1) @ maps)).sum(axis=1)
    thrust = applied(maps, ends[:, None]) + facets.arc_offsets
    slopes = applied(facets.slopes, ends[:, None]) + facets.slope_offsets
    linear[:, last:] += applied(maps.transpose(0, 2, 1), omega[:, :, None] * thrust).sum(axis=1)
    linear[:, last:] -= 0.5 * applied(facets.slopes.transpose(0, 1, 3, 2), z).sum(axis=1)
    value = (signed * descent.levels**2).sum(axis=1) - (pulled * held).sum(axis=(1, 2))
    value += (omega * ((thrust**2).sum(axis=2) - facets.arc_limits**2)).sum(axis=1)
    value -= (z * slopes).sum(axis=(1, 2)) + (w * facets.accelerations**2).sum(axis=1) / INTERVALS
    volume = _log_determinants(form)
    definite = np.isfinite(volume)
    safe = np.where(definite[:, None, None], form, np.eye(3 * NODES + 3))
    step = -np.linalg.solve(safe, linear[:, :, None])[:, :, 0]
    value += (linear * step).sum(axis=1)
    outputs = centre + step.reshape(n, NODES + 1, 3)
    return Least(np.where(definite, value, -np.inf), outputs, form, volume, inverse)


def applied(matrices: Floats, vectors: Floats) -> Floats:
    """Multiply matrices (..., a, b) and vectors (..., b)."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def thrust_level(descent: Descent, facets: Facets, weights: Weights, value: Floats) -> Floats:
    """Bound tau by the least value of L for some weights.

    Parameters
    ----------
    descent : Descent
        The case.
    facets : Facets
        What flights keep.
    weights : Weights
        Of the value.
    value : (n,) float
        From :func:`least_value`.

    Returns
    -------
    (n,) float
        The level T at which L + D - D(T) vanishes; 0 where there is none.
    """
    masses = np.concatenate([descent.least_mass, descent.ends_mass])
    w = np.concatenate([weights.thrust / INTERVALS, weights.arc], axis=1)
    limits = np.concatenate([facets.accelerations, facets.arc_limits], axis=1)
    gravity = limits - 1.0 / masses
    square, twice = (w / masses**2).sum(axis=1), (w * gravity / masses).sum(axis=1)
    rest = (w * gravity**2).sum(axis=1) - (w * limits**2).sum(axis=1) - value
    root = np.sqrt(np.maximum(twice**2 - square * rest, 0.0))
    return np.maximum((root - twice) / square, 0.0)


def _log_determinants(forms: Floats) -> Floats:
    """Logarithms of the determinants of symmetric matrices, -inf where they are not positive definite."""
    try:
        factors = np.linalg.cholesky(forms)
    except np.linalg.LinAlgError:
        if len(forms) == 1:
            return np.full(1, -np.inf)
        half = len(forms) // 2
        return np.concatenate([_log_determinants(forms[:half]), _log_determinants(forms[half:])])
    return np.asarray(2.0 * np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(axis=1))
