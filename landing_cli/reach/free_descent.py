"""Facets with free descent control (`descent: free`): the conic solve, its proof, and what is delivered.

Each facet is asked for its least-energy flight at full thrust. A dual bound above 1 proves that there is
none; a flight that converged is flown accurately and measured; whatever is left is asked for the least
thrust level tau, which is at most 1 exactly when the facet is reachable. The time grid biases tau upwards,
so a facet that comes out just above 1 without a proof is asked again on a finer grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.adjacency import mean_edge_m
from landing_cli.body.bvh import SurfaceIndex, build_surface_index
from landing_cli.body.mesh import Mesh, facet_centroids, facet_normals
from landing_cli.reach.certificate import GravityBounds, gravity_bounds, gravity_tube
from landing_cli.reach.delivery import VALUE_COLUMNS, Deliveries, Frame, deliver_many, new_deliveries
from landing_cli.reach.free_batch import Batch
from landing_cli.reach.free_flights import Question, best_flights, flights_near
from landing_cli.reach.free_solve import CERTIFIED, CONVERGED, STALLED
from landing_cli.reach.records import (
    Binding,
    FacetSolutions,
    LandingCase,
    Verdict,
    blank_rows,
    replace_rows,
    take_rows,
)
from landing_cli.reach.scaled_case import ScaledCase, scale_case
from landing_cli.reach.terrain_detour import clear_flights

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

INTERVALS = 40
FINE_INTERVALS = 100
# A thrust level below this on the coarse grid may be below 1 on the fine one (its bias is a few 1e-3).
DOUBTFUL_LEVEL = 1.006

_COST = "performance_index_m2_s3"
_ENERGY, _VIOLATION = VALUE_COLUMNS.index(_COST), VALUE_COLUMNS.index("violation")
_CLEARANCE = VALUE_COLUMNS.index("terrain_clearance_min_m")
# Flights at full thrust in this share of the coarse intervals switch in between: they want the finer grid.
SATURATED_SHARE, FULL_THRUST = 0.75, 0.999
# Shares of the thrust bound that the final stage is given in turn where it exceeded the bound by less.
ARC_SHARES = (1.0 - 4e-5, 1.0 - 3e-4, 1.0 - 3e-3)
# Relative to J, a constraint whose loosening would gain less than this does not bind.
SLIGHT_PRESSURE = 1e-5
# Columns that belong to a flight and stay NaN where there is none.
PATH_COLUMNS = (
    *(name for name in VALUE_COLUMNS if name != "violation"),
    "handover_position_m",
    "handover_velocity_m_s",
    "handover_mass_kg",
    "costates",
)


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What all cases over one asteroid and ellipsoid share."""

    surface: SurfaceIndex
    centroids_m: Floats
    normals: Floats
    mean_edge_m: float
    bounds: GravityBounds


@dataclass(frozen=True, eq=False)
class PreparedCase:
    """A landing case with everything that its facets share, ready for the kernel; it pickles."""

    case: LandingCase
    shared: Surroundings
    coarse: ScaledCase
    fine: ScaledCase
    coarse_tube: Floats
    fine_tube: Floats
    frame: Frame


def survey(case: LandingCase) -> Surroundings:
    """Compute what all cases over the asteroid and ellipsoid of this one share."""
    mesh = case.asteroid.mesh
    return Surroundings(
        build_surface_index(mesh),
        facet_centroids(mesh),
        facet_normals(mesh),
        mean_edge_m(mesh),
        gravity_bounds(case.asteroid, case.ellipsoid_m),
    )


def prepare(case: LandingCase, shared: Surroundings) -> PreparedCase:
    """Scale a case and compute what its facets share."""
    craft = case.spacecraft
    coarse, fine = scale_case(case, INTERVALS), scale_case(case, FINE_INTERVALS)
    frame = Frame(
        mass_kg=craft.mass_kg,
        thrust_max_n=craft.thrust_max_n,
        exhaust_velocity_m_s=craft.exhaust_velocity_m_s,
        descent_s=case.descent_s,
        final_stage_s=case.final_stage_s,
        rotation_rate_rad_s=case.asteroid.rotation_rate_rad_s,
        propellant_kg=math.inf if craft.propellant_kg is None else craft.propellant_kg,
        half_angle_rad=case.glide_slope_half_angle_rad,
        clear_radius_m=shared.mean_edge_m,
    )
    tubes = gravity_tube(coarse, shared.bounds), gravity_tube(fine, shared.bounds)
    return PreparedCase(case, shared, coarse, fine, *tubes, frame)


