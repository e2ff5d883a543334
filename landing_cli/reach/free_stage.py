"""The final stage's duration chosen for each facet (`final_stage_s: free`).

The least energy J, and the least thrust level tau where no duration led to a landing, are looked for on a
lattice of durations: first on every sixteenth of them, then around the two best local least values, in steps
half as long each time. That is done on the coarse time grid; the duration that is chosen is then solved as
any facet is. A duration is a value of the lattice whatever else is asked, so a facet's answer depends on the
facet alone. Between lattice points nothing is asked and nothing is proved: with a free final stage no facet
is called proved unreachable.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.free_descent import PreparedCase, prepare, screen, solve_prepared
from landing_cli.reach.free_solve import CONVERGED
from landing_cli.reach.least_thrust import fill_margin, fly_least_thrust
from landing_cli.reach.margin import ThrustLevels, least_thrust_flights, thrust_levels
from landing_cli.reach.records import FacetSolutions, FreeFinalStage, Verdict, blank_rows

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
Ask = Callable[[int, Ints], Floats]
Solve = Callable[[PreparedCase, Ints], FacetSolutions]

# Intervals of the lattice of durations, and of them to a first step.
LATTICE, FIRST_STEP = 128, 16
VALLEYS = 2
# Where no duration of the first steps needs less than this share of the thrust bound, none between is
# looked for, unless the margin is asked.
HOPELESS_LEVEL = 1.15

_COST = "performance_index_m2_s3"


def solve_free_stage(
    prepared: PreparedCase, free: FreeFinalStage, facets: NDArray[np.integer]
) -> FacetSolutions:
    """Solve some facets, each with the duration of the final stage that suits it best.

    Parameters
    ----------
    prepared : PreparedCase
        The case, with free descent control.
    free : FreeFinalStage
        Durations that are allowed.
    facets : (n,) int
        Facets, 0-based.

    Returns
    -------
    FacetSolutions
        One row a facet, in the order given: the flight of least J over the durations, which is never worse
        than that of the compared duration; elsewhere what stops the flight of least thrust level.
    """
    return _Search(prepared, free, np.asarray(facets, dtype=np.int64)).run()


class _Search:
    """One chunk of facets: the best flights so far, by facet."""

    def __init__(self, prepared: PreparedCase, free: FreeFinalStage, facets: Ints) -> None:
        self.prepared, self.free, self.facets = prepared, free, facets
        self.durations_s = np.linspace(free.shortest_s, free.longest_s, LATTICE + 1)
        self.rows = blank_rows(facets)
        self.nodes = [np.zeros((0, 3))] * len(facets)
        self.iterations = np.zeros(len(facets), dtype=np.int64)
        self.known: dict[float, PreparedCase] = {}

    def run(self) -> FacetSolutions:
        """Search, then put the answers together."""
        everything, compared_s = np.arange(len(self.facets)), self.free.compared_s
        compared = np.full(len(self.facets), Verdict.UNRESOLVED, dtype=np.uint8)
        if compared_s is not None:
            compared[:] = self._keep(solve_prepared, compared_s, everything)["verdict"]
        self._search_energy(everything, ask_first_steps(self._energy, len(self.facets)))
        margin = self.prepared.case.margin
        self._search_level(everything if margin else np.flatnonzero(~self._reached(everything)))
        self.rows["compared_verdict"], self.rows["iterations"] = compared, self.iterations
        return FacetSolutions(self.rows, np.concatenate([np.zeros((0, 3)), *self.nodes]))

    def _search_energy(self, places: Ints, energy: Floats) -> None:
        """Go on from some energies to the least of facets where there is any, and solve these anew."""
        found = np.isfinite(_least(energy))
        chosen = places[found]
        energy = refine(lambda step, among: self._energy(step, chosen[among]), energy[found])
        for step, among in _by_step(energy):
            self._keep(solve_prepared, float(self.durations_s[step]), chosen[among])

    def _search_level(self, places: Ints) -> None:
        """Find the least level of some facets, land where it allows it, and keep what stops the others."""
        level = ask_first_steps(lambda step, among: self._level(step, places[among]), len(places))
        near = self.prepared.case.margin | (_least(level) < HOPELESS_LEVEL)
        level[near] = refine(lambda step, among: self._level(step, places[near][among]), level[near])
        lost, energy = ~self._reached(places), np.full(level.shape, np.nan)
        for step, among in _by_step(level):
            self._at_least_level(float(self.durations_s[step]), places[among])
            energy[among, step] = self.rows[_COST][places[among]]  # NaN where none was landed on
        self._search_energy(places[lost], energy[lost])

    def _reached(self, places: Ints) -> Flags:
        return np.asarray(self.rows["verdict"][places] == Verdict.REACHABLE)

    def _at(self, duration_s: float) -> PreparedCase:
        """The case with one duration, all of them with the same gravity in memory."""
        if duration_s not in self.known:
            base = self.prepared
            own = prepare(base.case.with_final_stage(duration_s), base.shared)
            gravity = base.coarse.gravity_params
            grids = own.coarse._replace(gravity_params=gravity), own.fine._replace(gravity_params=gravity)
            self.known[duration_s] = replace(own, coarse=grids[0], fine=grids[1])
        return self.known[duration_s]

    def _keep(self, solve: Solve, duration_s: float, places: Ints) -> NDArray[np.void]:
        """Solve some facets with one duration; a flight that costs less takes the place of the best."""
        found = solve(self._at(duration_s), self.facets[places])
        found.rows["final_stage_s"] = duration_s
        self.iterations[places] += found.rows["iterations"]
        reachable = found.rows["verdict"] == Verdict.REACHABLE
        better = reachable & ~(found.rows[_COST] >= self.rows[_COST][places])
        for row in np.flatnonzero(better).tolist():
            self.rows[places[row]] = found.rows[row]
            self.nodes[places[row]] = found.nodes_of(row)
        return found.rows

    def _energy(self, step: int, places: Ints) -> Floats:
        found = self._keep(screen, float(self.durations_s[step]), places)
        return np.where(found["verdict"] == Verdict.REACHABLE, found[_COST], np.inf)

    def _level(self, step: int, places: Ints) -> Floats:
        own, shared = self._at(float(self.durations_s[step])), self.prepared.shared
        targets, normals = shared.centroids_m[self.facets[places]], shared.normals[self.facets[places]]
        flights = least_thrust_flights(own, own.coarse, own.coarse_tube, targets, normals)
        self.iterations[places] += flights.iterations
        return np.where(flights.status == CONVERGED, flights.level, np.inf)

    def _at_least_level(self, duration_s: float, places: Ints) -> None:
        """Fill the level of some facets; where none was landed on yet, land, or tell what stops that."""
        own, margin = self._at(duration_s), self.prepared.case.margin
        if margin:
            levels, flights = fly_least_thrust(own, self.facets[places])
            flown = flights.rows["thrust_level_flown"]
        else:
            levels, flown = thrust_levels(own, self.facets[places]), np.full(len(places), np.nan)
        lost = np.flatnonzero(~self._reached(places))
        found = self._keep(solve_prepared, duration_s, places[lost])
        stopped = np.flatnonzero(~self._reached(places[lost]))
        short = levels.level[lost[stopped]] > 1.0
        self.rows[places[lost[stopped]]] = found[stopped]
        rows = self.rows[places]
        judged = lost[stopped]
        rows["proved"] = 0
        rows["verdict"][judged[short]] = Verdict.UNREACHABLE
        rows["violation"][judged[short]] = levels.level[judged[short]] - 1.0
        rows["verdict"][judged[~short & ~levels.solved[judged]]] = Verdict.UNRESOLVED
        unproved = ThrustLevels(levels.level, np.full(len(places), np.nan), levels.solved)
        fill_margin(rows, unproved, flown)
        if not margin:
            rows["thrust_level_flown"] = np.nan
        self.rows[places] = rows


def ask_first_steps(ask: Ask, size: int) -> Floats:
    """Ask every facet at the first steps of the lattice.

    Parameters
    ----------
    ask : callable
        Value of the objective at one step of the lattice for some of the facets; inf where there is none.
    size : int
        How many facets.

    Returns
    -------
    (size, LATTICE + 1) float
        NaN where nothing was asked.
    """
    known = np.full((size, LATTICE + 1), np.nan)
    if size:
        for step in range(0, LATTICE + 1, FIRST_STEP):
            known[:, step] = ask(step, np.arange(size))
    return known


def refine(ask: Ask, known: Floats) -> Floats:
    """Look for the least value around the best local least ones, in steps half as long each time.

    Parameters
    ----------
    ask : callable
        As for :func:`ask_first_steps`.
    known : (n, LATTICE + 1) float
        Values so far, NaN where nothing was asked.

    Returns
    -------
    (n, LATTICE + 1) float
        With what was asked in addition.
    """
    known, spacing = known.copy(), FIRST_STEP // 2
    while spacing and len(known):
        rows, steps = _valleys(known)
        rows, steps = np.tile(rows, 2), np.concatenate([steps - spacing, steps + spacing])
        fit = (steps >= 0) & (steps <= LATTICE)
        wanted = np.zeros(known.shape, dtype=bool)
        wanted[rows[fit], steps[fit]] = True
        wanted &= np.isnan(known)
        for step in np.flatnonzero(wanted.any(axis=0)).tolist():
            places = np.flatnonzero(wanted[:, step])
            known[places, step] = ask(step, places)
        spacing //= 2
    return known


def _valleys(known: Floats) -> tuple[Ints, Ints]:
    """Rows and steps of the best local least values of every row."""
    count = known.shape[1]
    values, steps = np.where(np.isnan(known), np.inf, known), np.arange(count)
    asked = ~np.isnan(known)
    before = np.maximum.accumulate(np.where(asked, steps, -1), axis=1)
    after = np.minimum.accumulate(np.where(asked, steps, count)[:, ::-1], axis=1)[:, ::-1]
    padded = np.pad(values, ((0, 0), (1, 1)), constant_values=np.inf)
    left = np.take_along_axis(padded, np.pad(before, ((0, 0), (1, 0)), constant_values=-1)[:, :-1] + 1, 1)
    right = np.take_along_axis(padded, np.pad(after, ((0, 0), (0, 1)), constant_values=count)[:, 1:] + 1, 1)
    valley = np.where(np.isfinite(values) & (values <= left) & (values < right), values, np.inf)
    best = np.argsort(valley, axis=1, kind="stable")[:, :VALLEYS]
    rows, columns = np.nonzero(np.isfinite(np.take_along_axis(valley, best, 1)))
    return rows, best[rows, columns]


def _by_step(known: Floats) -> Iterator[tuple[int, Ints]]:
    """Steps that have the least known value of some rows, and these; the first step where there is none."""
    best = np.where(np.isnan(known), np.inf, known).argmin(axis=1)
    for step in np.unique(best).tolist():
        yield step, np.flatnonzero(best == step)


def _least(known: Floats) -> Floats:
    """Least known value of every row, inf where there is none."""
    return np.asarray(np.where(np.isnan(known), np.inf, known).min(axis=1))
