"""The first leg, honest about the Earth: it pulls the spacecraft for months, 15 m/s a day at the start.

A fan of burns is flown in N-body, each flight with its sensitivity to the burn; what passes a target by the
linear estimate is then shot at in N-body until it meets it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.astronomy import DAY_S
from landing_cli.kernel import kernel
from landing_cli.tour.chain_kernel import FirstLegs
from landing_cli.tour.coast_scan import PROBE_M_S, Coasts, record_coast, rows_of
from landing_cli.tour.records import Departure
from landing_cli.tour.target_table import state_from_nodes

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Fly = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""States (n, 6) from times (n,) to times (n,), in N-body; NaN where the flight ends in a body."""

EARTH_PULLS_S = 160.0 * DAY_S
"""So long the fan's flights are N-body; then they are far enough for a screening along conics."""
NODES = 12
LEAST_FIRST_LEG_S = 10.0 * DAY_S
_STEPS = (0.0, 0.18, 0.46, 0.8)  # along each axis, of the largest burn
_SPREAD = 0.6  # of the diagonal between neighbours: their regions overlap
_SHOTS = 9
_MISS_M = 1e4
_LONGEST_STEP_M_S = 150.0
_AXES = np.eye(3)


@dataclass(frozen=True, eq=False)
class Fan:
    """Flights after a first burn.

    Attributes
    ----------
    flights : FirstLegs
        To where the Earth no longer pulls much.
    coasts : Coasts
        The same on the targets' grid.
    """

    flights: FirstLegs
    coasts: Coasts


def fan_burns(largest_m_s: float) -> tuple[FloatArray, FloatArray]:
    """Burns on a grid that grows coarser outwards, and how far each stands in for others.

    Parameters
    ----------
    largest_m_s : float, m/s
        Largest burn of interest.

    Returns
    -------
    (c, 3) float, m/s
        Burns, none among them.
    (c,) float, m/s
        Distance beyond which a neighbour is nearer.
    """
    axis = np.array([*(-step for step in _STEPS[:0:-1]), *_STEPS])
    gaps = np.gradient(axis)
    burns = np.array([[x, y, z] for x in axis for y in axis for z in axis])
    spread = _SPREAD * np.linalg.norm([[x, y, z] for x in gaps for y in gaps for z in gaps], axis=1)
    inside = np.linalg.norm(burns, axis=1) <= 1.0
    return largest_m_s * burns[inside], largest_m_s * spread[inside]


def fly_fan(
    departure: Departure, waits_s: FloatArray, limit_m_s: float, grid_t_s: FloatArray, fly: Fly
) -> Fan:
    """Fly a fan of first burns.

    Parameters
    ----------
    departure : Departure
        Where the spacecraft sets out.
    waits_s : (w,) float, s
        Times of the burn after the departure.
    limit_m_s : float, m/s
        Largest burn.
    grid_t_s : (m,) float, s
        Grid of the targets.
    fly : callable
        N-body flight.

    Returns
    -------
    Fan
        A flight that ends in a body is left out.
    """
    burns, spread_m_s = fan_burns(limit_m_s)
    count = len(waits_s) * len(burns)
    start_t_s = np.full(len(waits_s), departure.t_s)
    start = np.concatenate([departure.position_m, departure.velocity_m_s])
    coasted = fly(np.tile(start, (len(waits_s), 1)), start_t_s, departure.t_s + waits_s)
    before = np.repeat(coasted, len(burns), axis=0)
    burn_m_s = np.tile(burns, (len(waits_s), 1))
    burn_t_s = np.repeat(departure.t_s + waits_s, len(burns))
    node_t_s, nodes = _fly_nodes(_probes(before, burn_m_s), burn_t_s, grid_t_s[-1], fly)
    ends = nodes[:, :, -1]
    slope = np.swapaxes(ends[:, 1:] - ends[:, :1], 1, 2) / PROBE_M_S
    flights = FirstLegs(before, burn_t_s, burn_m_s, node_t_s[:, -1].copy(), ends[:, 0].copy(), slope)
    coasts = Coasts(
        first=np.full(count, len(grid_t_s), dtype=np.int64),
        position_m=np.zeros((count, 3, len(grid_t_s))),
        inverse=np.zeros((count, 9, len(grid_t_s))),
        reach_s=np.zeros((count, len(grid_t_s))),
        base_m_s=burn_m_s,
        limit_m_s=np.full(count, limit_m_s),
        spread_m_s=np.tile(spread_m_s, len(waits_s)),
        taken=np.full((count, 1), -1, dtype=np.int64),
    )
    lay_fan(burn_t_s + LEAST_FIRST_LEG_S, node_t_s, nodes, grid_t_s, coasts)
    whole = np.flatnonzero(np.isfinite(nodes).all(axis=(1, 2, 3)))
    return Fan(rows_of(flights, whole), rows_of(coasts, whole))


