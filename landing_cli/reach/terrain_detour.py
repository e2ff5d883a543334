"""Another flight where the best one cuts rock (`terrain: require`).

Walls are put up below the points of a flight that come near the surface, and the conic problem between them
is solved; the walls then follow what is found, until the delivered flight clears the surface and its energy
has settled. Each way out of the rock leads to a flight of its own: the cheapest is taken. A search between
walls is local: that it finds nothing proves nothing. Where no flight at full thrust is found, the least
thrust level that a way needs is asked for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.delivery import CLEARANCE_SPACING, VALUE_COLUMNS, deliver_many, new_deliveries
from landing_cli.reach.free_batch import Batch, new_batch
from landing_cli.reach.free_flights import FLOOR, SAG, Question, best_flights, flights_between
from landing_cli.reach.free_solve import CONVERGED, STALLED
from landing_cli.reach.terrain_walls import Terrain, Way, look_below, walls_along

if TYPE_CHECKING:
    from landing_cli.reach.free_descent import PreparedCase

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

# How often walls follow a flight, at most, and when its energy or thrust level counts as settled.
ROUNDS, SETTLED = 12, 2e-4
# Mean edges that a flight keeps off the surface beyond one of them from its touchdown: clearance is looked at
# in steps, and half of one is what may be missed in between.
KEPT = 0.5 * CLEARANCE_SPACING
# Walls stand below points that are so near to the surface (mean edges). A flight that falls short of KEPT
# between its points, by less than SHALLOW, has them raised by so many times the shortfall.
NEAR, BOLDNESS, SHALLOW = 1.0, 1.5, 0.2
ROOM = 0.1  # that walls stand higher than KEPT at first, so that bends between points seldom fall short
# Shares of the thrust bound that the final stage is given in turn, as `free_descent` does.
ARC_SHARES = (1.0 - 4e-5, 1.0 - 3e-3)

_COST, _VIOLATION = VALUE_COLUMNS.index("performance_index_m2_s3"), VALUE_COLUMNS.index("violation")
_CLEARANCE = VALUE_COLUMNS.index("terrain_clearance_min_m")
_ELLIPSOID = VALUE_COLUMNS.index("ellipsoid_margin")


class Detours(NamedTuple):
    """What was found for each facet of a batch."""

    flights: Batch  # CONVERGED where a flight at full thrust clears the surface
    level: Floats  # (n,) least thrust level of a flight that clears it, where only that was found; else NaN


class _Asked(NamedTuple):
    """A batch of facets, and what their flights keep clear of."""

    prepared: PreparedCase
    terrain: Terrain
    question: Question
    facets: Ints


class _Path(NamedTuple):
    """Where the flights of a batch have come to, and how high their planes stand."""

    position: Floats  # (n, N + 1, 3) at the nodes of the descent, scaled, solver axes
    handover: Floats  # (n, 7) see Deliveries
    margin_m: Floats  # (n,) off the surface
    level: Floats  # (n,) |xi| off the ellipsoid


class _Found(NamedTuple):
    """The best clear flight of each facet, and where the others ended."""

    flights: Batch
    handover: Floats  # (n, 7)
    value: Floats  # (n,) J (m2/s3), or the thrust level; infinite where none was found
    nearly: Flags  # (n,) a clear flight broke another limit, by little


def clear_flights(prepared: PreparedCase, question: Question, facets: Ints) -> Detours:
    """Look for flights that clear the surface.

    Parameters
    ----------
    prepared : PreparedCase
        The case.
    question : Question
        The facets, asked for the least energy.
    facets : (n,) int
        The same facets, 0-based.

    Returns
    -------
    Detours
        The best that was found for each.
    """
    shared = prepared.shared
    terrain = Terrain(
        shared.surface,
        prepared.case.asteroid.mesh.corners,
        shared.centroids_m,
        shared.normals,
        shared.mean_edge_m,
    )
    asked = _Asked(prepared, terrain, question, facets)
    start = _start(asked)
    found = _by_energy(asked, start)
    level = np.full(len(facets), np.nan)
    without = np.flatnonzero(np.isinf(found.value))
    if len(without):
        rest = _part(asked, without)
        least = _by_level(rest, _rows(start, without))
        enough = np.flatnonzero(least.value <= 1.0)
        level[without] = np.where(least.value > 1.0, least.value, np.nan)
        level[np.isinf(level)] = np.nan
        found.flights.iterations[without] += least.flights.iterations
        _keep(found, without[enough], least, enough)
        near = _follow(_part(rest, enough), _rows(least, enough), Way.CLOSEST)
        found.flights.iterations[without[enough]] += near.flights.iterations
        cheaper = np.flatnonzero(np.isfinite(near.value))
        _keep(found, without[enough[cheaper]], near, cheaper)
    return Detours(found.flights, level)


def _start(asked: _Asked) -> _Found:
    """Return the best flights through rock: by energy, or by thrust level where that has none."""
    question, n = asked.question, len(asked.facets)
    flights, _ = best_flights(question)
    none = np.flatnonzero(flights.status != CONVERGED)
    if len(none):
        least, _ = best_flights(_part(asked, none).question._replace(tau_free=True))
        _copy(flights, none, least, np.arange(len(none)))
    handover = np.full((n, 7), np.nan)
    flown = np.flatnonzero(flights.status == CONVERGED)
    handover[flown] = _deliver(_part(asked, flown), flights.thrust[flown])[1]
    return _Found(flights, handover, np.full(n, np.inf), np.zeros(n, dtype=np.bool_))


def _by_energy(asked: _Asked, start: _Found) -> _Found:
    """Try every way, and again with less thrust for the final arc where only its bound was exceeded."""
    best = _blank(asked)
    todo = np.arange(len(asked.facets))
    for share in ARC_SHARES:
        question = asked.question
        less = asked._replace(question=question._replace(case=question.case._replace(arc_share=share)))
        _try(best, less, start, todo)
        todo = np.flatnonzero(np.isinf(best.value) & best.nearly)
        if len(todo) == 0:
            break
    return best


def _by_level(asked: _Asked, start: _Found) -> _Found:
    """Ask every way for the least thrust level."""
    case = asked.question.case._replace(propellant=2.0)  # more than there is: unbounded
    asked = asked._replace(question=asked.question._replace(case=case, tau_free=True))
    best = _blank(asked)
    _try(best, asked, start, np.arange(len(asked.facets)))
    return best


def _try(best: _Found, asked: _Asked, start: _Found, places: Ints) -> None:
    """Try every way for some facets, and keep what is better than the best so far.

    None can be spared: past a boulder the wrong side costs up to 18 % more.
    """
    part, begun = _part(asked, places), _rows(start, places)
    for way in Way:
        found = _follow(part, begun, way)
        best.flights.iterations[places] += found.flights.iterations
        best.nearly[places] |= found.nearly
        better = np.flatnonzero(found.value < best.value[places])
        _keep(best, places[better], found, better)


def _follow(asked: _Asked, start: _Found, way: Way) -> _Found:
    """Let walls follow the flights, along one way out of the rock."""
    best, path = _blank(asked), _path(asked, start)
    active = np.flatnonzero(np.isfinite(start.handover).all(axis=1))
    for _ in range(ROUNDS):
        if len(active) == 0:
            break
        flights, values = _fly_between_walls(asked, path, active, way)
        best.flights.iterations[active] += flights.iterations
        solved = np.flatnonzero(flights.status == CONVERGED)
        active, values = active[solved], values[solved]
        value = flights.level[solved] if asked.question.tau_free else values[:, _COST]
        clear = values[:, _CLEARANCE] >= KEPT * asked.terrain.mean_edge_m
        kept = values[:, _VIOLATION] == 0.0
        best.nearly[active] |= clear & ~kept & (values[:, _VIOLATION] < 1.0 - ARC_SHARES[-1])
        good = clear & (kept | asked.question.tau_free)
        better, before = good & (value < best.value[active]), best.value[active]
        places = active[better]
        _copy(best.flights, places, flights, solved[better])
        best.handover[places], best.value[places] = path.handover[places], value[better]
        active = active[~good | (value < before * (1.0 - SETTLED))]
    return best


def _fly_between_walls(asked: _Asked, path: _Path, active: Ints, way: Way) -> tuple[Batch, Floats]:
    """Put walls up along some paths, solve between them, and move the paths to what was found.

    Returns the flights, and what was measured of those that converged (VALUE_COLUMNS).
    """
    part, terrain, case = _part(asked, active), asked.terrain, asked.question.case
    edge_m, position = terrain.mean_edge_m, path.position[active]
    flown = look_below(
        terrain, case, part.facets, position, path.handover[active], asked.prepared.case.final_stage_s
    )
    walls = walls_along(terrain, case, flown, way, NEAR * edge_m, path.margin_m[active])
    flights = flights_between(part.question, position, path.level[active], walls)
    solved = flights.status == CONVERGED
    values, places = np.full((len(active), len(VALUE_COLUMNS)), np.nan), active[solved]
    values[solved], path.handover[places] = _deliver(_part(asked, places), flights.thrust[solved])
    path.position[places] = flights.position[solved]
    short_m = np.maximum(KEPT * edge_m - values[solved, _CLEARANCE], 0.0)
    path.margin_m[places] += BOLDNESS * np.where(short_m < SHALLOW * edge_m, short_m, 0.0)
    lowest = np.sqrt(np.maximum(1.0 + values[solved, _ELLIPSOID], 0.0))
    path.level[places] += BOLDNESS * np.maximum(FLOOR - lowest, 0.0)
    return flights, values


def _deliver(asked: _Asked, thrust: Floats) -> tuple[Floats, Floats]:
    """Fly the thrusts of all facets accurately: what is measured (VALUE_COLUMNS), and the handovers."""
    out, terrain = new_deliveries(len(asked.facets)), asked.terrain
    deliver_many(
        asked.question.case,
        asked.prepared.frame,
        terrain.surface,
        thrust,
        terrain.centroids_m[asked.facets],
        terrain.normals[asked.facets],
        out,
    )
    return out.values, out.handover


def _path(asked: _Asked, start: _Found) -> _Path:
    """Begin at given flights, with walls and tangent planes as low as they may be."""
    n, intervals = len(asked.facets), len(asked.question.case.mid_cos)
    margin_m = np.full(n, (1.0 + ROOM) * KEPT * asked.terrain.mean_edge_m)
    level = np.full(n, 1.0 + SAG / intervals**2)
    return _Path(start.flights.position.copy(), start.handover.copy(), margin_m, level)


def _part(asked: _Asked, places: Ints) -> _Asked:
    """Ask the same of some of the facets."""
    question = asked.question
    chosen = question._replace(targets=question.targets[places], normals=question.normals[places])
    return asked._replace(question=chosen, facets=asked.facets[places])


def _blank(asked: _Asked) -> _Found:
    """Nothing found yet."""
    n, intervals = len(asked.facets), len(asked.question.case.mid_cos)
    flights = new_batch(n, intervals)
    flights.status[:] = STALLED
    return _Found(flights, np.full((n, 7), np.nan), np.full(n, np.inf), np.zeros(n, dtype=np.bool_))


def _rows(found: _Found, places: Ints) -> _Found:
    """Some rows of what was found."""
    flights = Batch._make(field[places] for field in found.flights)
    return _Found(flights, found.handover[places], found.value[places], found.nearly[places])


def _keep(best: _Found, places: Ints, found: _Found, rows: Ints) -> None:
    """Take over some rows."""
    _copy(best.flights, places, found.flights, rows)
    best.handover[places], best.value[places] = found.handover[rows], found.value[rows]


def _copy(into: Batch, places: Ints, source: Batch, rows: Ints) -> None:
    """Copy rows of one batch into places of another; iterations add up elsewhere."""
    for name, field in source._asdict().items():
        if name != "iterations":
            getattr(into, name)[places] = field[rows]
