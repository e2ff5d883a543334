"""What a path has to keep off: terrain before the cone, the cone's wall and the ground inside it.

Samples are taken in buckets, and every bucket gives the rows of its worst sample: at a solution all samples
hold, at a fraction of the rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.distance_slope import distances_with_slopes, vertices_with_slopes
from landing_cli.plan.records import PlanCase

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PathRows:
    """Rows that are wanted nonnegative.

    Attributes
    ----------
    sample : (q,) int
        The sample that each row bounds.
    value : (q,) float, m
        Room left.
    slope : (q, 3) float
        By that sample's position.
    """

    sample: IntArray
    value: FloatArray
    slope: FloatArray


def path_rows(
    case: PlanCase,
    positions_m: FloatArray,
    entry: int,
    bucket: int,
    margin_m: float,
    *,
    cone: bool = True,
) -> PathRows:
    """Bound a sampled path.

    Parameters
    ----------
    case : PlanCase
        Clearance, cone and surface.
    positions_m : (n, 3) float, m, body frame
        The samples; the last one is the touchdown, which is not bound.
    entry : int
        First sample that has to lie in the cone. It keeps the clearance like those before it, so that nothing
        hides between two samples of which one keeps the one and the next the other.
    bucket : int
        Samples that share a row.
    margin_m : float, m
        Added to the clearance.
    cone : bool
        Whether the cone is asked here; not where the caller keeps it as a cone.

    Returns
    -------
    PathRows
        As many rows for any positions.
    """
    distance, slope = distances_with_slopes(case.surface, positions_m)
    last = len(positions_m) - 1
    before, after = slice(1, min(entry + 1, last)), slice(entry, last)
    clearance, direction = distance[before], slope[before]
    if case.clearance_metric == "vertices":
        clearance, direction = vertices_with_slopes(case.surface, positions_m[before])
    groups = [
        _worst(before.start, clearance - case.clearance_m - margin_m, direction, bucket),
        _worst(after.start, distance[after], slope[after], bucket),
    ]
    if cone:
        groups.append(_worst(after.start, *_cone_room(case, positions_m[after]), bucket))
    return PathRows(*(np.concatenate([group[k] for group in groups]) for k in range(3)))


def _cone_room(case: PlanCase, positions_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Room to the wall of the cone (Lyu 2026, eq 3, as a distance), and its slope."""
    offset, normal = positions_m - case.site.position_m, case.site.normal
    along = offset @ normal
    across = offset - along[:, None] * normal
    width = np.linalg.norm(across, axis=1)
    c, s = np.cos(case.cone_half_angle_rad), np.sin(case.cone_half_angle_rad)
    outward = across / np.maximum(width, 1e-9)[:, None]
    return s * along - c * width, s * normal - c * outward


def _worst(
    first: int, value: FloatArray, slope: FloatArray, bucket: int
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Worst sample of every bucket."""
    if not len(value):
        return np.zeros(0, dtype=np.int64), value, slope.reshape(0, 3)
    padded = np.append(value, np.full(-len(value) % bucket, np.inf)).reshape(-1, bucket)
    chosen = np.argmin(padded, axis=1) + bucket * np.arange(len(padded))
    return first + chosen, value[chosen], slope[chosen]
