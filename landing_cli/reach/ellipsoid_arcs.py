"""Tangent planes that lead a descent around the keep-out ellipsoid.

In the coordinates xi = sqrt(Re) r of the rotating body the ellipsoid is the unit sphere. Where a free path
dips inside, it is replaced by an arc on the sphere, in the plane of its entry, exit and deepest point, at
uniform angle in time; the planes that touch the sphere along the arc are the first cuts. The arc may pass
on either side of the centre.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import inlined, kernel, part
from landing_cli.kernel_lanes import WIDTH, lane
from landing_cli.reach.free_batch import CutBatch
from landing_cli.reach.scaled_case import ScaledCase, ellipsoid_level, least_between
from landing_cli.reach.shooting import SUBSTEPS, Flights, fly_some, new_flights

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Closer to the centre than this, the deepest point does not tell which side is shorter.
UNDECIDED = 0.1


@part
def last_cut_node(case: ScaledCase, position: Floats) -> int:
    """Last node that may carry a tangent plane: the handover has a row of its own when on the ellipsoid."""
    n = position.shape[0] - 1
    return n - 1 if case.on_ellipsoid else n


@inlined
def lowest_level(case: ScaledCase, position: Floats) -> float:
    """Least |xi| over the nodes of a path that may carry a tangent plane."""
    lowest = 1e9
    for k in range(1, last_cut_node(case, position) + 1):
        x = position[k]
        lowest = min(lowest, ellipsoid_level(case, case.node_cos[k], case.node_sin[k], x[0], x[1], x[2]))
    return lowest


@inlined
def lowest_level_between(case: ScaledCase, flights: Flights) -> float:
    """Least |xi| of accurate flights, between the nodes too.

    Thrust is constant within an interval, so |xi| is smooth there: a parabola through its ends and its
    middle finds the dip.
    """
    samples = flights.samples
    lowest = before = middle = 1e9
    for row in range(samples.shape[0]):
        x = samples[row]
        level = ellipsoid_level(case, flights.cosine[row], flights.sine[row], x[0], x[1], x[2])
        if row > 0 and row % SUBSTEPS == 0:
            lowest = min(lowest, least_between(before, middle, level))
        if row % SUBSTEPS == 0:
            before = level
        else:
            middle = level
    return lowest


@part
def _unit_coordinates(case: ScaledCase, k: int, x: Floats, xi: Floats) -> None:
    """Xi of a solver-axes position at node k."""
    c, s = case.node_cos[k], case.node_sin[k]
    xi[0] = (c * x[0] + s * x[1]) * case.inverse_axes[0]
    xi[1] = (c * x[1] - s * x[0]) * case.inverse_axes[1]
    xi[2] = x[2] * case.inverse_axes[2]


@part
def _plane_normal(case: ScaledCase, k: int, u: Floats, normal: Floats) -> None:
    """Normal, in solver axes, of the plane that touches the ellipsoid where xi = u at node k."""
    c, s = case.node_cos[k], case.node_sin[k]
    a, b = u[0] * case.inverse_axes[0], u[1] * case.inverse_axes[1]
    normal[0], normal[1], normal[2] = c * a - s * b, s * a + c * b, u[2] * case.inverse_axes[2]


@part
def _dot(u: Floats, v: Floats) -> float:
    """Scalar product."""
    return float(u[0] * v[0] + u[1] * v[1] + u[2] * v[2])


@part
def _dip(case: ScaledCase, position: Floats) -> tuple[int, int, int]:
    """Nodes before the entry, after the exit, and at the deepest point of a path's dip."""
    n = last_cut_node(case, position)
    first, last, deepest, lowest = n, 1, n, 1e9
    for k in range(1, n + 1):
        x = position[k]
        level = ellipsoid_level(case, case.node_cos[k], case.node_sin[k], x[0], x[1], x[2])
        if level < 1.0:
            first, last = min(first, k), k
        if level < lowest:
            deepest, lowest = k, level
    return max(1, first - 1), min(n, last + 1), deepest


