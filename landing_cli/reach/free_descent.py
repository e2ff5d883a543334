"""Facets with free descent control (`descent: free`): the conic solve, its proof, and what is delivered.

Each facet is asked for its least-energy flight at full thrust. A dual bound above 1 proves that there is
none; a flight that converged is flown accurately and measured; whatever is left is asked for the least
thrust level tau, which is at most 1 exactly when the facet is reachable. The time grid biases tau upwards,
so a facet that comes out just above 1 without a proof is asked again on a finer grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from landing_cli.body.adjacency import mean_edge_m
from landing_cli.body.bvh import SurfaceIndex, build_surface_index
from landing_cli.body.mesh import facet_centroids, facet_normals
from landing_cli.reach.certificate import arc_gravity, gravity_tube
from landing_cli.reach.delivery import LIMIT_TOLERANCE, SUBSTEPS, Frame, deliver
from landing_cli.reach.final_stage import ARC_SAMPLES
from landing_cli.reach.free_facet import best_flight
from landing_cli.reach.free_solve import CERTIFIED, CONVERGED, new_solver
from landing_cli.reach.records import Binding, FacetSolutions, LandingCase, Verdict, blank_rows
from landing_cli.reach.scaled_case import ScaledCase, scale_case

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

INTERVALS = 40
FINE_INTERVALS = 160
# A thrust level below this on the coarse grid may be below 1 on the fine one (its bias is a few 1e-3).
DOUBTFUL_LEVEL = 1.02

_UNRESOLVED, _REACHABLE, _UNREACHABLE = (int(v) for v in Verdict)
_THRUST, _ELLIPSOID, _TERRAIN = int(Binding.THRUST), int(Binding.ELLIPSOID), int(Binding.TERRAIN)
_NONE = int(Binding.NONE)
SLIGHT_PRESSURE = 1e-5


@dataclass(frozen=True, eq=False)
class PreparedCase:
    """A landing case with everything that its facets share, ready for the kernel; it pickles."""

    case: LandingCase
    coarse: ScaledCase
    fine: ScaledCase
    coarse_tube: Floats
    fine_tube: Floats
    arc_bound: float
    frame: Frame
    surface: SurfaceIndex
    centroids_m: Floats
    normals: Floats


class Measures(NamedTuple):
    """Answers of a batch of facets, by column; see records.FACET_COLUMNS."""

    verdict: Ints
    proved: Ints
    binding: Ints
    iterations: Ints
    values: Floats  # (n, 11) in the order of VALUE_COLUMNS
    handover: Floats  # (n, 7) position, velocity, mass
    costates: Floats  # (n, 7)
    thrust: Floats  # (n, N, 3) scaled


VALUE_COLUMNS = (
    "performance_index_m2_s3",
    "delta_v_m_s",
    "fuel_kg",
    "peak_thrust_ratio",
    "peak_thrust_ratio_descent",
    "peak_thrust_ratio_final",
    "ellipsoid_margin",
    "glide_slope_margin_deg",
    "terrain_clearance_min_m",
    "violation",
    "thrust_margin",
)
_VIOLATION, _THRUST_MARGIN = VALUE_COLUMNS.index("violation"), VALUE_COLUMNS.index("thrust_margin")


def prepare(case: LandingCase) -> PreparedCase:
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
        clear_radius_m=mean_edge_m(case.asteroid.mesh),
    )
    return PreparedCase(
        case,
        coarse,
        fine,
        gravity_tube(case, coarse),
        gravity_tube(case, fine),
        arc_gravity(case, coarse),
        frame,
        build_surface_index(case.asteroid.mesh),
        facet_centroids(case.asteroid.mesh),
        facet_normals(case.asteroid.mesh),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _strongest(pressure, energy):
    """The constraint with the largest pressure, or none where all are slight."""
    binding, largest = _NONE, SLIGHT_PRESSURE * energy
    for i in range(pressure.shape[0]):
        if pressure[i] > largest:
            binding, largest = i + 1, pressure[i]
    return binding


@njit(cache=True, nogil=True, error_model="numpy")
def _record(i, case, frame, surface, solver, energy, target_m, normal, must_clear, scratch, out):
    """Deliver the solver's answer for row i; return whether it meets every limit."""
    samples, path_m, handover = scratch
    d = deliver(case, frame, surface, solver.answer.thrust, target_m, normal, samples, path_m, handover)
    v = out.values[i]
    v[0], v[1], v[2] = d.performance_index_m2_s3, d.delta_v_m_s, d.fuel_kg
    v[3], v[4], v[5] = max(d.peak_descent, d.peak_final), d.peak_descent, d.peak_final
    v[6], v[7], v[8] = d.ellipsoid_margin, math.degrees(d.glide_slope_margin_rad), d.terrain_clearance_m
    violation = 0.0 if d.violation <= LIMIT_TOLERANCE else d.violation
    out.binding[i] = _strongest(solver.answer.pressure, energy)
    if must_clear and d.terrain_clearance_m < 0.0:
        violation = max(violation, -d.terrain_clearance_m / case.length_m)
        out.binding[i] = _TERRAIN
    v[_VIOLATION] = violation
    out.handover[i, :6] = handover
    out.handover[i, 6] = d.handover_mass_kg
    out.costates[i] = solver.answer.costates
    out.thrust[i] = solver.answer.thrust
    return violation == 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _judge_by_margin(i, case, frame, surface, solver, bounds, target, geometry, must_clear, scratch, out):
    """Row i by its least thrust level, where the least-energy solve gave neither flight nor proof."""
    target_m, normal = geometry
    found = best_flight(case, target, normal, True, bounds[0], bounds[1], solver)
    out.iterations[i] += found.iterations
    if found.status != CONVERGED:
        return
    out.values[i, _THRUST_MARGIN] = 1.0 - found.level
    if found.level > 1.0:
        out.verdict[i] = _UNREACHABLE
        out.proved[i] = 1 if found.bound > 1.0 else 0
        out.values[i, _VIOLATION] = found.level - 1.0
        out.binding[i] = _ELLIPSOID if found.cuts > 0 else _THRUST
    elif _record(i, case, frame, surface, solver, 1.0, target_m, normal, must_clear, scratch, out):
        out.verdict[i] = _REACHABLE


