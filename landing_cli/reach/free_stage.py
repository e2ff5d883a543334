"""The final stage's duration chosen for each facet (`final_stage_s: free`).

The least energy J, and the least thrust level tau where no duration led to a landing, are looked for on a
lattice of durations: first on every sixteenth of them, then around the two best local least values, in steps
half as long each time. A duration is a value of the lattice whatever else is asked, so a facet's answer
depends on the facet alone. Between lattice points nothing is asked and nothing is proved: with a free final
stage no facet is called proved unreachable.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.free_descent import PreparedCase, prepare, solve_prepared
from landing_cli.reach.least_thrust import fill_margin, fly_least_thrust
from landing_cli.reach.margin import ThrustLevels, thrust_levels
from landing_cli.reach.records import FacetSolutions, FreeFinalStage, Verdict, blank_rows

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Ask = Callable[[int, Ints], Floats]

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
        everything = np.arange(len(self.facets))
        compared = np.full(len(self.facets), Verdict.UNRESOLVED, dtype=np.uint8)
        if self.free.compared_s is not None:
            compared[:] = self._try(self.free.compared_s, everything).rows["verdict"]
        energy = ask_first_steps(self._energy, len(self.facets))
        margin = self.prepared.case.margin
        asked = everything if margin else np.flatnonzero(self.rows["verdict"] != Verdict.REACHABLE)
        level = ask_first_steps(lambda step, places: self._level(step, asked[places]), len(asked))
        near = everything[: len(asked)] if margin else np.flatnonzero(_least(level) < HOPELESS_LEVEL)
        level[near] = refine(lambda step, places: self._level(step, asked[near[places]]), level[near])
        self._try_least_thrust(asked, level, energy)
        found = np.flatnonzero(np.isfinite(_least(energy)))
        refine(lambda step, places: self._energy(step, found[places]), energy[found])
        self._fill_levels(asked, level)
        self.rows["compared_verdict"], self.rows["iterations"] = compared, self.iterations
        return FacetSolutions(self.rows, np.concatenate([np.zeros((0, 3)), *self.nodes]))

    def _at(self, duration_s: float) -> PreparedCase:
        """The case with one duration, all of them with the same gravity in memory."""
        if duration_s not in self.known:
            base = self.prepared
            own = prepare(base.case.with_final_stage(duration_s), base.shared)
            gravity = base.coarse.gravity_params
            grids = own.coarse._replace(gravity_params=gravity), own.fine._replace(gravity_params=gravity)
            self.known[duration_s] = PreparedCase(
                own.case, own.shared, *grids, own.coarse_tube, own.fine_tube, own.frame
            )
        return self.known[duration_s]

    def _try(self, duration_s: float, places: Ints) -> FacetSolutions:
        """Solve some facets with one duration; a flight that costs less takes the place of the best."""
        found = solve_prepared(self._at(duration_s), self.facets[places])
        found.rows["final_stage_s"] = duration_s
        self.iterations[places] += found.rows["iterations"]
        reachable = found.rows["verdict"] == Verdict.REACHABLE
        better = reachable & ~(found.rows[_COST] >= self.rows[_COST][places])
        for row in np.flatnonzero(better).tolist():
            self.rows[places[row]] = found.rows[row]
            self.nodes[places[row]] = found.nodes_of(row)
        return found

    def _energy(self, step: int, places: Ints) -> Floats:
        found = self._try(float(self.durations_s[step]), places).rows
        return np.where(found["verdict"] == Verdict.REACHABLE, found[_COST], np.inf)

    def _level(self, step: int, places: Ints) -> Floats:
        levels = thrust_levels(self._at(float(self.durations_s[step])), self.facets[places])
        return np.where(levels.solved, levels.level, np.inf)

    def _try_least_thrust(self, asked: Ints, level: Floats, energy: Floats) -> None:
        """Solve, where nothing was found yet, with the duration of the least level; keep what stops it."""
        best = _best_steps(level)
        lost = self.rows["verdict"][asked] != Verdict.REACHABLE
        for step in np.unique(best[lost]).tolist():
            chosen = np.flatnonzero(lost & (best == step))
            places = asked[chosen]
            found = self._try(float(self.durations_s[step]), places).rows
            reached = found["verdict"] == Verdict.REACHABLE
            energy[places, step] = np.where(reached, found[_COST], np.inf)
            least, stopped = level[chosen, step], np.flatnonzero(~reached)
            self.rows[places[stopped]] = found[stopped]
            short = np.flatnonzero(~reached & (least > 1.0) & np.isfinite(least))
            self.rows["verdict"][places[short]] = Verdict.UNREACHABLE
            self.rows["violation"][places[short]] = least[short] - 1.0
            unknown = np.flatnonzero(~reached & ~np.isfinite(least))
            self.rows["verdict"][places[unknown]] = Verdict.UNRESOLVED
        self.rows["proved"] = 0

    def _fill_levels(self, asked: Ints, level: Floats) -> None:
        """Fill the margin of those that were asked; on demand with the level of the flight that has it."""
        best, least = _best_steps(level), _least(level)
        least = np.where(np.isfinite(least), least, np.nan)
        rows = self.rows[asked]
        if not self.prepared.case.margin:
            reachable = rows["verdict"] == Verdict.REACHABLE
            self.rows["thrust_margin"][asked] = 1.0 - np.where(reachable, np.minimum(least, 1.0), least)
            return
        flown = np.full(len(asked), np.nan)
        for step in np.unique(best).tolist():
            chosen = np.flatnonzero(best == step)
            own = self._at(float(self.durations_s[step]))
            flown[chosen] = fly_least_thrust(own, self.facets[asked[chosen]])[1].rows["thrust_level_flown"]
        unproved = np.full(len(asked), np.nan)
        fill_margin(rows, ThrustLevels(least, unproved, np.isfinite(least)), flown)
        self.rows[asked] = rows


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


def _best_steps(known: Floats) -> Ints:
    """Step of the least known value of every row; the first where there is none."""
    return np.asarray(np.where(np.isnan(known), np.inf, known).argmin(axis=1))


def _least(known: Floats) -> Floats:
    """Least known value of every row, inf where there is none."""
    return np.asarray(np.where(np.isnan(known), np.inf, known).min(axis=1))
