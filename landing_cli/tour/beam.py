"""One level of a beam search: partial chains as arrays, and their extension by one flyby."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.astronomy import GM_SUN_M3_S2
from landing_cli.flight.kepler import kepler_state
from landing_cli.kernel import kernel
from landing_cli.tour.chain_dates import improve_dates
from landing_cli.tour.chain_kernel import LEAST_LEG_S, LEG_COLUMNS, Bounds, FirstLegs, Scratch
from landing_cli.tour.coast_scan import Coasts, coast_from, rows_of, scan_targets
from landing_cli.tour.ephemeris import Ephemeris
from landing_cli.tour.target_table import TargetTable, state_from_nodes

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Chains:
    """c partial chains of the same length L.

    Attributes
    ----------
    targets : (c, L) int
        Rows of the catalogue.
    dates : (c, 2 L - 1) float, s
        Arrival of the first leg, then wait and arrival of each other one.
    legs : (c, L, LEG_COLUMNS) float
    cost_m_s : (c,) float, m/s
        Sum of the burns.
    first : FirstLegs
        Flights of the first legs, c of them.
    """

    targets: IntArray
    dates: FloatArray
    legs: FloatArray
    cost_m_s: FloatArray
    first: FirstLegs

    def __len__(self) -> int:
        """Number of chains."""
        return len(self.cost_m_s)

    @property
    def length(self) -> int:
        """Flybys of each chain."""
        return self.targets.shape[1]

    @property
    def arrival_t_s(self) -> FloatArray:
        """Times of the last flybys, (c,), s."""
        return self.dates[:, -1]

    def take(self, rows: IntArray) -> Chains:
        """Choose chains.

        Parameters
        ----------
        rows : (k,) int
            Which, in the order wanted.

        Returns
        -------
        Chains
        """
        first = rows_of(self.first, rows)
        return Chains(self.targets[rows], self.dates[rows], self.legs[rows], self.cost_m_s[rows], first)


@dataclass(frozen=True, eq=False)
class SearchSpace:
    """What every level needs.

    Attributes
    ----------
    table : TargetTable
    bounds : Bounds
    ephemeris : Ephemeris
    limit_m_s : float, m/s
        Largest sum of the burns.
    waits_s : (w,) float, s
        Waits from which the dates are improved.
    branches : int
        Targets tried from each chain.
    """

    table: TargetTable
    bounds: Bounds
    ephemeris: Ephemeris
    limit_m_s: float
    waits_s: FloatArray
    branches: int


def joined(parts: list[Chains]) -> Chains:
    """Put chains of several workers together.

    Parameters
    ----------
    parts : list of Chains
        Of one length, in order.

    Returns
    -------
    Chains
    """
    first = FirstLegs(
        *(np.concatenate(fields) for fields in zip(*(part.first for part in parts), strict=True))
    )
    return Chains(
        np.concatenate([part.targets for part in parts]),
        np.concatenate([part.dates for part in parts]),
        np.concatenate([part.legs for part in parts]),
        np.concatenate([part.cost_m_s for part in parts]),
        first,
    )


def improved(chains: Chains, space: SearchSpace, rounds: int) -> Chains:
    """Improve the dates of chains.

    Parameters
    ----------
    chains : Chains
        With dates to begin with.
    space : SearchSpace
        Targets and bounds.
    rounds : int
        Steps at most.

    Returns
    -------
    Chains
        Infinite cost where the dates given do not fly.
    """
    dates = chains.dates.copy()
    legs = np.zeros((len(chains), chains.length, LEG_COLUMNS))
    cost = np.zeros(len(chains))
    improve_batch(
        dates,
        chains.targets,
        chains.first,
        space.table.node_t_s,
        space.table.node_states,
        space.bounds,
        space.ephemeris,
        scratch_for(space),
        legs,
        cost,
        rounds,
    )
    return replace(chains, dates=dates, legs=legs, cost_m_s=cost)


def scratch_for(space: SearchSpace) -> Scratch:
    """Make room for the kernels.

    Parameters
    ----------
    space : SearchSpace
        Whose revolutions and bodies count.

    Returns
    -------
    Scratch
    """
    return Scratch(
        np.zeros((2 * int(space.bounds.turns_max[0]) + 1, 6)), np.zeros((len(space.ephemeris.gm) + 1, 3))
    )


@kernel
def improve_batch(
    dates: FloatArray,
    targets: IntArray,
    first: FirstLegs,
    node_t_s: FloatArray,
    node_states: FloatArray,
    bounds: Bounds,
    ephemeris: Ephemeris,
    scratch: Scratch,
    legs: FloatArray,
    cost: FloatArray,
    rounds: int,
) -> None:
    """Improve the dates of c chains, see `improve_dates`.

    Parameters
    ----------
    dates : (c, 2 L - 1) float, s
        Improved in place.
    targets : (c, L) int
        Rows of the nodes.
    first : FirstLegs
        c flights.
    node_t_s, node_states : (k,) and (n, k, 6) float
        Motion of the targets.
    bounds : Bounds
        What the dates keep to.
    ephemeris : Ephemeris
        The Earth among others.
    scratch : Scratch
        Room to work in.
    legs : (c, L, LEG_COLUMNS) float
        Receives the legs.
    cost : (c,) float, m/s
        Receives the sums.
    rounds : int
        Steps at most.
    """
    for j in range(dates.shape[0]):
        cost[j] = improve_dates(
            dates[j],
            targets.shape[1],
            targets[j],
            first,
            j,
            node_t_s,
            node_states,
            bounds,
            ephemeris,
            scratch,
            legs[j],
            rounds,
        )


def extended(chains: Chains, space: SearchSpace, rounds: int) -> Chains:
    """Extend each chain by the targets that cost least from where it is.

    Parameters
    ----------
    chains : Chains
        Partial chains.
    space : SearchSpace
        Targets and bounds.
    rounds : int
        Steps that improve the dates of each extension.

    Returns
    -------
    Chains
        Longer by one flyby, at most ``branches`` of each; costs beyond the limit among them, infinite ones
        not.
    """
    coasts = coasts_of(chains, space)
    count, keep = len(coasts.first), 2 * space.branches
    target = np.zeros((count, keep), dtype=np.int64)
    arrival, estimate = np.zeros((count, keep)), np.zeros((count, keep))
    burn = np.zeros((count, keep, 3))
    scan_targets(space.table.grid_t_s, space.table.grid_m, coasts, target, arrival, estimate, burn)
    waits = len(space.waits_s)
    parents, chosen, waited, arrived = [], [], [], []
    for j in range(len(chains)):
        rows = slice(j * waits, (j + 1) * waits)
        found = _distinct(target[rows], arrival[rows], estimate[rows], space)
        for wait, place in found:
            parents.append(j)
            chosen.append(target[j * waits + wait, place])
            waited.append(space.waits_s[wait])
            arrived.append(arrival[j * waits + wait, place])
    grown = chains.take(np.array(parents, dtype=np.int64))
    grown = replace(
        grown,
        targets=np.column_stack([grown.targets, np.array(chosen, dtype=np.int64)]),
        dates=np.column_stack([grown.dates, np.array(waited), np.array(arrived)]),
    )
    better = improved(grown, space, rounds)
    return better.take(np.flatnonzero(np.isfinite(better.cost_m_s)))


def _distinct(
    target: IntArray, arrival: FloatArray, estimate: FloatArray, space: SearchSpace
) -> list[tuple[int, int]]:
    """Choose (wait, place) of the cheapest transfers of one chain, each approach of a target once."""
    step = space.table.grid_t_s[1] - space.table.grid_t_s[0]
    chosen: list[tuple[int, int]] = []
    seen: list[tuple[int, float]] = []
    for flat in np.argsort(estimate, axis=None, kind="stable"):
        wait, place = divmod(int(flat), estimate.shape[1])
        if target[wait, place] < 0 or len(chosen) == space.branches:
            break
        mine = (int(target[wait, place]), float(arrival[wait, place]))
        if any(other == mine[0] and abs(t - mine[1]) < step for other, t in seen):
            continue
        seen.append(mine)
        chosen.append((wait, place))
    return chosen


def coasts_of(chains: Chains, space: SearchSpace) -> Coasts:
    """Lay the coasts after the last flybys of chains on the grid.

    Parameters
    ----------
    chains : Chains
        c partial chains.
    space : SearchSpace
        Grid and waits.

    Returns
    -------
    Coasts
        One for each chain and wait; those of one chain follow each other.
    """
    grid = space.table.grid_t_s
    waits, m = len(space.waits_s), len(grid)
    count = len(chains) * waits
    coasts = Coasts(
        first=np.zeros(count, dtype=np.int64),
        position_m=np.zeros((count, 3, m)),
        inverse=np.zeros((count, 9, m)),
        reach_s=np.zeros((count, m)),
        base_m_s=np.zeros((count, 3)),
        limit_m_s=np.repeat(space.limit_m_s - _KEPT_OF_COST * chains.cost_m_s, waits),
        spread_m_s=np.full(count, np.inf),
        taken=np.repeat(chains.targets, waits, axis=0),
    )
    lay_coasts(
        chains.targets,
        chains.legs,
        space.waits_s,
        space.table.node_t_s,
        space.table.node_states,
        grid,
        coasts,
    )
    return coasts


_KEPT_OF_COST = 0.7
"""Share of what a chain costs that stays when its dates are improved together with the next flyby."""


@kernel
def lay_coasts(
    targets: IntArray,
    legs: FloatArray,
    waits_s: FloatArray,
    node_t_s: FloatArray,
    node_states: FloatArray,
    grid_t_s: FloatArray,
    coasts: Coasts,
) -> None:
    """Lay the coasts after the last flybys of c chains on the grid, one for each wait.

    Parameters
    ----------
    targets : (c, L) int
        Rows of the nodes.
    legs : (c, L, LEG_COLUMNS) float
        Legs.
    waits_s : (w,) float, s
        Waits before the burn.
    node_t_s, node_states : (k,) and (n, k, 6) float
        Motion of the targets.
    grid_t_s : (m,) float, s
        Grid.
    coasts : Coasts
        c w coasts to be filled; those of one chain follow each other.
    """
    last = targets.shape[1] - 1
    state = np.empty(6)
    for j in range(targets.shape[0]):
        leg = legs[j, last]
        x, y, z, _, _, _ = state_from_nodes(node_t_s, node_states[targets[j, last]], leg[1])
        for w in range(waits_s.shape[0]):
            state[0], state[1], state[2] = x, y, z
            state[3], state[4], state[5] = leg[5], leg[6], leg[7]
            row = j * waits_s.shape[0] + w
            if waits_s[w] != 0.0:
                state[0], state[1], state[2], state[3], state[4], state[5] = kepler_state(
                    GM_SUN_M3_S2, x, y, z, leg[5], leg[6], leg[7], waits_s[w]
                )
            burn_t_s = leg[1] + waits_s[w]
            coast_from(state, burn_t_s, burn_t_s + LEAST_LEG_S, grid_t_s, coasts, row)