class Work(NamedTuple):
    """A batch of facets on one time grid: the question, and the answers so far."""

    question: Question
    rows: NDArray[np.void]
    thrust: Floats  # (n, N, 3) scaled


def _new_work(prepared: PreparedCase, scaled: ScaledCase, tube: Floats, facets: Ints) -> Work:
    shared = prepared.shared
    targets, normals = shared.centroids_m[facets] / scaled.length_m, shared.normals[facets]
    arc_bound = shared.bounds.on_arcs_m_s2 / scaled.acceleration_m_s2
    question = Question(scaled._replace(propellant=2.0), targets, normals, False, tube, arc_bound)
    return Work(question, blank_rows(facets), np.zeros((len(facets), len(scaled.mid_cos), 3)))


def _by_energy(prepared: PreparedCase, work: Work, chosen: Ints) -> None:
    """Ask for the least-energy flight: a flight, a proof that there is none, or neither."""
    flights, around = best_flights(_ask(work, chosen, False))
    rows = work.rows
    rows["iterations"][chosen] += flights.iterations
    certified = chosen[flights.status == CERTIFIED]
    rows["verdict"][certified] = Verdict.UNREACHABLE
    rows["proved"][certified] = 1
    rows["binding"][certified] = _stopping(flights.pressure[flights.status == CERTIFIED])
    rows["violation"][certified] = flights.bound[flights.status == CERTIFIED] - 1.0
    # a free flight that dips into the ellipsoid meets the thrust bound: what stops it is the ellipsoid
    rows["binding"][chosen[around]] = Binding.ELLIPSOID
    _deliver(prepared, work, chosen, flights)
    _within_arc_bound(prepared, work, chosen[flights.status == CONVERGED])


def _within_arc_bound(prepared: PreparedCase, work: Work, flown: Ints) -> None:
    """Solve again, with a little less thrust for the final stage, where only its bound is exceeded.

    The bound is imposed at points of the arc with a mass integrated over them; between them the real
    thrust may be larger by a little.
    """
    question = work.question
    for share in ARC_SHARES:
        rows = work.rows[flown]
        excess = rows["peak_thrust_ratio_final"] - 1.0
        only = (rows["verdict"] == Verdict.UNRESOLVED) & (rows["violation"] == excess)
        chosen = flown[only & (excess < 1.0 - share)]
        if len(chosen) == 0:
            continue
        less = question._replace(case=question.case._replace(arc_share=share))
        flights, _ = best_flights(_ask(work._replace(question=less), chosen, False))
        work.rows["iterations"][chosen] += flights.iterations
        _deliver(prepared, work, chosen, flights)


def _by_margin(prepared: PreparedCase, work: Work, chosen: Ints) -> None:
    """Ask for the least thrust level: above 1 the facet is unreachable."""
    if len(chosen) == 0:
        return
    flights, around = best_flights(_ask(work, chosen, True))
    rows = work.rows
    rows["iterations"][chosen] += flights.iterations
    solved = flights.status == CONVERGED
    rows["thrust_margin"][chosen[solved]] = 1.0 - flights.level[solved]
    short = solved & (flights.level > 1.0)
    rows["verdict"][chosen[short]] = Verdict.UNREACHABLE
    rows["proved"][chosen[short]] = flights.bound[short] > 1.0
    rows["violation"][chosen[short]] = flights.level[short] - 1.0
    by_ellipsoid = short & (around | (rows["binding"][chosen] == Binding.ELLIPSOID)) & (flights.bound <= 1.0)
    rows["binding"][chosen[short]] = _stopping(flights.pressure[short])
    rows["binding"][chosen[by_ellipsoid]] = Binding.ELLIPSOID
    flights.status[short] = STALLED
    _deliver(prepared, work, chosen, flights)
    _less_energy(prepared, work, chosen, flights)


