"""Planes that a flight keeps to one side of: tangent planes of the ellipsoid, and walls off the terrain.

Each holds at one node of the descent, or at one point of the final arc, where it is linear in the arc's ends.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import kernel, part
from landing_cli.kernel_lanes import any_lane, at_rows, choose
from landing_cli.kernel_record import by_reference
from landing_cli.optimize.conic_records import Model, New
from landing_cli.reach.scaled_case import ScaledCase, ellipsoid_normal
from landing_cli.reach.shooting import Path

Floats = NDArray[np.float64]


@by_reference
class Cuts(NamedTuple):
    """Planes n . r >= offset."""

    node: Floats  # (C,) whole numbers, of the descent; 0: a wall on the final arc
    normal: Floats  # (C, 3) solver axes
    fraction: Floats  # (C,) of the final arc's time-to-go
    offset: Floats  # (C,) of a tangent plane: |xi| that it keeps
    tangent: Floats  # (C,) 1: it touches the ellipsoid, or a multiple of it; 0: a wall


def new_cuts(size: int, new: New = np.zeros) -> Cuts:
    """Room for ``size`` cuts, in arrays that ``new`` makes."""
    return Cuts(new(size), new((size, 3)), new(size), new(size), new(size))


@kernel
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
def _retake(case: ScaledCase, path: Path, cuts: Cuts, c: int, which: bool) -> None:
    """Move a tangent plane to the current position of its node."""
    if not any_lane(which):
        return
    k, n = cuts.node[c], cuts.normal[c]
    turn = at_rows(case.node_cos, k, 0), at_rows(case.node_sin, k, 0)
    x, y, z = at_rows(path.position, k, 0), at_rows(path.position, k, 1), at_rows(path.position, k, 2)
    a, b, d = ellipsoid_normal(case, turn[0], turn[1], x, y, z)
    n[0], n[1], n[2] = choose(which, a, n[0]), choose(which, b, n[1]), choose(which, d, n[2])


@part
def refresh_planes(
    case: ScaledCase,
    target: Floats,
    path: Path,
    model: Model,
    cuts: Cuts,
    first_row: int,
    count: int,
    retake: bool,
    y: Floats,
) -> None:
    """Fill the rows of tangent planes and walls.

    To tell of a position at a node by the state at the end undoes `shooting.pull_back` between them, whose
    map is symplectic: its inverse is made of its own levers. On the final arc, which is flown without thrust
    nodes, a plane has a row in y instead.

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
    count : int
        How many planes.
    retake : bool
        Move each tangent plane to the current position of its node.
    y : (7,) float
        Thrust level, acceleration at touchdown and at handover.
    """
    for c in range(count):
        r, k, n, row_y = first_row + c, cuts.node[c], cuts.normal[c], model.row_y[first_row + c]
        _retake(case, path, cuts, c, retake & (cuts.tangent[c] > 0.0))
        model.row_end[r] = k
        flown, mix, x0 = k > 0.0, model.row_mix[r], at_rows(path.position, k, 0)
        x1, x2 = at_rows(path.position, k, 1), at_rows(path.position, k, 2)
        _, _, r_e, r_s, _, _ = arc_weights(cuts.fraction[c], case.final_time)
        x0 = choose(flown, x0, target[0] + r_e * y[1] + r_s * y[4])
        x1 = choose(flown, x1, target[1] + r_e * y[2] + r_s * y[5])
        x2 = choose(flown, x2, target[2] + r_e * y[3] + r_s * y[6])
        model.row_value[r] = n[0] * x0 + n[1] * x1 + n[2] * x2 - cuts.offset[c]
        on_arc, row_y[0] = choose(flown, 0.0, 1.0), 0.0
        for i in range(3):
            row_y[1 + i], row_y[4 + i] = on_arc * r_e * n[i], on_arc * r_s * n[i]
        for i in range(6):
            by_end = 0.0
            for j in range(3):
                by_end += n[j] * at_rows(path.lever, k, 3 * i + j)
            other = (i + 3) % 6
            mix[other] = choose(flown, by_end if i >= 3 else -by_end, 0.0)
        for b in range(6, mix.shape[0]):
            mix[b] = 0.0
