"""Planes that a flight keeps to one side of: tangent planes of the ellipsoid, and walls off the terrain.

Each holds at one node of the descent, or at one point of the final arc, where it is linear in the arc's ends.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import part
from landing_cli.kernel_record import by_reference
from landing_cli.optimize.conic_records import Model
from landing_cli.reach.scaled_case import ScaledCase, ellipsoid_normal
from landing_cli.reach.shooting import Path, pull_back

Floats = NDArray[np.float64]


@by_reference
class Cuts(NamedTuple):
    """Planes: first tangent planes of the ellipsoid, n . r >= level, then walls, n . r >= offset."""

    node: NDArray[np.int64]  # (C,) of the descent; 0: a wall on the final arc
    normal: Floats  # (C, 3) solver axes
    fraction: Floats  # (C,) of the final arc's time-to-go
    offset: Floats  # (C,) of walls


def new_cuts(size: int) -> Cuts:
    """Room for ``size`` cuts."""
    return Cuts(np.zeros(size, dtype=np.int64), np.zeros((size, 3)), np.zeros(size), np.zeros(size))


@part
def arc_weights(sigma: float, final_time: float) -> tuple[float, float, float, float, float, float]:
    """Weights of (a_e, a_s) in a*, in r - r_c, and in v at time-to-go sigma T.

    Returns
    -------
    a_e, a_s, r_e, r_s, v_e, v_s : float
    """
    T, s2 = final_time, sigma * sigma
    return (
        1.0 - sigma,
        sigma,
        T * T * s2 * (0.5 - sigma / 6.0),
        T * T * s2 * sigma / 6.0,
        -T * (sigma - 0.5 * s2),
        -0.5 * T * s2,
    )


@part
def _refresh_on_arc(
    case: ScaledCase, target: Floats, model: Model, cuts: Cuts, c: int, r: int, y: Floats
) -> None:
    """Row r: wall c, at a point of the final arc."""
    n = cuts.normal[c]
    _, _, r_e, r_s, _, _ = arc_weights(cuts.fraction[c], case.final_time)
    value = -cuts.offset[c]
    for i in range(3):
        model.row_y[r, 1 + i], model.row_y[r, 4 + i] = r_e * n[i], r_s * n[i]
        value += n[i] * (target[i] + r_e * y[1 + i] + r_s * y[4 + i])
    model.row_value[r] = value


@part
def refresh_planes(
    case: ScaledCase,
    target: Floats,
    path: Path,
    model: Model,
    cuts: Cuts,
    first_row: int,
    counts: tuple[int, int],
    level: float,
    retake: bool,
    y: Floats,
) -> None:
    """Fill the rows of tangent planes and walls.

    Parameters
    ----------
    case : ScaledCase
        The case.
    target : (3,) float
        Touchdown point, scaled.
    path : Path
        The descent as it is flown now.
    model : Model
        Filled from ``first_row`` on.
    cuts : Cuts
        The planes.
    first_row : int
        Row of the first plane.
    counts : (int, int)
        Tangent planes, and walls.
    level : float
        |xi| that the tangent planes keep.
    retake : bool
        Move each tangent plane to the current position of its node.
    y : (7,) float
        Thrust level, acceleration at touchdown and at handover.
    """
    n_cuts, n_walls = counts
    for c in range(n_cuts + n_walls):
        k, n, r, least = cuts.node[c], cuts.normal[c], first_row + c, level
        model.row_y[r, :] = 0.0
        model.row_end[r] = k
        if k == 0:
            _refresh_on_arc(case, target, model, cuts, c, r, y)
            continue
        x = path.position[k]
        if c >= n_cuts:
            least = cuts.offset[c]
        elif retake:
            n[0], n[1], n[2] = ellipsoid_normal(case, case.node_cos[k], case.node_sin[k], x[0], x[1], x[2])
        model.row_value[r] = n[0] * x[0] + n[1] * x[1] + n[2] * x[2] - least
        pull_back(path, k, n[0], n[1], n[2], 0.0, 0.0, 0.0, model.row_thrust[r])
