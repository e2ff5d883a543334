"""Gravity where flights can be, for the bound of `keep_out_bound`.

Where the least value v of L is not positive, every flight with tau <= 1 still has L <= 0, and L rises from
where it is least as its form does: (o - o*)'H(o - o*) <= -v. So node i of every flight lies in a ball about
that of o*, of radius sqrt(-v) times the root of the largest eigenvalue of the i-th block of H^-1. Between two
nodes a flight keeps within A (t_i - t)(t - t_(i+1)) / 2 of their chord. Gravity is then known but for what it
varies by in these balls: c takes its value at their centres.

Outside the body g is harmonic, so |g - c|^2 is subharmonic: in a ball that is clear of the body it is largest
on the sphere, where patches bound it by its value, and its gradient, at their centres.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.bvh import SurfaceIndex
from landing_cli.body.clearance import signed_distances
from landing_cli.body.gravity.bounds import room_for_fit
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.field_values import accelerations, gradients
from landing_cli.reach.keep_out_bound import INTERVALS, NODES, PER_NODE, Descent, Facets, Least, applied
from landing_cli.reach.sides import OCTAHEDRON, quarters

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

# Balls along an interval; how often the octahedron's triangles are cut in four for the patches of a sphere.
BALLS, CUTS = 2, 2
_GRADIENT_MARGIN = 2.0  # covers the change of the gradient within a patch


class Balls(NamedTuple):
    """Balls that hold flights for a while."""

    centre: Floats  # (..., 3) solver axes, scaled
    radius: Floats  # (...)
    time: Floats  # (...) the middle of the while
    turn: float  # angle of the body from there to either end


def with_known_gravity(descent: Descent, surface: SurfaceIndex, facets: Facets, least: Least) -> Facets:
    """Suppose of flights what gravity can be where they must be.

    Parameters
    ----------
    descent : Descent
        The case.
    surface : SurfaceIndex
        The body's.
    facets : Facets
        What every flight with tau <= 1 keeps.
    least : Least
        The least value of L under these, not positive, for any weights.

    Returns
    -------
    Facets
        What every such flight keeps as well; bounds that would be no tighter stay.
    """
    along, handover = _balls(descent, least)
    sampled, spread = _gravity_in(descent, surface, along)
    known = sampled.mean(axis=2)
    apart = np.linalg.norm(sampled - known[:, :, None], axis=3) + spread
    bounds = 1.0 / descent.least_mass + apart.max(axis=2) + along.turn * descent.gravity
    tighter = bounds < facets.accelerations
    reference = np.where(tighter[:, :, None], known, facets.reference)
    facets = facets._replace(
        reference=reference,
        centre=descent.drift + descent.kernels.T @ reference,
        accelerations=np.where(tighter, bounds, facets.accelerations),
    )
    return _with_known_handover(descent, surface, facets, handover) if descent.case.compensated else facets


def _with_known_handover(descent: Descent, surface: SurfaceIndex, facets: Facets, handover: Balls) -> Facets:
    """Suppose of the thrust at the handover what gravity can be there."""
    known, spread = _gravity_in(descent, surface, handover)
    bound = 1.0 / descent.ends_mass[1] + spread
    tighter = bound < facets.arc_limits[:, 1]
    gravity = np.where(tighter[:, None], known, facets.handover_gravity)
    offsets, limits = facets.arc_offsets.copy(), facets.arc_limits.copy()
    offsets[:, 1] += facets.handover_gravity - gravity
    limits[:, 1] = np.where(tighter, bound, limits[:, 1])
    return facets._replace(handover_gravity=gravity, arc_offsets=offsets, arc_limits=limits)


def _balls(descent: Descent, least: Least) -> tuple[Balls, Balls]:
    """Balls along the intervals (n, N, BALLS), and at the handover (n,)."""
    case, n = descent.case, len(least.value)
    inverse = np.linalg.inv(least.form)
    blocks = np.stack([inverse[:, i : i + 3, i : i + 3] for i in range(0, 3 * NODES, 3)], axis=1)
    widest = np.linalg.eigvalsh(blocks)[:, :, 2]
    at_nodes = np.sqrt(np.maximum(-least.value, 0.0)[:, None] * widest)
    radius = np.concatenate([np.zeros((n, 1)), at_nodes], axis=1)
    start = np.broadcast_to(case.position, (n, 1, 3))
    nodes = np.concatenate([start, least.outputs[:, :NODES]], axis=1)
    width = 1.0 / (PER_NODE * BALLS)
    begin = np.tile(np.arange(PER_NODE * BALLS) * width, NODES)
    segment = np.repeat(np.arange(NODES), PER_NODE * BALLS)
    middle = begin + 0.5 * width
    chord = nodes[:, segment + 1] - nodes[:, segment]
    centre = nodes[:, segment] + middle[:, None] * chord
    grown = radius[:, segment + 1] - radius[:, segment]
    size = radius[:, segment] + np.maximum(begin * grown, (begin + width) * grown)
    size += 0.5 * width * np.linalg.norm(chord, axis=2)
    strongest = float((1.0 / descent.least_mass + descent.gravity).max())
    size += strongest / (8.0 * NODES**2)
    turn = 0.5 * width / NODES * abs(case.spin)
    size += turn * (np.linalg.norm(centre, axis=2) + size)
    shape = (n, INTERVALS, BALLS)
    time = np.broadcast_to((segment + middle) / NODES, size.shape)
    along = Balls(centre.reshape(*shape, 3), size.reshape(shape), time.reshape(shape), turn)
    return along, Balls(nodes[:, -1], radius[:, -1], np.ones(n), 0.0)


def _gravity_in(descent: Descent, surface: SurfaceIndex, balls: Balls) -> tuple[Floats, Floats]:
    """Gravity at the centres of balls (..., 3), scaled, and a bound of how far it is from that in the balls.

    The bound is infinite where a ball is not clear of the body.
    """
    case = descent.case
    field = GravityField(case.gravity_kind, case.gravity_params)
    angle = case.spin * (balls.time.ravel() - 1.0)
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    turns = np.moveaxis(np.array([[c, s, zero], [-s, c, zero], [zero, zero, one]]), 2, 0)
    centre_m = applied(turns, balls.centre.reshape(-1, 3)) * case.length_m
    radius_m = balls.radius.ravel() * case.length_m
    clear = signed_distances(surface, centre_m) > radius_m
    for mass_m in _point_masses(field):
        clear &= np.linalg.norm(centre_m - mass_m, axis=1) > radius_m
    gravity, spread = np.zeros_like(centre_m), np.full(len(radius_m), np.inf)
    if clear.any():
        gravity[clear] = accelerations(field, centre_m[clear])
        spread[clear] = _largest_change(field, centre_m[clear], radius_m[clear], gravity[clear])
        spread[clear] += (room_for_fit(field) - 1.0) * np.linalg.norm(gravity[clear], axis=1)
    gravity = applied(turns.transpose(0, 2, 1), gravity) / case.acceleration_m_s2
    return gravity.reshape(balls.centre.shape), (spread / case.acceleration_m_s2).reshape(balls.radius.shape)


def _point_masses(field: GravityField) -> Floats:
    """Where a field is singular, (k, 3), m: a polyhedron, which is the body, only on the body's surface."""
    if field.kind == GravityKind.DIPOLE:
        return np.array([[*field.params[1:3], 0.0], [*field.params[4:6], 0.0]])
    return np.zeros((1, 3))


def _largest_change(field: GravityField, centre_m: Floats, radius_m: Floats, gravity: Floats) -> Floats:
    """Bound |g - g(centre)| in balls (m,) that hold no masses, m/s2."""
    triangles = OCTAHEDRON
    for _ in range(CUTS):
        triangles = np.concatenate([np.stack(quarters(triangle)) for triangle in triangles])
    patches = triangles.sum(axis=1)
    patches /= np.linalg.norm(patches, axis=1, keepdims=True)
    reach = np.linalg.norm(triangles - patches[:, None], axis=2).max(axis=1)
    points = centre_m[:, None] + radius_m[:, None, None] * patches
    met = accelerations(field, points.reshape(-1, 3)).reshape(points.shape)
    change = np.linalg.norm(met - gravity[:, None], axis=2)
    slopes = gradients(field, points.reshape(-1, 3)).reshape(*points.shape[:2], 9)
    steepest = np.linalg.norm(slopes, axis=2)
    return np.asarray((change + _GRADIENT_MARGIN * radius_m[:, None] * reach * steepest).max(axis=1))
