"""The compiled kernels: whether they are in the cache, and their first compilation.

Most of a compilation is numba's own work in Python, which threads cannot share. Forked copies of the process
can: each compiles some, and what it leaves in the cache on disk is loaded, not compiled, by the others. None
waits for another: the kernels of a solve call each other by address (`kernel_address`).
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from landing_cli.body.adjacency import mean_edge_m
from landing_cli.body.bvh import build_surface_index
from landing_cli.body.clearance import signed_distances_into
from landing_cli.body.mesh import facet_centroids, facet_normals
from landing_cli.body.ray_cast import first_hits_into
from landing_cli.compile_cache import is_cached
from landing_cli.parallel.forks import share_out
from landing_cli.reach.certificate import GravityBounds
from landing_cli.reach.delivery import (
    DELIVERY_SUBSTEPS,
    fill_deliveries,
    measure_landing,
    measure_of,
    new_deliveries,
)
from landing_cli.reach.ellipsoid_arcs import arc_cuts_many, freeze_many, lowest_levels, lowest_levels_between
from landing_cli.reach.free_batch import new_batch, no_cuts, no_walls, solve_many
from landing_cli.reach.free_descent import PreparedCase, Surroundings, prepare, survey
from landing_cli.reach.free_solve import LaneSolver, judge, linearise, new_solver, take_step
from landing_cli.reach.records import LandingCase
from landing_cli.reach.shooting import new_flights

_typeof: Any = numba.typeof


def are_compiled(descent: str, terrain: str = "report") -> bool:
    """Tell whether a case's kernels were compiled before, by this version for this kind of processor.

    Parameters
    ----------
    descent : {"free", "extremal"}
        The family of trajectories.
    terrain : {"report", "require"}
        Whether a path that cuts the mesh is a landing.
    """
    kernels: list[Any] = [solve_many, linearise, take_step, judge, fill_deliveries, measure_landing]
    if terrain == "require":
        kernels += [signed_distances_into, first_hits_into]
    if descent == "extremal":
        from landing_cli.reach.extremal_kernels import KERNELS

        kernels += KERNELS
    return all(is_cached(kernel) for kernel in kernels)


def compile_parts(case: LandingCase) -> None:
    """Compile, on all processors, the kernels of a case.

    They are called with numbers of no meaning, once. Whatever else there is compiles when a facet is solved.

    Parameters
    ----------
    case : LandingCase
        Any case of the run.
    """
    mesh = case.asteroid.mesh
    unbound = GravityBounds(np.array([1.0]), np.array([1.0]), 1.0)  # spares the survey, which is a part
    shared = Surroundings(
        build_surface_index(mesh), facet_centroids(mesh), facet_normals(mesh), mean_edge_m(mesh), unbound
    )
    prepared = prepare(case, shared)
    # the longest first
    parts = [
        _flight,
        _conic,
        _solve,
        _measures,
        _delivery,
        _verdicts,
        _ellipsoid_arcs,
        lambda _: survey(case),
    ]
    if case.descent == "extremal":
        from landing_cli.reach.extremal_kernels import PARTS

        parts[:0] = PARTS
    if case.terrain == "require":
        parts.append(_terrain)
    with np.errstate(all="ignore"):
        share_out([_bound(part, prepared) for part in parts], len(os.sched_getaffinity(0)))


def _bound(part: Callable[[PreparedCase], object], prepared: PreparedCase) -> Callable[[], object]:
    return lambda: part(prepared)


def _solver(prepared: PreparedCase) -> LaneSolver:
    return new_solver(prepared.coarse)


def _conic(prepared: PreparedCase) -> None:
    """Interior-point iterations."""
    _solver(prepared).take_step.compile()


def _verdicts(prepared: PreparedCase) -> None:
    """What tells that a facet is done, with the bounds that prove one unreachable."""
    _solver(prepared).judge.compile()


def _flight(prepared: PreparedCase) -> None:
    """The linearised flight, gravity and constraints."""
    _solver(prepared).linearise.compile()


def _measures(prepared: PreparedCase) -> None:
    """What is measured on an accurate flight, and the final arc."""
    case = prepared.coarse
    measure_of(prepared.frame, prepared.shared.surface, case.gravity_kind, case.gravity_params).compile()


def _delivery(prepared: PreparedCase) -> None:
    """The accurate flight."""
    case, surface, one = prepared.coarse, prepared.shared.surface, np.ones((1, 3))
    thrust, flights = np.zeros((1, len(case.mid_cos), 3)), new_flights(case, DELIVERY_SUBSTEPS)
    measure = measure_of(prepared.frame, surface, case.gravity_kind, case.gravity_params)
    arguments = case, prepared.frame, surface, thrust, one, one, flights, measure, new_deliveries(1)
    fill_deliveries.compile(tuple(_typeof(argument) for argument in arguments))


def _ellipsoid_arcs(prepared: PreparedCase) -> None:
    """Tangent planes along arcs and paths."""
    case = prepared.coarse
    n = len(case.mid_cos)
    position, cuts, out = np.ones((1, n + 1, 3)), no_cuts(1, n), np.empty(1)
    lowest_levels(case, position, out)
    lowest_levels_between(case, np.zeros((1, n, 3)), out)
    arc_cuts_many(case, position, 1.0, cuts)
    freeze_many(case, position, out, cuts)


def _terrain(prepared: PreparedCase) -> None:
    """Distances and rays to the surface."""
    surface, point = prepared.shared.surface, np.ones((1, 3))
    signed_distances_into(surface, point, np.zeros(1), np.zeros(1, dtype=np.int64))
    first_hits_into(surface, point, point, np.zeros(1), np.zeros(1, dtype=np.int64))


def _solve(prepared: PreparedCase) -> None:
    """The loop over facets; the kernels that it calls are compiled elsewhere."""
    case, one, n = prepared.coarse, np.ones((1, 3)), len(prepared.coarse.mid_cos)
    batch = no_cuts(1, n), np.ones(1), no_walls(1), 1.0, True, 1, 1
    arguments = case, one, one, *batch, prepared.coarse_tube, 1.0, False, _solver(prepared), new_batch(1, n)
    solve_many.compile(tuple(_typeof(argument) for argument in arguments))
