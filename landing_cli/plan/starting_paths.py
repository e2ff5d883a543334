"""Paths from which the successive convexification begins: out of the body, on several sides of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.clearance import signed_distances
from landing_cli.plan.cone_entry import first_time_to_go
from landing_cli.plan.records import PlanCase

FloatArray = NDArray[np.float64]

_ROOM = 1.5  # starting paths keep this many clearances
_GROWTH = 1.02
_STEPS = 40  # of the largest radius, in which the other side is looked for
_SIZES = 3


def boundary_cubic(case: PlanCase, times_s: FloatArray) -> FloatArray:
    """States on the cubic between the boundary states: (n, 6) float, m, m/s, at times (n,) in s."""
    s, tof = (times_s / case.tof_s)[:, None], case.tof_s
    r0, r1 = case.position_m, case.site.position_m
    d0, d1 = tof * case.velocity_m_s, tof * case.landing_velocity_m_s
    square, cubic = 3.0 * (r1 - r0) - 2.0 * d0 - d1, d0 + d1 - 2.0 * (r1 - r0)
    r = r0 + s * (d0 + s * (square + s * cubic))
    return np.concatenate([r, (d0 + s * (2.0 * square + 3.0 * s * cubic)) / tof], axis=1)


def starting_paths(case: PlanCase, times_s: FloatArray, path_m: FloatArray) -> list[FloatArray]:
    """Move a path out of the body, and find others that go round it by other ways.

    Parameters
    ----------
    case : PlanCase
        Surface and clearance.
    times_s : (n,) float, s
        Times of the path's points.
    path_m : (n, 3) float, m, body frame
        From the start to the site; may cross the body.

    Returns
    -------
    list of (n, 3) float, m
        One path where the given one is clear already; else the given path pushed out along the radius and
        those of the paths bent to the other three sides that come clear. All begin and end as the given one.
    """
    early = times_s < case.tof_s - first_time_to_go(case)
    early[0] = False
    if _clear(case, path_m[early]).all():
        return [path_m]
    out = path_m.copy()
    for _ in range(300):
        low = early.copy()
        low[early] = ~_clear(case, out[early])
        if not low.any():
            break
        out[low] *= _GROWTH
    return [out, *_other_sides(case, path_m, out, early)]


def _clear(case: PlanCase, points: FloatArray) -> NDArray[np.bool_]:
    return np.asarray(signed_distances(case.surface, points) >= _ROOM * case.clearance_m)


def _other_sides(
    case: PlanCase, path: FloatArray, out: FloatArray, early: NDArray[np.bool_]
) -> list[FloatArray]:
    """Bend a path to the three sides other than that to which it was pushed, until it is clear."""
    chord = (path[-1] - path[0]) / np.linalg.norm(path[-1] - path[0])
    pushed = (out - path).mean(axis=0)
    aside = pushed - chord * (chord @ pushed)
    if np.linalg.norm(aside) < 1e-6:
        return []
    aside /= np.linalg.norm(aside)
    share = np.linspace(0.0, 1.0, len(path))
    size = float(np.linalg.norm(case.asteroid.mesh.vertices, axis=1).max())
    paths = []
    for side in (-aside, np.cross(chord, aside), np.cross(aside, chord)):
        bend = (4.0 * share * (1.0 - share))[:, None] ** 2 * side
        for amount in np.linspace(0.0, _SIZES * size, _SIZES * _STEPS + 1)[1:]:
            bent = path + amount * bend
            if _clear(case, bent[early]).all():
                paths.append(bent)
                break
    return paths


def refined_times(times_s: FloatArray, values: FloatArray, count: int) -> FloatArray:
    """Place nodes where a control changes: half of them by the change, half evenly.

    Parameters
    ----------
    times_s : (n,) float, s
        Nodes of a solution.
    values : (n, 3) float
        Its control.
    count : int
        How many nodes to place.

    Returns
    -------
    (count,) float, s
        From the first to the last of the given times.
    """
    length = np.diff(times_s)
    change = np.linalg.norm(np.diff(values, axis=0), axis=1)
    density = length / length.sum() + change / max(float(change.sum()), 1e-300)
    reached = np.concatenate([[0.0], np.cumsum(density)])
    return np.interp(np.linspace(0.0, reached[-1], count), reached, times_s)