@njit(cache=True, nogil=True, error_model="numpy")
def judge_facets(case, frame, surface, tube, arc_bound, targets_m, normals, must_clear, out):
    """Verdicts and flights of a batch of facets, filled into ``out``.

    Parameters
    ----------
    case, frame, surface : ScaledCase, Frame, SurfaceIndex
        The case and the asteroid's surface.
    tube, arc_bound : (N,) float, float
        Bounds of gravity for the certificate.
    targets_m, normals : (n, 3) float
        Facet centroids (m) and outward unit normals, body axes.
    must_clear : bool
        Whether a path that cuts the mesh is refused.
    out : Measures
        Filled; float values are NaN on entry.
    """
    n = case.mid_cos.shape[0]
    solver = new_solver(case)
    steps = n * SUBSTEPS + 1
    scratch = (np.empty((steps, 7)), np.empty((steps + ARC_SAMPLES, 3)), np.empty(6))
    for i in range(targets_m.shape[0]):
        target, normal = targets_m[i] / case.length_m, normals[i]
        found = best_flight(case, target, normal, False, tube, arc_bound, solver)
        out.iterations[i] = found.iterations
        if found.status == CERTIFIED:
            out.verdict[i], out.proved[i], out.binding[i] = _UNREACHABLE, 1, _THRUST
            out.values[i, _VIOLATION] = found.bound - 1.0
            continue
        if found.status == CONVERGED:
            if _record(
                i, case, frame, surface, solver, found.energy, targets_m[i], normal, must_clear, scratch, out
            ):
                out.verdict[i] = _REACHABLE
                continue
            if out.binding[i] == _TERRAIN:
                out.verdict[i] = _UNREACHABLE
                continue
        geometry = (targets_m[i], normal)
        bounds = (tube, arc_bound)
        _judge_by_margin(i, case, frame, surface, solver, bounds, target, geometry, must_clear, scratch, out)