def _less_energy(prepared: PreparedCase, work: Work, chosen: Ints, flights: Batch) -> None:
    """Where only the least thrust level led to a flight, ask for the least energy in its neighbourhood."""
    found = np.flatnonzero(flights.status == CONVERGED)
    if len(found) == 0:
        return
    nearby = flights_near(_ask(work, chosen[found], False), flights.position[found])
    work.rows["iterations"][chosen[found]] += nearby.iterations
    _deliver(prepared, work, chosen[found], nearby)


def _ask(work: Work, chosen: Ints, tau_free: bool) -> Question:
    question = work.question
    return question._replace(
        targets=question.targets[chosen], normals=question.normals[chosen], tau_free=tau_free
    )


def _on_coarse_grid(prepared: PreparedCase, facets: Ints) -> Work:
    """Judge facets on the coarse grid: by energy, and by margin what that leaves open."""
    work = _new_work(prepared, prepared.coarse, prepared.coarse_tube, facets)
    _by_energy(prepared, work, np.arange(len(facets)))
    scarce = _within_propellant(prepared, work)
    left_open = work.rows["verdict"] == Verdict.UNRESOLVED
    _by_margin(prepared, work, np.flatnonzero(left_open & ~scarce & ~_through_rock(work.rows)))
    _around_rock(prepared, work)
    return work


def _within_propellant(prepared: PreparedCase, work: Work) -> Flags:
    """Ask again, with the bound, where the least-energy flight burns more propellant than there is.

    Returns where that was asked. No least thrust level tells whether the propellant suffices: where no
    flight within it is found, the facet stays unresolved, and says so.
    """
    rows, unbounded = work.rows, work.question.case
    scarce = (rows["verdict"] == Verdict.UNRESOLVED) & (rows["fuel_kg"] > prepared.frame.propellant_kg)
    chosen = np.flatnonzero(scarce)
    if len(chosen):
        bound = prepared.frame.propellant_kg / prepared.frame.mass_kg
        bounded = work.question._replace(case=unbounded._replace(propellant=bound))
        _by_energy(prepared, work._replace(question=bounded), chosen)
        still = (rows["verdict"] == Verdict.UNRESOLVED) & ~_through_rock(rows)
        rows["binding"][chosen[still[chosen]]] = Binding.PROPELLANT
    return np.asarray(scarce)


def _through_rock(rows: NDArray[np.void]) -> Flags:
    """Rows whose best flight keeps every limit but clearance, where that is required."""
    return np.asarray((rows["verdict"] == Verdict.UNRESOLVED) & (rows["binding"] == Binding.TERRAIN))


def _around_rock(prepared: PreparedCase, work: Work) -> None:
    """Look for another flight where the best one cuts rock.

    Where none is found, the facet is unreachable if a way round is known that needs more than all thrust;
    else it stays unresolved: a search that finds no way proves nothing.
    """
    rows = work.rows
    chosen = np.flatnonzero(_through_rock(rows))
    if len(chosen) == 0 or prepared.case.descent != "free":
        return
    bound = prepared.frame.propellant_kg / prepared.frame.mass_kg
    question = _ask(work, chosen, False)
    question = question._replace(case=question.case._replace(propellant=min(2.0, bound)))
    found = clear_flights(prepared, question, rows["facet"][chosen].astype(np.int64))
    rows["iterations"][chosen] += found.flights.iterations
    _deliver(prepared, work, chosen, found.flights)
    rows["thrust_margin"][chosen] = 1.0 - found.level
    short = (rows["verdict"][chosen] == Verdict.UNRESOLVED) & (found.level > 1.0)
    rows["verdict"][chosen[short]] = Verdict.UNREACHABLE
    rows["binding"][chosen[short]] = Binding.TERRAIN
    rows["violation"][chosen[short]] = found.level[short] - 1.0


def _on_fine_grid(prepared: PreparedCase, facets: Ints) -> Work:
    """Judge doubtful facets on the fine grid: by margin first, then the best flight where there is one."""
    work = _new_work(prepared, prepared.fine, prepared.fine_tube, facets)
    everything = np.arange(len(facets))
    _by_margin(prepared, work, everything)
    _by_energy(prepared, work, everything[work.rows["verdict"] != Verdict.UNREACHABLE])
    _within_propellant(prepared, work)
    _around_rock(prepared, work)
    return work


