"""Which targets a coasting spacecraft could reach with a small burn: the screening of the whole catalogue.

A burn du at time t_b moves the coasting spacecraft at time t by Phi(t, t_b) du to first order. So the burn
that meets a target at t is about Phi^-1 (target - coast): nine multiplications for each target and time,
where an exact transfer is a Lambert problem. Between two times of the grid that burn moves along a straight
line nearly, and the point of the line next to the origin is the estimate: flybys are fast, and the right
arrival is a matter of hours.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.astronomy import GM_SUN_M3_S2
from landing_cli.flight.kepler import kepler_state
from landing_cli.kernel import kernel, part
from landing_cli.kernel_record import by_reference

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

PROBE_M_S = 5.0
"""Burn by which Phi is measured: rounding and curvature both cost less than 1e-3 of it."""
FASTEST_M_S = 90_000.0
"""No target and spacecraft pass faster: two bodies on opposite parabolas at 0.9 au."""


@by_reference
class Coasts(NamedTuple):
    """Flights of c spacecraft that do not burn, on the m times of the targets' grid.

    ``first`` (c,): index of the earliest arrival; ``position_m`` (c, 3, m); ``inverse`` (c, 9, m): Phi^-1 in
    1/s, row by row; ``reach_s`` (c, m): norm of Phi, metres moved for each m/s; ``base_m_s`` (c, 3): the burn
    that the flight already has in it; ``limit_m_s`` (c,): largest burn of interest; ``spread_m_s`` (c,): how
    far from the base a burn may be; ``taken`` (c, k): targets left out.
    """

    first: IntArray
    position_m: FloatArray
    inverse: FloatArray
    reach_s: FloatArray
    base_m_s: FloatArray
    limit_m_s: FloatArray
    spread_m_s: FloatArray
    taken: IntArray


Record = TypeVar("Record", bound=tuple[Any, ...])


def rows_of(record: Record, rows: IntArray) -> Record:
    """Choose rows of every array of a record.

    Parameters
    ----------
    record : NamedTuple of arrays
        Whose first axes run over the same things.
    rows : (k,) int
        Which, in the order wanted.

    Returns
    -------
    NamedTuple
        Of the same kind.
    """
    return type(record)(*(np.ascontiguousarray(field[rows]) for field in record))


@part
def coast_from(
    state: FloatArray, burn_t_s: float, first_t_s: float, grid_t_s: FloatArray, coasts: Coasts, j: int
) -> None:
    """Lay one coast and its sensitivity to a burn on the grid.

    Parameters
    ----------
    state : (6,) float, m and m/s
        At the burn.
    burn_t_s, first_t_s : float, s
        Time of the burn, and of the earliest arrival.
    grid_t_s : (m,) float, s
        Grid.
    coasts : Coasts
        Receives the flight.
    j : int
        Which of them it is.
    """
    probes = np.empty((4, 3))
    coasts.first[j] = grid_t_s.shape[0]
    for k in range(grid_t_s.shape[0]):
        if grid_t_s[k] < first_t_s:
            continue
        for probe in range(4):
            vx = state[3] + (PROBE_M_S if probe == 1 else 0.0)
            vy = state[4] + (PROBE_M_S if probe == 2 else 0.0)
            vz = state[5] + (PROBE_M_S if probe == 3 else 0.0)
            x, y, z, _, _, _ = kepler_state(
                GM_SUN_M3_S2, state[0], state[1], state[2], vx, vy, vz, grid_t_s[k] - burn_t_s
            )
            probes[probe, 0], probes[probe, 1], probes[probe, 2] = x, y, z
        record_coast(probes, coasts, j, k)


@part
def record_coast(probes: FloatArray, coasts: Coasts, j: int, k: int) -> None:
    """Enter a coast's position and its sensitivity at one time.

    Parameters
    ----------
    probes : (4, 3) float, m
        Its position, and those with `PROBE_M_S` more along each axis at the burn.
    coasts : Coasts
        Receives them.
    j, k : int
        Which coast and which time.
    """
    x, y, z = probes[0, 0], probes[0, 1], probes[0, 2]
    a, d, g = (probes[1, 0] - x) / PROBE_M_S, (probes[1, 1] - y) / PROBE_M_S, (probes[1, 2] - z) / PROBE_M_S
    b, e, h = (probes[2, 0] - x) / PROBE_M_S, (probes[2, 1] - y) / PROBE_M_S, (probes[2, 2] - z) / PROBE_M_S
    c, f, i = (probes[3, 0] - x) / PROBE_M_S, (probes[3, 1] - y) / PROBE_M_S, (probes[3, 2] - z) / PROBE_M_S
    p, q, r = e * i - f * h, f * g - d * i, d * h - e * g
    one = 1.0 / (a * p + b * q + c * r)
    inverse = coasts.inverse[j]
    inverse[0, k], inverse[1, k], inverse[2, k] = p * one, (c * h - b * i) * one, (b * f - c * e) * one
    inverse[3, k], inverse[4, k], inverse[5, k] = q * one, (a * i - c * g) * one, (c * d - a * f) * one
    inverse[6, k], inverse[7, k], inverse[8, k] = r * one, (b * g - a * h) * one, (a * e - b * d) * one
    coasts.reach_s[j, k] = math.sqrt(a * a + b * b + c * c + d * d + e * e + f * f + g * g + h * h + i * i)
    coasts.first[j] = min(coasts.first[j], k)
    coasts.position_m[j, 0, k], coasts.position_m[j, 1, k], coasts.position_m[j, 2, k] = x, y, z


@kernel
def scan_targets(
    grid_t_s: FloatArray,
    grid_m: NDArray[np.float32],
    coasts: Coasts,
    target: IntArray,
    arrival_t_s: FloatArray,
    estimate_m_s: FloatArray,
    burn_m_s: FloatArray,
) -> None:
    """Find the targets that cost least by the linear estimate, for each coast.

    Parameters
    ----------
    grid_t_s : (m,) float, s
        Grid, evenly spaced.
    grid_m : (n, 3, m) float32, m
        Positions of the targets.
    coasts : Coasts
        c flights.
    target : (c, b) int
        Receives the targets, cheapest first; -1 where there are fewer. A target may come once for each of its
        approaches.
    arrival_t_s : (c, b) float, s
        Receives the times.
    estimate_m_s : (c, b) float, m/s
        Receives the sizes of the burns.
    burn_m_s : (c, b, 3) float, m/s
        Receives the burns, the base included.
    """
    n, m = grid_m.shape[0], grid_t_s.shape[0]
    count = target.shape[0]
    step = grid_t_s[1] - grid_t_s[0]
    slack = 0.5 * FASTEST_M_S * step
    target[:] = -1
    estimate_m_s[:] = np.inf
    # the loop over targets is outside, so that a target's positions stay at hand for all coasts
    for i in range(n):
        for j in range(count):
            skip = False
            for taken in coasts.taken[j]:
                skip = skip or taken == i
            if skip:
                continue
            base = coasts.base_m_s[j]
            limit, spread = coasts.limit_m_s[j], coasts.spread_m_s[j]
            spare = limit + math.sqrt(base[0] * base[0] + base[1] * base[1] + base[2] * base[2])
            spare = min(spare, spread)
            old = False
            a0 = a1 = a2 = 0.0
            falling, low, low_t, l0, l1, l2 = False, np.inf, 0.0, 0.0, 0.0, 0.0
            for k in range(coasts.first[j], m):
                x = grid_m[i, 0, k] - coasts.position_m[j, 0, k]
                y = grid_m[i, 1, k] - coasts.position_m[j, 1, k]
                z = grid_m[i, 2, k] - coasts.position_m[j, 2, k]
                near = coasts.reach_s[j, k] * spare + slack
                if not x * x + y * y + z * z < near * near:
                    if falling:
                        keep_best(
                            target[j], arrival_t_s[j], estimate_m_s[j], burn_m_s[j], i, low_t, low, l0, l1, l2
                        )
                    old, falling, low = False, False, np.inf
                    continue
                inv = coasts.inverse[j]
                b0 = base[0] + inv[0, k] * x + inv[1, k] * y + inv[2, k] * z
                b1 = base[1] + inv[3, k] * x + inv[4, k] * y + inv[5, k] * z
                b2 = base[2] + inv[6, k] * x + inv[7, k] * y + inv[8, k] * z
                if old:
                    d0, d1, d2 = b0 - a0, b1 - a1, b2 - a2
                    square = d0 * d0 + d1 * d1 + d2 * d2
                    share = 0.0
                    if square > 0.0:
                        share = max(0.0, min(1.0, -(a0 * d0 + a1 * d1 + a2 * d2) / square))
                    c0, c1, c2 = a0 + share * d0, a1 + share * d1, a2 + share * d2
                    size = math.sqrt(c0 * c0 + c1 * c1 + c2 * c2)
                    if size < low:
                        falling, low, low_t = size < limit, size, grid_t_s[k - 1] + share * step
                        away = (c0 - base[0]) ** 2 + (c1 - base[1]) ** 2 + (c2 - base[2]) ** 2
                        falling = falling and away < spread * spread
                        l0, l1, l2 = c0, c1, c2
                    else:
                        if falling:
                            keep_best(
                                target[j],
                                arrival_t_s[j],
                                estimate_m_s[j],
                                burn_m_s[j],
                                i,
                                low_t,
                                low,
                                l0,
                                l1,
                                l2,
                            )
                        falling, low = False, size
                a0, a1, a2, old = b0, b1, b2, True
            if falling:
                keep_best(target[j], arrival_t_s[j], estimate_m_s[j], burn_m_s[j], i, low_t, low, l0, l1, l2)


@part
def keep_best(
    target: IntArray,
    arrival_t_s: FloatArray,
    estimate_m_s: FloatArray,
    burn_m_s: FloatArray,
    i: int,
    t_s: float,
    size: float,
    ux: float,
    uy: float,
    uz: float,
) -> None:
    """Insert a candidate into a list that is sorted by its estimate.

    Parameters
    ----------
    target, arrival_t_s, estimate_m_s, burn_m_s : (b,), (b,), (b,) and (b, 3)
        The list.
    i : int
        Target.
    t_s : float, s
        Arrival.
    size : float, m/s
        Of the burn.
    ux, uy, uz : float, m/s
        The burn.
    """
    place = target.shape[0] - 1
    if not size < estimate_m_s[place]:
        return
    while place > 0 and estimate_m_s[place - 1] > size:
        target[place], arrival_t_s[place] = target[place - 1], arrival_t_s[place - 1]
        estimate_m_s[place] = estimate_m_s[place - 1]
        burn_m_s[place] = burn_m_s[place - 1]
        place -= 1
    target[place], arrival_t_s[place], estimate_m_s[place] = i, t_s, size
    burn_m_s[place, 0], burn_m_s[place, 1], burn_m_s[place, 2] = ux, uy, uz
