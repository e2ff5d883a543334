"""A given path flown with a thrust acceleration that is linear between nodes, ending exactly where it should.

The thrust that the path wants at the nodes, held linear between them, misses its end by little; the least
change of the thrust (in the integral of its square) that closes the flight and its end is found by Newton's
method on multiple shooting.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.flight.linear_arcs import Arcs, fly_linear_arcs

FloatArray = NDArray[np.float64]

_ROUNDS = 6
_CLOSED = 1e-12  # of the path's length: gaps between arcs at the end


def first_order_hold(
    asteroid: Asteroid, t_s: FloatArray, states: FloatArray, acceleration_m_s2: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Close a path that is nearly flown by a thrust linear between nodes.

    Parameters
    ----------
    asteroid : Asteroid
        Its field and spin.
    t_s : (n + 1,) float, s
        Nodes.
    states : (n + 1, 6) float, m, m/s, rotating body frame
        The path at the nodes; the first and the last row are kept.
    acceleration_m_s2 : (n + 1, 3) float, m/s2, rotating body frame
        The thrust over mass that the path wants at the nodes.

    Returns
    -------
    states : (n + 1, 6) float, m, m/s
        Of the flight.
    acceleration : (n + 1, 3) float, m/s2
        Its thrust over mass at the nodes.
    gap_m : float, m
        Largest gap between the end of an arc and the next node.
    """
    states, u = states.copy(), acceleration_m_s2.copy()
    length = float(np.linalg.norm(np.diff(states[:, :3], axis=0), axis=1).sum())
    for _ in range(_ROUNDS):
        arcs = fly_linear_arcs(asteroid.gravity, asteroid.rotation_rate_rad_s, t_s, states[:-1], u)
        gap = float(np.abs(arcs.end - states[1:])[:, :3].max())
        if gap <= _CLOSED * length:
            break
        change, du = _least_change(arcs, arcs.end - states[1:])
        states[1:-1] += change
        u += du
    return states, u, gap


def _least_change(arcs: Arcs, gaps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Change of the inner states and of the thrust that closes the linearised arcs, the ends held."""
    n = len(gaps)
    h = np.diff(arcs.times_s)
    A, B0, B1 = arcs.end_slope[:, :, :6], arcs.end_slope[:, :, 6:9], arcs.end_slope[:, :, 9:]
    to_end = np.zeros((n + 1, 6, 6))  # from each node to the end
    to_end[n] = np.eye(6)
    for k in range(n - 1, -1, -1):
        to_end[k] = to_end[k + 1] @ A[k]
    by_thrust = np.zeros((n + 1, 6, 3))
    by_thrust[:-1] += to_end[1:] @ B0
    by_thrust[1:] += to_end[1:] @ B1
    share = np.zeros(n + 1)  # of each node in the integral of the square
    share[:-1] += 0.5 * h
    share[1:] += 0.5 * h
    miss = np.einsum("kab,kb->a", to_end[1:], gaps)
    weighed = by_thrust / share[:, None, None]
    # positions and velocities differ by orders: solve in units of the motion over the whole flight
    unit = np.repeat([arcs.times_s[-1] - arcs.times_s[0], 1.0], 3)
    matrix = np.einsum("kab,kcb->ac", weighed, by_thrust) / np.outer(unit, unit)
    du = np.einsum("kab,a->kb", weighed, -np.linalg.solve(matrix, miss / unit) / unit)
    states = np.zeros((n, 6))
    for k in range(n - 1):
        states[k + 1] = A[k] @ states[k] + B0[k] @ du[k] + B1[k] @ du[k + 1] + gaps[k]
    return states[1:], du