def _deliver(prepared: PreparedCase, work: Work, chosen: Ints, flights: Batch) -> None:
    """Fly the converged flights accurately and fill their rows; reachable is what meets every limit."""
    found = np.flatnonzero(flights.status == CONVERGED)
    rows, scaled = work.rows, work.question.case
    if len(found) == 0:
        return
    facets = rows["facet"][chosen[found]]
    out = new_deliveries(len(found))
    deliver_many(
        scaled,
        prepared.frame,
        prepared.shared.surface,
        flights.thrust[found],
        prepared.shared.centroids_m[facets],
        prepared.shared.normals[facets],
        out,
    )
    excess = out.values[:, _VIOLATION]
    depth = np.maximum(-out.values[:, _CLEARANCE], 0.0) / scaled.length_m
    cuts = (excess == 0.0) & (depth > 0.0) & (prepared.case.terrain == "require")
    excess[cuts] = depth[cuts]
    # only a flight that keeps every limit, at less cost, takes the place of one that keeps them all
    better = (out.values[:, _VIOLATION] == 0.0) & (out.values[:, _ENERGY] < rows[_COST][chosen[found]])
    better |= rows["verdict"][chosen[found]] != Verdict.REACHABLE
    found, cuts, out = found[better], cuts[better], Deliveries(out.values[better], out.handover[better])
    places = chosen[found]
    work.thrust[places] = flights.thrust[found]
    for column, name in enumerate(VALUE_COLUMNS):
        rows[name][places] = out.values[:, column]
    rows["handover_position_m"][places] = out.handover[:, :3]
    rows["handover_velocity_m_s"][places] = out.handover[:, 3:6]
    rows["handover_mass_kg"][places] = out.handover[:, 6]
    rows["costates"][places] = flights.costates[found]
    rows["binding"][places] = _binding(flights.pressure[found], flights.energy[found])
    met = rows["violation"][places] == 0.0
    rows["verdict"][places[met]] = Verdict.REACHABLE
    rows["binding"][places[cuts]] = Binding.TERRAIN


def _binding(pressure: Floats, energy: Floats) -> Ints:
    """The constraint with the largest pressure, or none where all are slight."""
    strongest = np.argmax(pressure, axis=1)
    largest = np.take_along_axis(pressure, strongest[:, None], 1)[:, 0]
    return np.where(largest <= SLIGHT_PRESSURE * energy, int(Binding.NONE), strongest + 1)


def _stopping(pressure: Floats) -> Ints:
    """What stops flights that the ellipsoid does not: the glide slope where it weighs more than the thrust.

    By its pressure, widening the slope by some share then gains more than as large a share of thrust.
    """
    by_slope = pressure[:, Binding.GLIDE_SLOPE - 1] > pressure[:, Binding.THRUST - 1]
    return np.where(by_slope, int(Binding.GLIDE_SLOPE), int(Binding.THRUST))


def _solutions(prepared: PreparedCase, work: Work) -> FacetSolutions:
    """Keep flights of reachable facets only: elsewhere the path's columns are NaN."""
    rows = work.rows
    reachable = rows["verdict"] == Verdict.REACHABLE
    for name in PATH_COLUMNS:
        rows[name][~reachable] = np.nan
    rows["thrust_nodes"] = np.where(reachable, work.thrust.shape[1], 0)
    nodes = work.thrust[reachable].reshape(-1, 3) * prepared.frame.thrust_max_n
    return FacetSolutions(rows, nodes)


def _doubtful(rows: NDArray[np.void]) -> Ints:
    """Rows that a finer time grid may decide otherwise."""
    near = (rows["verdict"] == Verdict.UNREACHABLE) & (rows["proved"] == 0)
    near &= rows["violation"] < DOUBTFUL_LEVEL - 1.0
    open_ = (rows["verdict"] == Verdict.UNRESOLVED) & (rows["binding"] != Binding.PROPELLANT)
    open_ &= ~_through_rock(rows)
    return np.flatnonzero(near | open_)


