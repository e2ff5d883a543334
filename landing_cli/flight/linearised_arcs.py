"""Flight near a known path, linearised: how every arc maps state and thrust to the next node.

Near the path r*(t) gravity is g(r*) + G(r*) (r - r*). With a thrust acceleration u that is linear between
nodes (first-order hold), every arc is then an affine map

    x_{i+1} = Phi_i x_i + Gamma0_i u_i + Gamma1_i u_{i+1} + d_i,      x = (r - origin, v).

On the path itself the map is exact; its error grows with the square of the distance from it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityField
from landing_cli.flight.field_along import field_along
from landing_cli.flight.linear_arcs import frame_slopes

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LinearisedArcs:
    """The affine maps of all arcs.

    Attributes
    ----------
    by_state : (n, 6, 6) float
        Phi, SI.
    by_thrust_start, by_thrust_end : (n, 6, 3) float
        Gamma0 and Gamma1, SI: by the thrust acceleration at the arc's two nodes.
    drift : (n, 6) float, m, m/s
        d.
    """

    by_state: FloatArray
    by_thrust_start: FloatArray
    by_thrust_end: FloatArray
    drift: FloatArray


def linearised_arcs(
    field: GravityField,
    rotation_rate_rad_s: float,
    times_s: FloatArray,
    positions: Callable[[FloatArray], FloatArray],
    edges_s: FloatArray,
    origin_m: FloatArray,
) -> LinearisedArcs:
    """Linearise the flight about a path, in the rotating body frame.

    Parameters
    ----------
    field : GravityField
        The field to fly in.
    rotation_rate_rad_s : float, rad/s
        Spin rate about +z.
    times_s : (n + 1,) float, s
        Nodes of the thrust, increasing.
    positions : callable
        ``positions(t)`` gives the path at times (k,) as (k, 3), m, body frame.
    edges_s : (p + 1,) float, s
        Times between which the path is smooth, from the first node to the last.
    origin_m : (3,) float, m, body frame
        What the states' positions are counted from; close to the path it saves digits.

    Returns
    -------
    LinearisedArcs
    """
    n, h = len(times_s) - 1, np.diff(times_s)
    stages = np.concatenate([times_s[:-1], times_s[:-1] + 0.5 * h, times_s[-1:]])
    path = positions(stages)
    g, G = field_along(field, positions, edges_s, stages)
    by_v, by_r = frame_slopes(rotation_rate_rad_s)
    rates, pulls = np.zeros((len(stages), 6, 6)), np.zeros((len(stages), 6))
    rates[:, :3, 3:], rates[:, 3:, :3], rates[:, 3:, 3:] = np.eye(3), G + by_r, by_v
    pulls[:, 3:] = g - np.einsum("tij,tj->ti", G, path - origin_m) + by_r @ origin_m
    start, middle = np.arange(n), np.arange(n, 2 * n)
    end = np.append(np.arange(1, n), 2 * n)
    maps = _rk4(h[:, None, None], rates, pulls, (start, middle, end))
    return LinearisedArcs(maps[:, :, :6], maps[:, :, 6:9], maps[:, :, 9:12], maps[:, :, 12])


def _rk4(
    h: FloatArray, rates: FloatArray, pulls: FloatArray, stage: tuple[NDArray[np.int64], ...]
) -> FloatArray:
    """Integrate M' = A M + (0 | (1-s) B | s B | c) over every arc from (I | 0 | 0 | 0), (n, 6, 13)."""
    n = len(h)

    def slope(k: int, share: float, M: FloatArray) -> FloatArray:
        out = rates[stage[k]] @ M
        out[:, 3:, 6:9] += (1.0 - share) * np.eye(3)
        out[:, 3:, 9:12] += share * np.eye(3)
        out[:, :, 12] += pulls[stage[k]]
        return out

    M = np.zeros((n, 6, 13))
    M[:, :, :6] = np.eye(6)
    k1 = slope(0, 0.0, M)
    k2 = slope(1, 0.5, M + 0.5 * h * k1)
    k3 = slope(1, 0.5, M + 0.5 * h * k2)
    k4 = slope(2, 1.0, M + h * k3)
    return np.asarray(M + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))
