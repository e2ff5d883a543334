"""The cost of a chain of flybys as a function of its dates, summed over its burns.

The first leg is flown in N-body: what reaches the kernel is one such flight, the state in which it arrives
and how that state moves with the burn. The other legs are Lambert arcs between the targets.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.astronomy import DAY_S, GM_SUN_M3_S2
from landing_cli.flight.kepler import kepler_state
from landing_cli.kernel import part
from landing_cli.kernel_record import by_reference
from landing_cli.tour.ephemeris import EARTH_ROW, Ephemeris, body_positions
from landing_cli.tour.lambert import lambert_arcs
from landing_cli.tour.target_table import state_from_nodes

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LEG_COLUMNS = 9  # burn time, arrival time, burn (3), velocity on arrival (3), row of the Lambert arc

LEAST_LEG_S = 5.0 * DAY_S  # of a leg from its burn to its flyby
_NEWTON = 8
_BURN_SETTLED_M_S = 1e-5


@by_reference
class FirstLegs(NamedTuple):
    """First legs of c chains, flown in N-body, each with a flight of its own.

    ``start`` (c, 6): state just before the burn, m and m/s; ``burn_t_s`` (c,); ``burn_m_s`` (c, 3);
    ``arrival_t_s`` (c,) and ``state`` (c, 6): end of the flight; ``slope`` (c, 6, 3): how that state moves
    with the burn, s and 1.
    """

    start: FloatArray
    burn_t_s: FloatArray
    burn_m_s: FloatArray
    arrival_t_s: FloatArray
    state: FloatArray
    slope: FloatArray


@by_reference
class Bounds(NamedTuple):
    """What the dates keep to, each an array of one number.

    ``end_t_s``, ``turns_max`` (whole revolutions of a leg),
    ``wait_max_s`` (between a flyby and the next burn), ``earth_m`` (geocentric distance of a flyby).
    """

    end_t_s: FloatArray
    turns_max: IntArray
    wait_max_s: FloatArray
    earth_m: FloatArray


@by_reference
class Scratch(NamedTuple):
    """Room for the kernels: ``arcs`` (2 turns_max + 1, 6) and ``bodies`` (b + 1, 3)."""

    arcs: FloatArray
    bodies: FloatArray


@part
def first_leg(
    first: FirstLegs, j: int, t_s: float, x: float, y: float, z: float, change: FloatArray, leg: FloatArray
) -> bool:
    """Correct the burn of a first leg so that it meets a position.

    Parameters
    ----------
    first : FirstLegs
        Flights.
    j : int
        Which.
    t_s : float, s
        Arrival.
    x, y, z : float, m
        Position to be met.
    change : (3,) float, m/s
        Difference to the flight's burn; a guess on entry.
    leg : (LEG_COLUMNS,) float
        Receives the leg.

    Returns
    -------
    bool
        Whether it converged.
    """
    s0, slope = first.state[j], first.slope[j]
    dt = t_s - first.arrival_t_s[j]
    moved = np.empty((3, 3))
    s = np.empty(6)
    for _ in range(_NEWTON):
        for row in range(6):
            s[row] = (
                s0[row] + slope[row, 0] * change[0] + slope[row, 1] * change[1] + slope[row, 2] * change[2]
            )
        px, py, pz, vx, vy, vz = kepler_state(GM_SUN_M3_S2, s[0], s[1], s[2], s[3], s[4], s[5], dt)
        for axis in range(3):
            qx, qy, qz, _, _, _ = kepler_state(
                GM_SUN_M3_S2,
                s[0] + slope[0, axis],
                s[1] + slope[1, axis],
                s[2] + slope[2, axis],
                s[3] + slope[3, axis],
                s[4] + slope[4, axis],
                s[5] + slope[5, axis],
                dt,
            )
            moved[0, axis], moved[1, axis], moved[2, axis] = qx - px, qy - py, qz - pz
        a, b, c = moved[0, 0], moved[0, 1], moved[0, 2]
        d, e, f = moved[1, 0], moved[1, 1], moved[1, 2]
        g, h, i = moved[2, 0], moved[2, 1], moved[2, 2]
        p, q, r = e * i - f * h, f * g - d * i, d * h - e * g
        one = 1.0 / (a * p + b * q + c * r)
        rx, ry, rz = x - px, y - py, z - pz
        ux = (p * rx + (c * h - b * i) * ry + (b * f - c * e) * rz) * one
        uy = (q * rx + (a * i - c * g) * ry + (c * d - a * f) * rz) * one
        uz = (r * rx + (b * g - a * h) * ry + (a * e - b * d) * rz) * one
        change[0] += ux
        change[1] += uy
        change[2] += uz
        size = math.sqrt(ux * ux + uy * uy + uz * uz)
        if not size < 3000.0:
            return False
        if size < _BURN_SETTLED_M_S:
            leg[0], leg[1] = first.burn_t_s[j], t_s
            for axis in range(3):
                leg[2 + axis] = first.burn_m_s[j, axis] + change[axis]
            leg[5], leg[6], leg[7], leg[8] = vx, vy, vz, 0.0
            return True
    return False


@part
def later_leg(
    x0: float,
    y0: float,
    z0: float,
    vx0: float,
    vy0: float,
    vz0: float,
    flyby_t_s: float,
    wait_s: float,
    x: float,
    y: float,
    z: float,
    t_s: float,
    turns_max: int,
    arcs: FloatArray,
    leg: FloatArray,
) -> float:
    """Fly from one flyby to the next: coast, burn, and the Lambert arc that needs the least burn.

    Parameters
    ----------
    x0, y0, z0, vx0, vy0, vz0 : float, m and m/s
        State at the flyby.
    flyby_t_s, wait_s : float, s
        Its time, and the coast.
    x, y, z : float, m
        Position to be met.
    t_s : float, s
        Arrival.
    turns_max : int
        Whole revolutions.
    arcs : (2 turns_max + 1, 6) float
        Scratch.
    leg : (LEG_COLUMNS,) float
        Receives the leg.

    Returns
    -------
    float, m/s
        The burn; infinite where there is no arc.
    """
    if wait_s != 0.0:
        x0, y0, z0, vx0, vy0, vz0 = kepler_state(GM_SUN_M3_S2, x0, y0, z0, vx0, vy0, vz0, wait_s)
    burn_t_s = flyby_t_s + wait_s
    rows = lambert_arcs(GM_SUN_M3_S2, x0, y0, z0, x, y, z, t_s - burn_t_s, turns_max, arcs)
    best = np.inf
    for row in range(rows):
        ux, uy, uz = arcs[row, 0] - vx0, arcs[row, 1] - vy0, arcs[row, 2] - vz0
        size = math.sqrt(ux * ux + uy * uy + uz * uz)
        if size < best:
            best = size
            leg[0], leg[1] = burn_t_s, t_s
            leg[2], leg[3], leg[4] = ux, uy, uz
            leg[5], leg[6], leg[7] = arcs[row, 3], arcs[row, 4], arcs[row, 5]
            leg[8] = row
    return best


@part
def chain_cost(
    dates: FloatArray,
    length: int,
    targets: IntArray,
    first: FirstLegs,
    j: int,
    node_t_s: FloatArray,
    node_states: FloatArray,
    bounds: Bounds,
    ephemeris: Ephemeris,
    change: FloatArray,
    scratch: Scratch,
    legs: FloatArray,
) -> float:
    """Sum of the burns of a chain.

    Parameters
    ----------
    dates : (2 length - 1,) float, s
        Arrival of the first leg, then wait and arrival of each other one.
    length : int
        Flybys.
    targets : (length,) int
        Rows of the nodes.
    first : FirstLegs
        Flights of the first leg.
    j : int
        The chain's own.
    node_t_s, node_states : (k,) and (n, k, 6) float
        Motion of the targets.
    bounds : Bounds
        What the dates keep to.
    ephemeris : Ephemeris
        The Earth among others.
    change : (3,) float, m/s
        Guess for the first burn; replaced by the answer.
    scratch : Scratch
        Room to work in.
    legs : (length, LEG_COLUMNS) float
        Receives the legs.

    Returns
    -------
    float, m/s
        Infinite where the dates break a bound or a leg has no arc.
    """
    total, flyby_t_s = 0.0, first.burn_t_s[j]
    x = y = z = 0.0
    for k in range(length):
        wait, t = (0.0, dates[0]) if k == 0 else (dates[2 * k - 1], dates[2 * k])
        if not (
            0.0 <= wait <= bounds.wait_max_s[0] and flyby_t_s + wait + LEAST_LEG_S <= t <= bounds.end_t_s[0]
        ):
            return np.inf
        px, py, pz, _, _, _ = state_from_nodes(node_t_s, node_states[targets[k]], t)
        if k == 0:
            if not first_leg(first, j, t, px, py, pz, change, legs[0]):
                change[:] = 0.0
                return np.inf
            total = math.sqrt(legs[0, 2] ** 2 + legs[0, 3] ** 2 + legs[0, 4] ** 2)
        else:
            v = legs[k - 1]
            total += later_leg(
                x,
                y,
                z,
                v[5],
                v[6],
                v[7],
                flyby_t_s,
                wait,
                px,
                py,
                pz,
                t,
                bounds.turns_max[0],
                scratch.arcs,
                legs[k],
            )
        if bounds.earth_m[0] < np.inf:
            body_positions(ephemeris, t, 0.0, scratch.bodies)
            ex, ey, ez = (
                scratch.bodies[EARTH_ROW, 0],
                scratch.bodies[EARTH_ROW, 1],
                scratch.bodies[EARTH_ROW, 2],
            )
            if not (px - ex) ** 2 + (py - ey) ** 2 + (pz - ez) ** 2 <= bounds.earth_m[0] ** 2:
                return np.inf
        if not total < np.inf:
            return np.inf
        x, y, z, flyby_t_s = px, py, pz, t
    return total