def _probes(before: FloatArray, burn_m_s: FloatArray) -> FloatArray:
    """States after a burn, and after it with a little more along each axis, (c, 4, 6)."""
    states = np.repeat(before[:, None, :], 4, axis=1)
    states[:, :, 3:] += burn_m_s[:, None, :]
    states[:, 1:, 3:] += PROBE_M_S * _AXES
    return states


def _fly_nodes(
    states: FloatArray, start_t_s: FloatArray, end_t_s: float, fly: Fly
) -> tuple[FloatArray, FloatArray]:
    """Fly c times four spacecraft while the Earth pulls: times (c, k), states (c, 4, k, 6)."""
    span = np.minimum(EARTH_PULLS_S, end_t_s - start_t_s)
    times = start_t_s[:, None] + span[:, None] * np.linspace(0.0, 1.0, NODES + 1)
    nodes = np.empty((len(states), 4, NODES + 1, 6))
    nodes[:, :, 0] = states
    for k in range(NODES):
        start, end = np.repeat(times[:, k], 4), np.repeat(times[:, k + 1], 4)
        nodes[:, :, k + 1] = fly(nodes[:, :, k].reshape(-1, 6), start, end).reshape(-1, 4, 6)
    return times, nodes


@kernel
def lay_fan(
    first_t_s: FloatArray, node_t_s: FloatArray, nodes: FloatArray, grid_t_s: FloatArray, coasts: Coasts
) -> None:
    """Lay flights on the grid: along the conic of the nearest node, and of the last one ever after.

    Parameters
    ----------
    first_t_s : (c,) float, s
        Earliest arrival of each.
    node_t_s, nodes : (c, k) and (c, 4, k, 6) float
        Flights, each with three neighbours.
    grid_t_s : (m,) float, s
        Grid.
    coasts : Coasts
        c coasts to be filled.
    """
    probes = np.empty((4, 3))
    for j in range(len(first_t_s)):
        for k in range(len(grid_t_s)):
            if grid_t_s[k] < first_t_s[j]:
                continue
            for probe in range(4):
                x, y, z, _, _, _ = state_from_nodes(node_t_s[j], nodes[j, probe], grid_t_s[k])
                probes[probe, 0], probes[probe, 1], probes[probe, 2] = x, y, z
            record_coast(probes, coasts, j, k)


def shoot(
    before: FloatArray,
    burn_t_s: FloatArray,
    guess_m_s: FloatArray,
    meet_m: FloatArray,
    meet_t_s: FloatArray,
    fly: Fly,
) -> tuple[FirstLegs, NDArray[np.bool_]]:
    """Find the burns whose N-body flights meet positions, by Newton's method.

    Parameters
    ----------
    before : (c, 6) float, m and m/s
        State before the burn.
    burn_t_s : (c,) float, s
        Times of the burns.
    guess_m_s : (c, 3) float, m/s
        Burns to begin with.
    meet_m : (c, 3) float, m
        Positions to be met.
    meet_t_s : (c,) float, s
        When.
    fly : callable
        N-body flight.

    Returns
    -------
    FirstLegs
        c flights; of use where they converged.
    (c,) bool
        Where they did.
    """
    burn = guess_m_s.copy()
    arrived = np.full((len(before), 6), np.nan)
    slope = np.full((len(before), 6, 3), np.nan)
    met = np.zeros(len(before), dtype=np.bool_)
    live = np.arange(len(before))
    for _ in range(_SHOTS):
        if not len(live):
            break
        times = np.repeat(burn_t_s[live], 4), np.repeat(meet_t_s[live], 4)
        ends = fly(_probes(before[live], burn[live]).reshape(-1, 6), *times).reshape(-1, 4, 6)
        slopes = np.swapaxes(ends[:, 1:] - ends[:, :1], 1, 2) / PROBE_M_S
        miss = meet_m[live] - ends[:, 0, :3]
        whole = np.isfinite(ends).all(axis=(1, 2))
        arrived[live], slope[live] = ends[:, 0], slopes
        met[live] = whole & (np.linalg.norm(miss, axis=1) < _MISS_M)
        going = whole & ~met[live] & (np.linalg.det(np.where(np.isfinite(slopes), slopes, 0.0)[:, :3]) != 0.0)
        live, slopes, miss = live[going], slopes[going], miss[going]
        step = np.linalg.solve(slopes[:, :3], miss[:, :, None])[:, :, 0]
        size = np.linalg.norm(step, axis=1, keepdims=True)
        burn[live] += step * np.minimum(1.0, _LONGEST_STEP_M_S / np.maximum(size, 1e-9))
    return FirstLegs(before.copy(), burn_t_s.copy(), burn, meet_t_s.copy(), arrived, slope), met
