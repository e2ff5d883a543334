"""Whether a sampled path keeps its distance up to the safety cone and stays in the cone after it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.bvh import SurfaceIndex
from landing_cli.body.clearance import TOUCHDOWN_TOLERANCE_M, signed_distance_from
from landing_cli.body.vertex_distance import vertex_distance
from landing_cli.kernel import kernel, part

FloatArray = NDArray[np.float64]

KEPT, TOO_CLOSE, CUTS = 0, 1, 2
"""Verdicts of `check_path`: every sample is clear, one is not, one after the cone entry is in the body."""


@part
def cone_entry(path: FloatArray, apex: FloatArray, axis: FloatArray, half_angle: float) -> int:
    """First sample from which a path stays in the safety cone to its end (Lyu 2026, eq 3).

    Parameters
    ----------
    path : (n, 3) float, m, body frame
        Samples in the order of flight.
    apex : (3,) float, m, body frame
        r_f.
    axis : (3,) float
        n_f, unit.
    half_angle : float, rad
        theta_max, less than a right angle.

    Returns
    -------
    int
        n where the last sample itself lies outside. The apex counts as inside.
    """
    share = math.cos(half_angle)
    for k in range(path.shape[0] - 1, -1, -1):
        x, y, z = path[k, 0] - apex[0], path[k, 1] - apex[1], path[k, 2] - apex[2]
        along = x * axis[0] + y * axis[1] + z * axis[2]
        if not along >= share * math.sqrt(x * x + y * y + z * z):
            return k + 1
    return 0


@part
def check_path(
    surface: SurfaceIndex, by_vertices: bool, path: FloatArray, entry: int, clearance: float
) -> tuple[int, float, int]:
    """Check a path against the surface, from its end to its start (Lyu 2026, eq 2).

    Samples that lie within the last distance less what is asked of the last sample that was measured are
    skipped: a distance changes by no more than the way between two points.

    Parameters
    ----------
    surface : SurfaceIndex
        The surface.
    by_vertices : bool
        Whether clearance is the distance to the nearest vertex instead of the surface.
    path : (n, 3) float, m, body frame
        Samples in the order of flight.
    entry : int
        First sample inside the cone for good; those before it need the clearance, and the others must not
        lie in the body by more than the touchdown tolerance.
    clearance : float, m
        h_min.

    Returns
    -------
    (int, float, int)
        Verdict, the distance of the sample at fault (m; what is asked where none is) and how many distances
        were computed.
    """
    slot, corner, measured = np.int64(0), np.int64(0), 0
    slack, kx, ky, kz = -1.0, 0.0, 0.0, 0.0
    for k in range(path.shape[0] - 1, -1, -1):
        x, y, z = path[k, 0], path[k, 1], path[k, 2]
        far = (x - kx) ** 2 + (y - ky) ** 2 + (z - kz) ** 2 > slack * slack
        if slack > 0.0 and not far and k != entry - 1:  # before the entry more is asked than after it
            continue
        measured += 1
        distance, slot = signed_distance_from(surface, x, y, z, slot)
        kx, ky, kz = x, y, z
        if k >= entry:
            slack = distance
            if not distance >= -TOUCHDOWN_TOLERANCE_M:
                return CUTS, distance, measured
        elif by_vertices:
            to_vertex, corner = vertex_distance(surface, x, y, z, corner)
            if not distance >= 0.0:
                return TOO_CLOSE, distance, measured
            slack = min(distance, to_vertex - clearance)
            if not slack >= 0.0:
                return TOO_CLOSE, to_vertex, measured
        else:
            slack = distance - clearance
            if not slack >= 0.0:
                return TOO_CLOSE, distance, measured
    return KEPT, clearance, measured


@kernel
def least_distance(
    surface: SurfaceIndex, by_vertices: bool, path: FloatArray, start: int, stop: int
) -> tuple[float, int]:
    """Least distance of a stretch of a path, from its end to its start; what cannot be less is skipped.

    Parameters
    ----------
    surface : SurfaceIndex
        The surface.
    by_vertices : bool
        Whether the distance is that to the nearest vertex (that to the surface where a sample lies inside the
        body: a vertex distance has no sign).
    path : (n, 3) float, m, body frame
        Samples in the order of flight.
    start, stop : int
        First sample of the stretch, and the first beyond it.

    Returns
    -------
    (float, int)
        Distance (m) and sample; infinity and -1 for an empty stretch.
    """
    least, where, slot, corner = np.inf, -1, np.int64(0), np.int64(0)
    slack, kx, ky, kz = -1.0, 0.0, 0.0, 0.0
    for k in range(stop - 1, start - 1, -1):
        x, y, z = path[k, 0], path[k, 1], path[k, 2]
        if slack > 0.0 and (x - kx) ** 2 + (y - ky) ** 2 + (z - kz) ** 2 <= slack * slack:
            continue
        kx, ky, kz = x, y, z
        distance, slot = signed_distance_from(surface, x, y, z, slot)
        outside = distance  # how far the surface is, before which a vertex distance keeps its meaning
        if by_vertices and distance >= 0.0:
            distance, corner = vertex_distance(surface, x, y, z, corner)
        if distance < least:
            least, where = distance, k
        slack = min(outside, distance - least) if by_vertices else distance - least
    return least, where