@inlined
def arc_cuts(case: ScaledCase, position: Floats, side: float, node: Ints, normal: Floats) -> int:
    """Fill tangent planes along an arc around the ellipsoid; return their number.

    Parameters
    ----------
    case : ScaledCase
        The case.
    position : (N + 1, 3) float
        Nodes of a path that enters the ellipsoid, solver axes.
    side : float
        +1 to pass on the side of the path's deepest point, -1 on the other.
    node, normal : (C,) int, (C, 3) float
        Filled: the planes' nodes and normals.
    """
    n = last_cut_node(case, position)
    before, after, deepest = _dip(case, position)
    start, end, middle = np.empty(3), np.empty(3), np.empty(3)
    _unit_coordinates(case, before, position[before], start)
    _unit_coordinates(case, after, position[after], end)
    _unit_coordinates(case, deepest, position[deepest], middle)
    along, out, u = np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        along[i] = end[i] - start[i]
    norm = max(math.sqrt(_dot(along, along)), 1e-12)
    for i in range(3):
        along[i] /= norm
    depth = _dot(middle, along)
    for i in range(3):
        out[i] = middle[i] - depth * along[i]
    norm = math.sqrt(_dot(out, out))
    if norm < 1e-6:
        out[0], out[1], out[2] = -along[1], along[0], 0.0
        norm = math.sqrt(out[0] * out[0] + out[1] * out[1]) + 1e-12
    for i in range(3):
        out[i] *= side / norm
    angle = math.atan2(_dot(start, along), _dot(start, out))
    sweep = math.atan2(_dot(end, along), _dot(end, out)) - angle
    count = 0
    for k in range(max(1, before - 1), min(n, after + 1) + 1):
        if before <= k <= after:
            phi = angle + sweep * (k - before) / max(1, after - before)
            for i in range(3):
                u[i] = math.cos(phi) * out[i] + math.sin(phi) * along[i]
        else:
            _unit_coordinates(case, k, position[k], u)
            norm = math.sqrt(_dot(u, u))
            for i in range(3):
                u[i] /= norm
        _plane_normal(case, k, u, normal[count])
        node[count] = k
        count += 1
    return count


@inlined
def freeze_on_path(
    case: ScaledCase, position: Floats, node: Ints, normal: Floats, count: int, level: float
) -> int:
    """Move the planes to a path, add one wherever a node is below ``level``; return their number."""
    xi = np.empty(3)
    for k in range(1, last_cut_node(case, position) + 1):
        x = position[k]
        if ellipsoid_level(case, case.node_cos[k], case.node_sin[k], x[0], x[1], x[2]) < level:
            known = False
            for c in range(count):
                known = known or node[c] == k
            if not known:
                node[count] = k
                count += 1
    for c in range(count):
        k = node[c]
        _unit_coordinates(case, k, position[k], xi)
        norm = math.sqrt(_dot(xi, xi))
        for i in range(3):
            xi[i] /= norm
        _plane_normal(case, k, xi, normal[c])
    return count


@kernel
def lowest_levels(case: ScaledCase, positions: Floats, out: Floats) -> None:
    """Fill (n,) least |xi| over the nodes of (n, N + 1, 3) paths."""
    for i in range(positions.shape[0]):
        out[i] = lowest_level(case, positions[i])


def lowest_levels_between(case: ScaledCase, thrusts: Floats, out: Floats) -> None:
    """Fill (n,) least |xi| of accurate flights of (n, N, 3) thrusts, between the nodes too."""
    fill_levels_between(case, thrusts, new_flights(case, SUBSTEPS), out)


@kernel
def fill_levels_between(case: ScaledCase, thrusts: Floats, flights: Flights, out: Floats) -> None:
    """See :func:`lowest_levels_between`."""
    for first in range(0, thrusts.shape[0], WIDTH):
        fly_some(case, thrusts, first, flights)
        lowest = lowest_level_between(case, flights)
        for place in range(min(WIDTH, thrusts.shape[0] - first)):
            out[first + place] = lane(lowest, place)


@kernel
def arc_cuts_many(case: ScaledCase, positions: Floats, side: float, cuts: CutBatch) -> None:
    """Fill the planes of a batch along arcs on one side of the ellipsoid; see :func:`arc_cuts`."""
    for i in range(positions.shape[0]):
        cuts.planes[i] = arc_cuts(case, positions[i], side, cuts.node[i], cuts.normal[i])


@kernel
def freeze_many(case: ScaledCase, positions: Floats, levels: Floats, cuts: CutBatch) -> None:
    """Move the planes of a batch to its paths; see :func:`freeze_on_path`."""
    for i in range(positions.shape[0]):
        cuts.planes[i] = freeze_on_path(
            case, positions[i], cuts.node[i], cuts.normal[i], cuts.planes[i], levels[i]
        )
