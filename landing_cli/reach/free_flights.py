"""The best flight to each facet of a batch: free, or around the keep-out ellipsoid on either side."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.ellipsoid_arcs import (
    UNDECIDED,
    arc_cuts_many,
    freeze_many,
    lowest_levels,
    lowest_levels_between,
)
from landing_cli.reach.free_batch import Batch, CutBatch, WallBatch, new_batch, no_cuts, no_walls, solve_many
from landing_cli.reach.free_solve import CONVERGED, STALLED, own_solver
from landing_cli.reach.scaled_case import ScaledCase

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

NEVER = 1 << 30
FREE_LIMIT, CUT_LIMIT = 40, 36
RETAKE_FROM = 5
ENERGY_ONLY, MARGIN_WEIGHT = 1.0, 1e-3
TOUCH = 1.0 - 1e-6
# Nodes of a given path that lie below this are held above the ellipsoid; how often the planes follow.
NEAR, FOLLOWED = 1.2, 3
# Tangent planes keep |xi| at 1 + SAG / N^2 at first: that is what paths between N nodes sag below them. Where
# one still dips between two nodes below FLOOR, its planes are raised by so many times the shortfall and the
# facet is solved again, ever more boldly. FLOOR leaves room for what a parabola through three samples misses.
SAG, FLOOR, RAISES = 0.64, 1.0 + 1.2e-5, (1.2, 1.2, 1.2, 1.5, 2.0, 3.0, 5.0)


class Question(NamedTuple):
    """What is asked of a batch of facets."""

    case: ScaledCase
    targets: Floats  # (n, 3) scaled
    normals: Floats  # (n, 3)
    tau_free: bool  # least thrust level instead of least J
    tube: Floats
    arc_bound: float


def best_flights(question: Question) -> tuple[Batch, Flags]:
    """Find the best flight to every facet of a batch.

    Parameters
    ----------
    question : Question
        Case, facets and objective.

    Returns
    -------
    flights : Batch
        CONVERGED where a flight was found; else how the solve ended.
    around : (n,) bool
        Whether the free flight dips into the ellipsoid, so that the answer leads around it.
    """
    n, intervals = len(question.targets), len(question.case.mid_cos)
    best = _solve(question, no_cuts(n, intervals), _cut_levels(question), NEVER, FREE_LIMIT)
    lowest = np.empty(n)
    lowest_levels(question.case, best.position, lowest)
    around = (best.status == CONVERGED) & (lowest < TOUCH)
    todo = np.flatnonzero(around)
    if len(todo) == 0:
        return best, around
    free_position = best.position[todo].copy()
    best.status[todo] = STALLED
    value = np.full(n, np.inf)
    second = np.ones(len(todo), dtype=bool)
    for side in (1.0, -1.0):
        chosen = todo[second]
        if len(chosen) == 0:
            break
        flights, froze = _around(_subset(question, chosen), free_position[second], side)
        best.iterations[chosen] += flights.iterations
        found = flights.level if question.tau_free else flights.energy
        better = (flights.status == CONVERGED) & (found < value[chosen])
        value[chosen[better]] = found[better]
        _take(best, chosen[better], flights, np.flatnonzero(better))
        # the other side is worth a look where this one was a close call or a struggle
        second[second] = froze
        second |= lowest[todo] < UNDECIDED
    return best, around


def flights_near(question: Question, position: Floats) -> Batch:
    """Find the best flights in the neighbourhood of given paths that stay outside the ellipsoid.

    Planes that touch the ellipsoid below a path's nodes hold for the path itself, so it is a flight of the
    convex problem that they make; the planes then follow what is found.

    Parameters
    ----------
    question : Question
        Case, facets and objective.
    position : (n, N + 1, 3) float
        Nodes of the paths, solver axes.

    Returns
    -------
    flights : Batch
        CONVERGED where a flight was found.
    """
    n, intervals = len(question.targets), len(question.case.mid_cos)
    flights, cuts, level = new_batch(n, intervals), no_cuts(n, intervals), _cut_levels(question)
    flights.position[:] = position
    for _ in range(FOLLOWED):
        _solve_again(question, flights, cuts, np.full(n, NEAR), level, np.arange(n))
    _raise_over_dips(question, flights, cuts, level)
    return flights


def _around(question: Question, free_position: Floats, side: float) -> tuple[Batch, Flags]:
    """Solve a batch with tangent planes that follow the path, then frozen, then raised over dips."""
    case = question.case
    n, intervals = len(question.targets), len(case.mid_cos)
    cuts = no_cuts(n, intervals)
    arc_cuts_many(case, free_position, side, cuts)
    level = _cut_levels(question)
    flights = _solve(question, cuts, level, RETAKE_FROM, CUT_LIMIT)
    froze = flights.status == STALLED
    _solve_again(question, flights, cuts, np.full(n, TOUCH), level, np.flatnonzero(froze))
    _raise_over_dips(question, flights, cuts, level)
    return flights, froze


def _cut_levels(question: Question) -> Floats:
    return np.full(len(question.targets), 1.0 + SAG / len(question.case.mid_cos) ** 2)


def _raise_over_dips(question: Question, flights: Batch, cuts: CutBatch, level: Floats) -> None:
    """Solve again, with planes raised, where a path dips below FLOOR between two nodes.

    A flight whose raised problem stalls keeps its place; its planes are raised further.
    """
    chosen = np.flatnonzero(flights.status == CONVERGED)
    short = _shortfalls(question.case, flights, chosen)
    for boldness in RAISES:
        chosen, short = chosen[short > 0.0], short[short > 0.0]
        if len(chosen) == 0:
            break
        level[chosen] += boldness * short
        solved = _solve_again(question, flights, cuts, level, level, chosen)
        short[solved] = _shortfalls(question.case, flights, chosen[solved])


def _shortfalls(case: ScaledCase, flights: Batch, chosen: Ints) -> Floats:
    """How far each path's dip lies below FLOOR."""
    lowest = np.empty(len(chosen))
    lowest_levels_between(case, flights.thrust[chosen], lowest)
    return np.asarray(FLOOR - lowest)