def _judge(prepared: PreparedCase, scaled: ScaledCase, tube: Floats, facets: Ints) -> Measures:
    """Run the kernel on some facets on one time grid."""
    n = len(facets)
    out = Measures(
        np.zeros(n, dtype=np.int64),
        np.zeros(n, dtype=np.int64),
        np.zeros(n, dtype=np.int64),
        np.zeros(n, dtype=np.int64),
        np.full((n, len(VALUE_COLUMNS)), np.nan),
        np.full((n, 7), np.nan),
        np.full((n, 7), np.nan),
        np.zeros((n, len(scaled.mid_cos), 3)),
    )
    judge_facets(
        scaled,
        prepared.frame,
        prepared.surface,
        tube,
        prepared.arc_bound,
        prepared.centroids_m[facets],
        prepared.normals[facets],
        prepared.case.terrain == "require",
        out,
    )
    return out


def _to_rows(prepared: PreparedCase, facets: Ints, out: Measures) -> FacetSolutions:
    """Turn the kernel's answers into rows; only a reachable facet's thrust is kept."""
    rows = blank_rows(facets)
    for name in ("verdict", "proved", "binding", "iterations"):
        rows[name] = getattr(out, name)
    for column, name in enumerate(VALUE_COLUMNS):
        rows[name] = out.values[:, column]
    rows["handover_position_m"] = out.handover[:, :3]
    rows["handover_velocity_m_s"] = out.handover[:, 3:6]
    rows["handover_mass_kg"] = out.handover[:, 6]
    rows["costates"] = out.costates
    reachable = out.verdict == _REACHABLE
    for name in (*VALUE_COLUMNS[:_VIOLATION], "handover_position_m", "handover_velocity_m_s", "costates"):
        rows[name][~reachable] = np.nan
    rows["handover_mass_kg"][~reachable] = np.nan
    rows["thrust_nodes"] = np.where(reachable, out.thrust.shape[1], 0)
    nodes = out.thrust[reachable].reshape(-1, 3) * prepared.frame.thrust_max_n
    return FacetSolutions(rows, nodes)


def _doubtful(out: Measures) -> NDArray[np.bool_]:
    """Rows that a finer time grid may decide otherwise."""
    level = 1.0 - out.values[:, _THRUST_MARGIN]
    near = (out.verdict == _UNREACHABLE) & (out.proved == 0) & (level < DOUBTFUL_LEVEL)
    return near | (out.verdict == _UNRESOLVED)


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
    out = _judge(prepared, prepared.coarse, prepared.coarse_tube, indices)
    solutions = _to_rows(prepared, indices, out)
    doubtful = np.flatnonzero(_doubtful(out))
    if len(doubtful) == 0:
        return solutions
    finer = _to_rows(
        prepared, indices[doubtful], _judge(prepared, prepared.fine, prepared.fine_tube, indices[doubtful])
    )
    return replace_rows(solutions, doubtful, finer)


def replace_rows(solutions: FacetSolutions, places: Ints, better: FacetSolutions) -> FacetSolutions:
    """Put the rows of ``better`` at ``places``, adding up the iterations."""
    rows = solutions.rows.copy()
    pieces = [solutions.nodes_of(row) for row in range(len(rows))]
    for k, place in enumerate(places):
        spent = rows[place]["iterations"]
        rows[place] = better.rows[k]
        rows[place]["iterations"] += spent
        pieces[place] = better.nodes_of(k)
    return FacetSolutions(rows, np.concatenate(pieces).reshape(-1, 3))


def solve_facets(case: LandingCase, facets: NDArray[np.integer]) -> FacetSolutions:
    """Solve some facets of a case (prepares the case each time; see :func:`prepare`)."""
    return solve_prepared(prepare(case), facets)
