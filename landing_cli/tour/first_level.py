"""The first level of a search: every target that one burn reaches, the leg flown in N-body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.astronomy import DAY_S
from landing_cli.tour.beam import Chains, SearchSpace, improved
from landing_cli.tour.chain_kernel import LEG_COLUMNS
from landing_cli.tour.coast_scan import rows_of, scan_targets
from landing_cli.tour.ephemeris import Ephemeris
from landing_cli.tour.first_legs import Fan, Fly, fly_fan, shoot
from landing_cli.tour.nbody import fly
from landing_cli.tour.records import Departure
from landing_cli.tour.target_table import SEARCH_TOLERANCE, positions_at

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

BURN_DATES = 3
"""First burns that are tried between the departure and the longest wait."""
ROUNDS = 12
"""Steps that improve the dates of a candidate before the choice."""
_MARGIN = 1.2
"""A first leg may cost so much more by the fan than by the exact flight."""


def carrier(ephemeris: Ephemeris) -> Fly:
    """Make the N-body flight of a search.

    Parameters
    ----------
    ephemeris : Ephemeris
        Over all flights.

    Returns
    -------
    callable
        States from times to times.
    """

    def carry(states: FloatArray, start_t_s: FloatArray, end_t_s: FloatArray) -> FloatArray:
        return fly(states, start_t_s, end_t_s, ephemeris, SEARCH_TOLERANCE)[0]

    return carry


def first_fan(departure: Departure, wait_max_s: float, space: SearchSpace) -> Fan:
    """Fly the fan of first burns.

    Parameters
    ----------
    departure : Departure
        Where the spacecraft sets out.
    wait_max_s : float, s
        The first burn is no later than this after it.
    space : SearchSpace
        Grid and limit.

    Returns
    -------
    Fan
    """
    waits_s = np.linspace(0.0, wait_max_s, BURN_DATES) if wait_max_s > DAY_S else np.zeros(1)
    return fly_fan(departure, waits_s, space.limit_m_s, space.table.grid_t_s, carrier(space.ephemeris))


def seen_from_fan(fan: Fan, space: SearchSpace, keep: int, rows: IntArray) -> Chains:
    """Find the targets that pass near some flights of a fan, with the burns and dates that cost least.

    Parameters
    ----------
    fan : Fan
        Flights.
    space : SearchSpace
        Targets and bounds.
    keep : int
        Targets of each flight.
    rows : (k,) int
        Which flights.

    Returns
    -------
    Chains
        Of one flyby; their burns are good as far as the flight's own burn is near.
    """
    coasts = rows_of(fan.coasts, rows)
    target = np.zeros((len(rows), keep), dtype=np.int64)
    arrival, estimate = np.zeros((len(rows), keep)), np.zeros((len(rows), keep))
    burn = np.zeros((len(rows), keep, 3))
    scan_targets(space.table.grid_t_s, space.table.grid_m, coasts, target, arrival, estimate, burn)
    good = target >= 0
    flights = np.repeat(rows[:, None], keep, axis=1)[good]
    chains = Chains(
        targets=target[good][:, None],
        dates=arrival[good][:, None],
        legs=np.zeros((len(flights), 1, LEG_COLUMNS)),
        cost_m_s=estimate[good],
        first=rows_of(fan.flights, flights),
    )
    better = improved(chains, space, ROUNDS)
    return better.take(np.flatnonzero(better.cost_m_s <= _MARGIN * space.limit_m_s))


def distinct_first_legs(chains: Chains, space: SearchSpace, count: int) -> Chains:
    """Keep the cheapest of the first legs that several flights of the fan have led to.

    Parameters
    ----------
    chains : Chains
        Of one flyby.
    space : SearchSpace
        Grid.
    count : int
        Chains at most.

    Returns
    -------
    Chains
        One for each burn date, target and cell of the grid; the cheapest first.
    """
    step = space.table.grid_t_s[1] - space.table.grid_t_s[0]
    cells = np.column_stack(
        [chains.targets[:, 0], np.round(chains.arrival_t_s / step), chains.first.burn_t_s]
    )
    order = np.argsort(chains.cost_m_s, kind="stable")
    _, place = np.unique(cells[order], axis=0, return_index=True)
    return chains.take(order[np.sort(place)[:count]])


def shot(chains: Chains, space: SearchSpace, rounds: int, rows: IntArray) -> Chains:
    """Fly first legs in N-body with the dates that chains have now, then improve all dates.

    Parameters
    ----------
    chains : Chains
        Of any length.
    space : SearchSpace
        Targets and bounds.
    rounds : int
        Steps at most.
    rows : (k,) int
        Which chains.

    Returns
    -------
    Chains
        Without those whose first leg finds no burn.
    """
    mine = chains.take(rows)
    first, arrival_t_s = mine.first, mine.legs[:, 0, 1]
    meet = positions_at(space.table, mine.targets[:, 0], arrival_t_s)
    flown, met = shoot(
        first.start, first.burn_t_s, mine.legs[:, 0, 2:5], meet, arrival_t_s, carrier(space.ephemeris)
    )
    better = improved(replace(mine, first=flown).take(np.flatnonzero(met)), space, rounds)
    return better.take(np.flatnonzero(np.isfinite(better.cost_m_s)))
