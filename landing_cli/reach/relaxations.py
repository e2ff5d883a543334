"""The ways to relax a landing case, one thing at a time, in whole steps.

Every way is a ladder of cases over the same facets: more thrust, a longer or shorter flight, a wider glide
slope, a smaller keep-out ellipsoid, more propellant. The steps are the same for all facets, so that many
facets share a case, and what is found for a facet does not depend on its company.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache

import numpy as np

from landing_cli.body.adjacency import mean_edge_m
from landing_cli.body.bvh import build_surface_index
from landing_cli.body.mesh import facet_centroids, facet_normals
from landing_cli.reach.certificate import GravityBounds
from landing_cli.reach.free_descent import PreparedCase, Surroundings, prepare
from landing_cli.reach.records import LandingCase

# Steps of thrust: shares of the thrust bound, up to this multiple of it beside itself.
THRUST_STEP, THRUST_MORE = 1.0 / 2048.0, 4.0
# Steps of time: shares of the descent's duration, down and up to these shares of it.
TIME_STEP, TIME_LESS, TIME_MORE = 1.0 / 512.0, 0.75, 2.0
# Steps of the glide slope, and the widest that is tried (the tangent of 90 degrees is infinite).
GLIDE_SLOPE_STEP_DEG, WIDEST_DEG = 0.1, 89.5
# Steps off each semi-axis: shares of the least one, down to so much less of it. The least ellipsoid that
# holds the body is smaller nowhere: what is taken off it lies in rock at some vertices.
ELLIPSOID_STEP, ELLIPSOID_LESS = 1.0 / 1024.0, 0.5
# Steps of propellant: shares of the bound.
PROPELLANT_STEP = 1.0 / 1024.0
# Bounds gravity, m/s2, where nothing is to be proved by it.
ANY_GRAVITY_M_S2 = 1e6


class Kind(StrEnum):
    """What is relaxed."""

    THRUST = "thrust"
    TIME = "time"
    GLIDE_SLOPE = "glide_slope"
    ELLIPSOID = "ellipsoid"
    PROPELLANT = "propellant"
    TERRAIN = "terrain"


UNITS = {
    Kind.THRUST: "n",
    Kind.TIME: "s",
    Kind.GLIDE_SLOPE: "deg",
    Kind.ELLIPSOID: "m",
    Kind.PROPELLANT: "kg",
    Kind.TERRAIN: "m",
}


@dataclass(frozen=True, eq=False)
class Ladder:
    """One way to relax a case.

    Attributes
    ----------
    kind : Kind
    step : float
        One step, in the kind's unit (newtons, seconds, degrees, metres, kilograms): how finely it is told.
    lowest, highest : int
        Steps that are tried at most, down (not positive) and up.
    scale : float
        What a change is measured against, in the same unit.
    nested : bool
        Whether every flight of a step is a flight of all higher ones.
    at : callable
        The prepared case of a number of steps.
    """

    kind: Kind
    step: float
    lowest: int
    highest: int
    scale: float
    nested: bool
    at: Callable[[int], PreparedCase]


def survey_without_proofs(case: LandingCase) -> Surroundings:
    """Compute what all relaxations of a case share.

    Gravity is not bounded, which would take longer than all solves of a facet, and inside a smaller ellipsoid
    has no bound for some fields: nothing is proved unreachable then, only not found reachable.
    """
    mesh = case.asteroid.mesh
    bounds = GravityBounds(np.array([1.0]), np.array([ANY_GRAVITY_M_S2]), ANY_GRAVITY_M_S2)
    return Surroundings(
        build_surface_index(mesh), facet_centroids(mesh), facet_normals(mesh), mean_edge_m(mesh), bounds
    )


def ladders(case: LandingCase, shared: Surroundings) -> tuple[Ladder, ...]:
    """Lay out the ways to relax a case that are told in steps.

    Parameters
    ----------
    case : LandingCase
        The case.
    shared : Surroundings
        From :func:`survey_without_proofs`.

    Returns
    -------
    tuple of Ladder
        Thrust, time, glide slope, ellipsoid; propellant where it is bounded.
    """
    found = [_thrust(case, shared), _time(case, shared)]
    wider = _glide_slope(case, shared)
    if wider.highest > 0:
        found.append(wider)
    found.append(_ellipsoid(case, shared))
    if case.spacecraft.propellant_kg is not None:
        found.append(_propellant(case, case.spacecraft.propellant_kg, shared))
    return tuple(found)


def _remembered(
    change: Callable[[LandingCase, float], LandingCase], case: LandingCase, step: float, shared: Surroundings
) -> Callable[[int], PreparedCase]:
    """Prepare a changed case once for every number of steps."""

    def at(steps: int) -> PreparedCase:
        return prepare(change(case, steps * step), shared)

    return lru_cache(maxsize=None)(at)


def _thrust(case: LandingCase, shared: Surroundings) -> Ladder:
    bound = case.spacecraft.thrust_max_n
    step = THRUST_STEP * bound
    most = math.ceil(THRUST_MORE / THRUST_STEP)
    return Ladder(Kind.THRUST, step, 0, most, bound, True, _remembered(with_more_thrust, case, step, shared))


def _time(case: LandingCase, shared: Surroundings) -> Ladder:
    step = TIME_STEP * case.descent_s
    least, most = -math.floor(TIME_LESS / TIME_STEP), math.ceil(TIME_MORE / TIME_STEP)
    at = _remembered(with_more_time, case, step, shared)
    return Ladder(Kind.TIME, step, least, most, case.tof_s, False, at)


def _glide_slope(case: LandingCase, shared: Surroundings) -> Ladder:
    angle = math.degrees(case.glide_slope_half_angle_rad)
    most = max(0, math.floor((WIDEST_DEG - angle) / GLIDE_SLOPE_STEP_DEG))
    at = _remembered(with_wider_glide_slope, case, GLIDE_SLOPE_STEP_DEG, shared)
    return Ladder(Kind.GLIDE_SLOPE, GLIDE_SLOPE_STEP_DEG, 0, most, angle, True, at)


def _ellipsoid(case: LandingCase, shared: Surroundings) -> Ladder:
    least = float(min(case.ellipsoid_m))
    step, most = ELLIPSOID_STEP * least, round(ELLIPSOID_LESS / ELLIPSOID_STEP)
    at = _remembered(with_smaller_ellipsoid, case, step, shared)
    # a handover on the ellipsoid moves with it
    return Ladder(Kind.ELLIPSOID, step, 0, most, least, case.handover == "outside", at)


def _propellant(case: LandingCase, bound: float, shared: Surroundings) -> Ladder:
    step = PROPELLANT_STEP * bound
    most = math.ceil((case.spacecraft.mass_kg - bound) / step) - 1
    at = _remembered(with_more_propellant, case, step, shared)
    return Ladder(Kind.PROPELLANT, step, 0, most, bound, True, at)


def with_more_thrust(case: LandingCase, more_n: float) -> LandingCase:
    """Change a case's thrust bound, N."""
    craft = case.spacecraft
    return replace(case, spacecraft=replace(craft, thrust_max_n=craft.thrust_max_n + more_n))


def with_more_time(case: LandingCase, more_s: float) -> LandingCase:
    """Change a case's time of flight, s; the final stage keeps its own."""
    return replace(case, tof_s=case.tof_s + more_s)


def with_wider_glide_slope(case: LandingCase, more_deg: float) -> LandingCase:
    """Change the half-angle of a case's glide slope, degrees."""
    return replace(case, glide_slope_half_angle_rad=case.glide_slope_half_angle_rad + math.radians(more_deg))


def with_smaller_ellipsoid(case: LandingCase, less_m: float) -> LandingCase:
    """Take so much off every semi-axis of a case's keep-out ellipsoid, m."""
    return replace(case, ellipsoid_m=case.ellipsoid_m - less_m)


def with_more_propellant(case: LandingCase, more_kg: float) -> LandingCase:
    """Change the bound on a case's propellant, kg."""
    craft = case.spacecraft
    return replace(case, spacecraft=replace(craft, propellant_kg=(craft.propellant_kg or 0.0) + more_kg))


def through_rock(case: LandingCase, shared: Surroundings) -> PreparedCase | None:
    """Prepare a case with paths that may cut the mesh; None where they may already."""
    return prepare(replace(case, terrain="report"), shared) if case.terrain == "require" else None
