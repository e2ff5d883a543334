"""The paper's multi-layer preferential selection (Liu et al. 2023, section 2.3).

From each partial chain three selections choose the next target: by how the coast passes the targets (nearest
distance, its date, magnitude), then by the transfers to those (burn, date, magnitude), then among all chains
(sum of burns, date). The paper's third selection also counts targets; here all chains of one round have as
many, and chains of every length are kept. Its transfers are two-body from 1.5 million km, where the Earth
pulls 15 m/s a day; here the first leg is flown in N-body.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import kernel
from landing_cli.sources.catalogue_records import Catalogue
from landing_cli.tour.beam import Chains, SearchSpace, coasts_of, improved, joined, scratch_for
from landing_cli.tour.beam_search import (
    CHUNK_CHAINS,
    CHUNK_SHOTS,
    FINAL_ROUNDS,
    Run,
    gather,
    search_space,
    serial,
)
from landing_cli.tour.chain_kernel import LEG_COLUMNS, Bounds, FirstLegs, Scratch, chain_cost
from landing_cli.tour.coast_scan import Coasts, rows_of
from landing_cli.tour.ephemeris import Ephemeris
from landing_cli.tour.first_legs import Fan
from landing_cli.tour.first_level import ROUNDS, first_fan, shot
from landing_cli.tour.found_chains import outcome_of
from landing_cli.tour.records import (
    BeamOptions,
    Departure,
    DepthReport,
    LayeredOptions,
    SearchLimits,
    SearchOutcome,
)

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def search(
    catalogue: Catalogue,
    departure: Departure,
    limits: SearchLimits,
    options: LayeredOptions,
    ephemeris: Ephemeris,
    run: Run = serial,
    progress: Callable[[DepthReport], None] = lambda _: None,
) -> SearchOutcome:
    """Search chains of flybys as the paper does.

    Parameters
    ----------
    catalogue : Catalogue
        The targets.
    departure : Departure
        Where the spacecraft sets out.
    limits : SearchLimits
        What every chain keeps to.
    options : LayeredOptions
        Threshold and counts.
    ephemeris : Ephemeris
        From the epochs of the catalogue to the end of the flight.
    run : callable
        Runs a function on chunks of work and yields (index, answer) in any order.
    progress : callable
        Told what each round found.

    Returns
    -------
    SearchOutcome
        Hints, not yet flown in N-body beyond their first leg.

    Raises
    ------
    PartialResult
        A worker was lost.
    """
    grid = BeamOptions(
        beam=options.k3,
        time_step_s=options.time_step_s,
        waits_s=(0.0,),
        branches=options.k2,
        kept_chains=options.kept_chains,
    )
    space = search_space(catalogue, departure, limits, grid, ephemeris, run)
    magnitude = np.nan_to_num(catalogue.absolute_magnitude, nan=np.inf)
    levels: list[Chains] = []
    reports: list[DepthReport] = []
    nearest: Chains | None = None
    while len(levels) < limits.asteroids_max:
        if levels:
            work = partial(_next_targets, levels[-1], space, magnitude, options)
            parts = gather(run, work, len(levels[-1]), CHUNK_CHAINS)
        else:
            fan = _unburnt(first_fan(departure, limits.first_burn_wait_s, space))
            work = partial(_first_targets, fan, space, magnitude, options)
            parts = gather(run, work, len(fan.coasts.first), 1)
        found = joined(parts) if parts else None
        if found is None or not len(found):
            break
        within = found.take(np.flatnonzero(found.cost_m_s <= space.limit_m_s))
        kept = within.take(preferred([within.cost_m_s, within.arrival_t_s], options.k3))
        if len(kept):
            settled = gather(run, partial(shot, kept, space, FINAL_ROUNDS), len(kept), CHUNK_SHOTS)
            kept = joined(settled)
            kept = kept.take(np.argsort(kept.cost_m_s, kind="stable"))
            kept = kept.take(np.flatnonzero(kept.cost_m_s <= space.limit_m_s))
        elif not levels:
            nearest = found.take(np.argsort(found.cost_m_s, kind="stable")[:1])
        least = kept if len(kept) else found
        report = DepthReport(
            asteroids=found.length,
            tried=len(found),
            within_limits=len(within),
            kept=len(kept),
            least_delta_v_m_s=float(least.cost_m_s.min()),
        )
        reports.append(report)
        progress(report)
        if not len(kept):
            break
        levels.append(kept)
    return outcome_of(levels, nearest, tuple(reports), catalogue, departure, options.kept_chains)


def preferred(criteria: list[FloatArray], count: int) -> IntArray:
    """Choose the first few by each of several criteria.

    Parameters
    ----------
    criteria : list of (n,) float
        Less is better.
    count : int
        Chosen by each.

    Returns
    -------
    (k,) int
        Rows in order, none twice.
    """
    chosen = [np.argsort(values, kind="stable")[:count] for values in criteria]
    return np.unique(np.concatenate(chosen)).astype(np.int64)


def _unburnt(fan: Fan) -> Fan:
    """Flights of a fan that do not burn, one for each burn date."""
    rows = np.flatnonzero(~fan.flights.burn_m_s.any(axis=1))
    return Fan(rows_of(fan.flights, rows), rows_of(fan.coasts, rows))


def _first_targets(
    fan: Fan, space: SearchSpace, magnitude: FloatArray, options: LayeredOptions, rows: IntArray
) -> Chains:
    """First two selections from the departure."""
    coasts = rows_of(fan.coasts, rows)
    parents, targets = _first_selection(coasts, space, magnitude, options)
    count = len(parents)
    grown = Chains(
        targets=targets[:, None],
        dates=np.zeros((count, 1)),
        legs=np.zeros((count, 1, LEG_COLUMNS)),
        cost_m_s=np.zeros(count),
        first=rows_of(fan.flights, rows[parents]),
    )
    designed = _designed(grown, space)
    near = shot(designed, space, ROUNDS, np.arange(len(designed)))
    return _second_selection(near, np.zeros(len(near), dtype=np.int64), magnitude, options)


def _next_targets(
    chains: Chains, space: SearchSpace, magnitude: FloatArray, options: LayeredOptions, rows: IntArray
) -> Chains:
    """First two selections from some partial chains."""
    mine = chains.take(rows)
    parents, targets = _first_selection(coasts_of(mine, space), space, magnitude, options)
    grown = mine.take(parents)
    blank = np.zeros((len(parents), 1))
    grown = replace(
        grown,
        targets=np.column_stack([grown.targets, targets]),
        dates=np.column_stack([grown.dates, blank, blank]),
    )
    before = {tuple(row): place for place, row in enumerate(mine.targets.tolist())}
    designed = _designed(grown, space)
    owner = np.array([before[tuple(row[:-1])] for row in designed.targets.tolist()], dtype=np.int64)
    return _second_selection(designed, owner, magnitude, options)


def _first_selection(
    coasts: Coasts, space: SearchSpace, magnitude: FloatArray, options: LayeredOptions
) -> tuple[IntArray, IntArray]:
    """Targets by nearest distance, its date, and magnitude, within the threshold: (parent, target)."""
    parents, targets = [], []
    distance, when = np.zeros(len(magnitude)), np.zeros(len(magnitude))
    for j in range(len(coasts.first)):
        nearest_passes(space.table.grid_t_s, space.table.grid_m, coasts, j, distance, when)
        near = np.flatnonzero(distance <= options.distance_m)
        near = near[~np.isin(near, coasts.taken[j])]
        chosen = near[preferred([when[near], distance[near], magnitude[near]], options.k1)]
        parents.append(np.full(len(chosen), j))
        targets.append(chosen)
    return np.concatenate(parents).astype(np.int64), np.concatenate(targets).astype(np.int64)


def _second_selection(
    designed: Chains, owner: IntArray, magnitude: FloatArray, options: LayeredOptions
) -> Chains:
    """Transfers by burn, date, and magnitude, from each partial chain."""
    chosen = [np.zeros(0, dtype=np.int64)]
    for parent in np.unique(owner):
        rows = np.flatnonzero(owner == parent)
        bright = magnitude[designed.targets[rows, -1]]
        chosen.append(
            rows[preferred([designed.cost_m_s[rows], designed.arrival_t_s[rows], bright], options.k2)]
        )
    return designed.take(np.concatenate(chosen))


def _designed(grown: Chains, space: SearchSpace) -> Chains:
    """Find the arrival on the grid that costs least, then improve all dates."""
    dates = grown.dates.copy()
    best_arrivals(
        dates,
        grown.targets,
        grown.first,
        space.table.grid_t_s,
        space.table.node_t_s,
        space.table.node_states,
        space.bounds,
        space.ephemeris,
        scratch_for(space),
    )
    flies = np.flatnonzero(np.isfinite(dates[:, -1]))
    better = improved(replace(grown, dates=dates).take(flies), space, ROUNDS)
    return better.take(np.flatnonzero(np.isfinite(better.cost_m_s)))


@kernel
def nearest_passes(
    grid_t_s: FloatArray,
    grid_m: NDArray[np.float32],
    coasts: Coasts,
    j: int,
    distance_m: FloatArray,
    when_t_s: FloatArray,
) -> None:
    """Find the least distance of every target from one coast.

    Parameters
    ----------
    grid_t_s : (m,) float, s
        Grid, evenly spaced.
    grid_m : (n, 3, m) float32, m
        Positions of the targets.
    coasts : Coasts
        Flights.
    j : int
        Which.
    distance_m : (n,) float, m
        Receives the distances, of paths that are straight from one time of the grid to the next.
    when_t_s : (n,) float, s
        Receives the times.
    """
    for i in range(grid_m.shape[0]):
        distance_m[i], when_t_s[i] = np.inf, np.inf
        ax = ay = az = 0.0
        for k in range(coasts.first[j], grid_t_s.shape[0]):
            bx = grid_m[i, 0, k] - coasts.position_m[j, 0, k]
            by = grid_m[i, 1, k] - coasts.position_m[j, 1, k]
            bz = grid_m[i, 2, k] - coasts.position_m[j, 2, k]
            if k > coasts.first[j]:
                dx, dy, dz = bx - ax, by - ay, bz - az
                share = max(0.0, min(1.0, -(ax * dx + ay * dy + az * dz) / (dx * dx + dy * dy + dz * dz)))
                away = np.sqrt((ax + share * dx) ** 2 + (ay + share * dy) ** 2 + (az + share * dz) ** 2)
                if away < distance_m[i]:
                    distance_m[i] = away
                    when_t_s[i] = grid_t_s[k - 1] + share * (grid_t_s[k] - grid_t_s[k - 1])
            ax, ay, az = bx, by, bz


@kernel
def best_arrivals(
    dates: FloatArray,
    targets: IntArray,
    first: FirstLegs,
    grid_t_s: FloatArray,
    node_t_s: FloatArray,
    node_states: FloatArray,
    bounds: Bounds,
    ephemeris: Ephemeris,
    scratch: Scratch,
) -> None:
    """Set the last arrival of chains to the time of the grid that costs least.

    Parameters
    ----------
    dates : (c, 2 L - 1) float, s
        Dates; the last of each is set, NaN where none flies.
    targets : (c, L) int
        Rows of the nodes.
    first : FirstLegs
        c flights.
    grid_t_s : (m,) float, s
        Grid.
    node_t_s, node_states : (k,) and (n, k, 6) float
        Motion of the targets.
    bounds : Bounds
        What the dates keep to.
    ephemeris : Ephemeris
        The Earth among others.
    scratch : Scratch
        Room to work in.
    """
    length = targets.shape[1]
    legs = np.empty((length, LEG_COLUMNS))
    change = np.zeros(3)
    for j in range(dates.shape[0]):
        best, least = np.nan, np.inf
        change[:] = 0.0
        for t in grid_t_s:
            dates[j, -1] = t
            cost = chain_cost(
                dates[j],
                length,
                targets[j],
                first,
                j,
                node_t_s,
                node_states,
                bounds,
                ephemeris,
                change,
                scratch,
                legs,
            )
            if cost < least:
                best, least = t, cost
        dates[j, -1] = best