def _solve_again(
    question: Question, flights: Batch, cuts: CutBatch, touch: Floats, level: Floats, chosen: Ints
) -> Flags:
    """Solve chosen facets again with planes frozen on their paths; update flights and cuts that converged.

    Returns whether each converged.
    """
    if len(chosen) == 0:
        return np.zeros(0, dtype=np.bool_)
    part = CutBatch(cuts.planes[chosen], cuts.node[chosen], cuts.normal[chosen])
    freeze_many(question.case, flights.position[chosen], touch[chosen], part)
    again = _solve(_subset(question, chosen), part, level[chosen], NEVER, CUT_LIMIT)
    flights.iterations[chosen] += again.iterations
    solved = again.status == CONVERGED
    _take(flights, chosen[solved], again, np.flatnonzero(solved))
    for whole, piece in zip(cuts, part, strict=True):
        whole[chosen[solved]] = piece[solved]
    return np.asarray(solved)


def flights_between(question: Question, position: Floats, level: Floats, walls: WallBatch) -> Batch:
    """Find the best flights between walls, in the neighbourhood of given paths about the ellipsoid.

    Parameters
    ----------
    question : Question
        Case, facets and objective.
    position : (n, N + 1, 3) float
        Nodes of the paths, solver axes: planes touch the ellipsoid below them.
    level : (n,) float
        |xi| that these planes keep.
    walls : WallBatch
        Planes off the terrain.

    Returns
    -------
    flights : Batch
        CONVERGED where a flight was found.
    """
    cuts = no_cuts(len(question.targets), len(question.case.mid_cos))
    freeze_many(question.case, position, np.full(len(position), NEAR), cuts)
    return _solve(question, cuts, level, NEVER, CUT_LIMIT, walls)


def _solve(
    question: Question,
    cuts: CutBatch,
    level: Floats,
    retake_from: int,
    limit: int,
    walls: WallBatch | None = None,
) -> Batch:
    """Run the kernel on a whole batch."""
    if len(question.targets) == 0:
        return new_batch(0, len(question.case.mid_cos))
    walls = no_walls(len(question.targets)) if walls is None else walls
    out = new_batch(len(question.targets), len(question.case.mid_cos))
    solve_many(
        question.case,
        question.targets,
        question.normals,
        cuts,
        level,
        walls,
        MARGIN_WEIGHT if question.tau_free else ENERGY_ONLY,
        question.tau_free,
        retake_from,
        limit,
        question.tube,
        question.arc_bound,
        False,
        own_solver(question.case, walls.node.shape[1]),
        out,
    )
    return out


def _subset(question: Question, chosen: Ints) -> Question:
    return question._replace(targets=question.targets[chosen], normals=question.normals[chosen])


def _take(into: Batch, places: Ints, source: Batch, rows: Ints) -> None:
    """Copy rows of one batch into places of another; iterations and free bounds stay."""
    for name in ("status", "energy", "level", "thrust", "position", "costates", "pressure"):
        getattr(into, name)[places] = getattr(source, name)[rows]
