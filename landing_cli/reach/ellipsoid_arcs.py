"""Tangent planes that lead a descent around the keep-out ellipsoid.

In the coordinates xi = sqrt(Re) r of the rotating body the ellipsoid is the unit sphere. Where a free path
dips inside, it is replaced by an arc on the sphere, in the plane of its entry, exit and deepest point, at
uniform angle in time; the planes that touch the sphere along the arc are the first cuts. The arc may pass
on either side of the centre.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from landing_cli.reach.scaled_case import ellipsoid_level

# Closer to the centre than this, the deepest point does not tell which side is shorter.
UNDECIDED = 0.1


@njit(cache=True, nogil=True, error_model="numpy")
def last_cut_node(case, path):
    """Last node that may carry a tangent plane: the handover has a row of its own when on the ellipsoid."""
    n = path.gradient.shape[0]
    return n - 1 if case.on_ellipsoid else n


@njit(cache=True, nogil=True, error_model="numpy")
def lowest_level(case, path):
    """Least |xi| over the nodes of a path that may carry a tangent plane."""
    lowest = 1e9
    for k in range(1, last_cut_node(case, path) + 1):
        x = path.position[k]
        lowest = min(lowest, ellipsoid_level(case, case.node_cos[k], case.node_sin[k], x[0], x[1], x[2]))
    return lowest


@njit(cache=True, nogil=True, error_model="numpy")
def _unit_coordinates(case, k, x, xi):
    """xi of a solver-axes position at node k."""
    c, s = case.node_cos[k], case.node_sin[k]
    xi[0] = (c * x[0] + s * x[1]) * case.inverse_axes[0]
    xi[1] = (c * x[1] - s * x[0]) * case.inverse_axes[1]
    xi[2] = x[2] * case.inverse_axes[2]


@njit(cache=True, nogil=True, error_model="numpy")
def _plane_normal(case, k, u, normal):
    """Normal, in solver axes, of the plane that touches the ellipsoid where xi = u at node k."""
    c, s = case.node_cos[k], case.node_sin[k]
    a, b = u[0] * case.inverse_axes[0], u[1] * case.inverse_axes[1]
    normal[0], normal[1], normal[2] = c * a - s * b, s * a + c * b, u[2] * case.inverse_axes[2]


@njit(cache=True, nogil=True, error_model="numpy")
def _dip(case, path):
    """Nodes before the entry, after the exit, and at the deepest point of a path's dip."""
    n = last_cut_node(case, path)
    first, last, deepest, lowest = n, 1, n, 1e9
    for k in range(1, n + 1):
        x = path.position[k]
        level = ellipsoid_level(case, case.node_cos[k], case.node_sin[k], x[0], x[1], x[2])
        if level < 1.0:
            first, last = min(first, k), k
        if level < lowest:
            deepest, lowest = k, level
    return max(1, first - 1), min(n, last + 1), deepest


@njit(cache=True, nogil=True, error_model="numpy")
def arc_cuts(case, path, side, cuts):
    """Fill ``cuts`` along an arc around the ellipsoid; return their number.

    Parameters
    ----------
    case : ScaledCase
        The case.
    path : Path
        A path that enters the ellipsoid.
    side : float
        +1 to pass on the side of the path's deepest point, -1 on the other.
    cuts : Cuts
        Room for one cut a node.
    """
    n = last_cut_node(case, path)
    before, after, deepest = _dip(case, path)
    start, end, middle = np.empty(3), np.empty(3), np.empty(3)
    _unit_coordinates(case, before, path.position[before], start)
    _unit_coordinates(case, after, path.position[after], end)
    _unit_coordinates(case, deepest, path.position[deepest], middle)
    along = end - start
    along /= max(math.sqrt(np.sum(along * along)), 1e-12)
    out = middle - np.sum(middle * along) * along
    norm = math.sqrt(np.sum(out * out))
    if norm < 1e-6:
        out[0], out[1], out[2] = -along[1], along[0], 0.0
        norm = math.sqrt(out[0] * out[0] + out[1] * out[1]) + 1e-12
    out *= side / norm
    angle = math.atan2(np.sum(start * along), np.sum(start * out))
    sweep = math.atan2(np.sum(end * along), np.sum(end * out)) - angle
    count = 0
    for k in range(max(1, before - 1), min(n, after + 1) + 1):
        if before <= k <= after:
            phi = angle + sweep * (k - before) / max(1, after - before)
            _plane_normal(case, k, math.cos(phi) * out + math.sin(phi) * along, cuts.normal[count])
        else:
            _unit_coordinates(case, k, path.position[k], middle)
            _plane_normal(case, k, middle / math.sqrt(np.sum(middle * middle)), cuts.normal[count])
        cuts.node[count] = k
        count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def freeze_on_path(case, path, cuts, count, level):
    """Move the cuts to the current path and add a cut wherever a node is below ``level``.

    Returns
    -------
    count, added : int
    """
    xi = np.empty(3)
    added = 0
    for k in range(1, last_cut_node(case, path) + 1):
        x = path.position[k]
        if ellipsoid_level(case, case.node_cos[k], case.node_sin[k], x[0], x[1], x[2]) < level:
            known = False
            for c in range(count):
                known = known or cuts.node[c] == k
            if not known:
                cuts.node[count] = k
                count += 1
                added += 1
    for c in range(count):
        k = cuts.node[c]
        _unit_coordinates(case, k, path.position[k], xi)
        _plane_normal(case, k, xi / math.sqrt(np.sum(xi * xi)), cuts.normal[c])
    return count, added