def solve_prepared(prepared: PreparedCase, facets: NDArray[np.integer]) -> FacetSolutions:
    """Solve some facets of a prepared case.

    Parameters
    ----------
    prepared : PreparedCase
        From :func:`prepare`.
    facets : (n,) int
        Facets, 0-based.

    Returns
    -------
    solutions : FacetSolutions
        One row a facet, in the order given.
    """
    indices = np.asarray(facets, dtype=np.int64)
    coarse = _on_coarse_grid(prepared, indices)
    solutions = _solutions(prepared, coarse)
    again = _doubtful(coarse.rows)
    if len(again):
        finer = _solutions(prepared, _on_fine_grid(prepared, indices[again]))
        resolved = np.flatnonzero(finer.rows["verdict"] != Verdict.UNRESOLVED)
        solutions = replace_rows(solutions, again[resolved], take_rows(finer, resolved))
    again = _saturated(coarse)
    if len(again):
        work = _new_work(prepared, prepared.fine, prepared.fine_tube, indices[again])
        _by_energy(prepared, work, np.arange(len(again)))
        finer = _solutions(prepared, work)
        better = np.flatnonzero(finer.rows[_COST] < solutions.rows[_COST][again])
        solutions = replace_rows(solutions, again[better], take_rows(finer, better))
    return solutions


def screen(prepared: PreparedCase, facets: NDArray[np.integer]) -> FacetSolutions:
    """Look for least-energy flights on the coarse grid alone; what is not found so is left unresolved.

    Parameters
    ----------
    prepared : PreparedCase
        From :func:`prepare`.
    facets : (n,) int
        Facets, 0-based.

    Returns
    -------
    solutions : FacetSolutions
        One row a facet, in the order given; its flights keep every limit.
    """
    work = _new_work(prepared, prepared.coarse, prepared.coarse_tube, np.asarray(facets, dtype=np.int64))
    _by_energy(prepared, work, np.arange(len(facets)))
    _within_propellant(prepared, work)
    return _solutions(prepared, work)


def _saturated(work: Work) -> Ints:
    """Rows of flights at full thrust most of the time."""
    full = np.linalg.norm(work.thrust, axis=2) > FULL_THRUST
    reachable = work.rows["verdict"] == Verdict.REACHABLE
    return np.flatnonzero(reachable & (full.mean(axis=1) >= SATURATED_SHARE))


def solve_facets(case: LandingCase, facets: NDArray[np.integer]) -> FacetSolutions:
    """Solve some facets of a case (it surveys and prepares the case each time)."""
    return solve_prepared(prepare(case, survey(case)), facets)


def solve_verdicts(prepared: PreparedCase, facets: NDArray[np.integer]) -> NDArray[np.uint8]:
    """Find the verdicts of :func:`solve_prepared`, and nothing else, in two thirds of the time.

    The same steps decide; left out is what cannot change a verdict: the finer flights to facets that a
    flight reaches already, and rock along a path where it is only reported.

    Parameters
    ----------
    prepared : PreparedCase
        From :func:`prepare`.
    facets : (n,) int
        Facets, 0-based.

    Returns
    -------
    (n,) uint8
        Values of Verdict, in the order given.
    """
    indices = np.asarray(facets, dtype=np.int64)
    if prepared.case.terrain == "require":  # then rock decides, and each better flight may meet some
        return np.asarray(solve_prepared(prepared, indices).rows["verdict"])
    blind = _without_terrain(prepared)
    rows = _on_coarse_grid(blind, indices).rows
    verdicts = rows["verdict"].copy()
    again = _doubtful(rows)
    if len(again):
        finer = _on_fine_grid(blind, indices[again]).rows["verdict"]
        resolved = finer != Verdict.UNRESOLVED
        verdicts[again[resolved]] = finer[resolved]
    return np.asarray(verdicts)


def _without_terrain(prepared: PreparedCase) -> PreparedCase:
    """The same case over a surface so far away that no path needs a second look at it."""
    shared = replace(prepared.shared, surface=_far_surface())
    return replace(prepared, shared=shared, frame=prepared.frame._replace(clear_radius_m=math.inf))


@cache
def _far_surface() -> SurfaceIndex:
    corners = 1e9 * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    return build_surface_index(Mesh(corners + 1e12, faces))
