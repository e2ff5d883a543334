"""Why a facet is not reachable: the least relaxation of each thing alone that would make it so.

A relaxation is told only where a flight was delivered that keeps every limit at the relaxed value, while
the facet was not found reachable one step below. More thrust, a wider glide slope, a smaller ellipsoid and
more propellant only ever add flights: the least step is found by bisection. Time does not: it is looked at
outwards in coarse strides, both ways, and then bisected, so an interval of times narrower than a stride can
be missed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.facet_work import solve_without_proofs
from landing_cli.reach.free_descent import PreparedCase, prepare
from landing_cli.reach.margin import thrust_levels
from landing_cli.reach.records import Binding, LandingCase, Verdict
from landing_cli.reach.relaxations import Kind, Ladder, ladders, survey_without_proofs, through_rock

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

# Steps in a stride of a search outwards.
STRIDE = 32


@dataclass(frozen=True)
class Searched:
    """How far and how finely a thing was relaxed.

    Attributes
    ----------
    kind : Kind
    step : float
        In the kind's unit: one step less is not reachable.
    lowest, highest : float
        The largest changes that were tried, down and up.
    scale : float
        What a change is measured against.
    """

    kind: Kind
    step: float
    lowest: float
    highest: float
    scale: float


@dataclass(frozen=True, eq=False)
class WhyNot:
    """What would make facets of one case reachable.

    Attributes
    ----------
    facets : (n,) int
    searched : tuple of Searched
        One a thing that was relaxed.
    changes : (n, k) float
        Its least change, in its unit; NaN where none that was tried helps. Of the terrain: the depth in
        rock of the flight that keeps all other limits.
    """

    facets: Ints
    searched: tuple[Searched, ...]
    changes: Floats

    def easiest(self) -> Ints:
        """Index of the least change relative to what it changes, -1 where nothing alone helps."""
        scales = np.array([s.scale for s in self.searched])
        relative = np.where(np.isnan(self.changes), np.inf, np.abs(self.changes) / scales)
        return np.where(np.isinf(relative).all(axis=1), -1, np.argmin(relative, axis=1))


def why_not(case: LandingCase, rows: NDArray[np.void]) -> WhyNot:
    """Find the least relaxations that make facets reachable.

    Parameters
    ----------
    case : LandingCase
        The case.
    rows : (n,) structured array of FACET_DTYPE
        Facets that it does not reach, ascending, as they were solved.

    Returns
    -------
    WhyNot
    """
    case = replace(case, margin=False)
    shared, facets = survey_without_proofs(case), rows["facet"].astype(np.int64)
    searched, changes = [], []
    for ladder in ladders(case, shared):
        first = np.full(len(facets), ladder.highest)
        if ladder.kind is Kind.THRUST:
            first = _guessed_thrust(ladder, rows, prepare(case, shared))
        steps = _least_nested(ladder, facets, first) if ladder.nested else _nearest(ladder, facets)
        span = ladder.step * ladder.lowest, ladder.step * ladder.highest
        searched.append(Searched(ladder.kind, ladder.step, *span, ladder.scale))
        changes.append(np.where(steps == 0, np.nan, steps * ladder.step))
    open_ = through_rock(case, shared)
    if open_ is not None:
        rock = solve_without_proofs(open_, facets).rows
        reached = rock["verdict"] == Verdict.REACHABLE
        changes.append(np.where(reached, np.maximum(0.0, -rock["terrain_clearance_min_m"]), np.nan))
        searched.append(Searched(Kind.TERRAIN, 0.0, 0.0, np.inf, shared.mean_edge_m))
    return WhyNot(facets, tuple(searched), np.stack(changes, axis=1))


def _reached(ladder: Ladder, facets: Ints, steps: Ints) -> Flags:
    """Whether each facet is reachable after so many steps; facets that ask for the same share a case."""
    reached = np.zeros(len(facets), dtype=np.bool_)
    for step in np.unique(steps):
        of = steps == step
        rows = solve_without_proofs(ladder.at(int(step)), facets[of]).rows
        reached[of] = rows["verdict"] == Verdict.REACHABLE
    return reached


def _guessed_thrust(ladder: Ladder, rows: NDArray[np.void], prepared: PreparedCase) -> Ints:
    """Steps of thrust to try first: those to the least thrust level; the highest where it does not tell."""
    level = thrust_levels(prepared, rows["facet"].astype(np.int64)).level
    known = (rows["binding"] != Binding.TERRAIN) & (level > 1.0)
    steps = np.where(known, (level - 1.0) * ladder.scale / ladder.step, np.inf)
    return np.clip(np.ceil(steps), 1, ladder.highest).astype(np.int64)


def _least_nested(ladder: Ladder, facets: Ints, first: Ints) -> Ints:
    """Least steps at which each facet is reachable, 0 where it is not after the highest.

    From the first guess the strides grow until the answer lies between two tries, then it is bisected.
    """
    beyond = ladder.highest + 1
    low, high = np.zeros(len(facets), dtype=np.int64), np.full(len(facets), beyond)
    stride = np.where(first == ladder.highest, ladder.highest, 1)
    probe = first.copy()
    while (open_ := np.flatnonzero(high - low > 1)).size:
        reached = _reached(ladder, facets[open_], probe[open_])
        high[open_[reached]] = probe[open_[reached]]
        low[open_[~reached]] = probe[open_[~reached]]
        upwards = np.minimum(low + stride, ladder.highest)
        downwards = np.maximum(high - stride, (low + high) // 2)
        probe = np.where(high == beyond, upwards, downwards)
        stride = 4 * stride
    return np.where(high == beyond, 0, high)


def _nearest(ladder: Ladder, facets: Ints) -> Ints:
    """Steps of the least change, either way, that makes each facet reachable; 0 where none was found."""
    found = np.zeros(len(facets), dtype=np.int64)
    furthest = max(ladder.highest, -ladder.lowest)
    for inner in range(0, furthest, STRIDE):
        open_ = np.flatnonzero(found == 0)
        if open_.size == 0:
            break
        for way in (1, -1):
            outer = min(inner + STRIDE, ladder.highest if way > 0 else -ladder.lowest)
            if outer <= inner:
                continue
            steps = way * _between(ladder, facets[open_], way, inner, outer)
            nearer = (steps != 0) & ((found[open_] == 0) | (np.abs(steps) < np.abs(found[open_])))
            found[open_[nearer]] = steps[nearer]
    return found


def _between(ladder: Ladder, facets: Ints, way: int, inner: int, outer: int) -> Ints:
    """Least steps, one way, of the facets that are reachable after the outer ones; 0 for all others."""
    least = np.zeros(len(facets), dtype=np.int64)
    reached = np.flatnonzero(_reached(ladder, facets, np.full(len(facets), way * outer)))
    low, high = np.full(len(reached), inner), np.full(len(reached), outer)
    while (open_ := np.flatnonzero(high - low > 1)).size:
        middle = (low[open_] + high[open_]) // 2
        better = _reached(ladder, facets[reached[open_]], way * middle)
        high[open_[better]] = middle[better]
        low[open_[~better]] = middle[~better]
    least[reached] = high
    return least
