"""The planning cases of a scenario, with the checks that need the mesh."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.bvh import SurfaceIndex, build_surface_index
from landing_cli.body.clearance import signed_distances
from landing_cli.body.landing_site import Site
from landing_cli.body.mesh import Mesh
from landing_cli.flight.acceleration_control import natural_accelerations
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.plan.records import PlanCase
from landing_cli.scenario.build import KeyRefused
from landing_cli.scenario.load import LoadedScenario
from landing_cli.scenario.messages import Problem, refusal
from landing_cli.scenario.schema_plan import PlanSection, PlanStart
from landing_cli.scenario.sections import plan_section
from landing_cli.scenario.site import site_of

FloatArray = NDArray[np.float64]

AUTO_CLEARANCE = 0.01
"""Of the shape's longest extent: what ``clearance_m: auto`` stands for."""


def plan_cases(loaded: LoadedScenario, asteroid: Asteroid, spacecraft: Spacecraft) -> tuple[PlanCase, ...]:
    """Make the cases of a scenario, one a time of flight.

    Parameters
    ----------
    loaded : LoadedScenario
        Its ``plan`` section is read.
    asteroid : Asteroid
        Its body.
    spacecraft : Spacecraft
        Its spacecraft.

    Returns
    -------
    tuple of PlanCase
        Named ``<time of flight>s``.

    Raises
    ------
    InputRefused
        The scenario has no such section, or the mesh contradicts it; the key is named with its place.
    """
    section = plan_section(loaded)
    surface = build_surface_index(asteroid.mesh)
    try:
        site = site_of(section.site, ("plan", "site"), asteroid.mesh, surface)
        start = start_of(section.initial_state, asteroid.mesh, surface, site)
    except KeyRefused as error:
        raise refusal([Problem(error.path, error.what, error.fix)], loaded.places, loaded.source) from error
    velocity = np.array(section.initial_state.velocity_m_s)
    clearance = section.clearance_m
    if clearance == "auto":
        clearance = auto_clearance_m(asteroid.mesh)
    return tuple(
        PlanCase(
            name=f"{tof_s:.12g}s",
            asteroid=asteroid,
            spacecraft=spacecraft,
            position_m=start,
            velocity_m_s=velocity,
            acceleration_m_s2=_start_acceleration(section, asteroid, start),
            site=site,
            landing_velocity_m_s=np.array(section.landing_velocity_m_s),
            landing_acceleration_m_s2=np.array(section.landing_acceleration_m_s2),
            tof_s=tof_s,
            clearance_m=clearance,
            clearance_metric=section.clearance,
            cone_half_angle_rad=math.radians(section.cone_half_angle_deg),
            mass_model=section.mass_model,
            surface=surface,
        )
        for tof_s in section.tof_s
    )


def auto_clearance_m(mesh: Mesh) -> float:
    """Return what ``clearance_m: auto`` stands for, m."""
    return AUTO_CLEARANCE * float(np.ptp(mesh.vertices, axis=0).max())


def start_of(section: PlanStart, mesh: Mesh, surface: SurfaceIndex, site: Site) -> FloatArray:
    """Check the initial position against the mesh and the site.

    Parameters
    ----------
    section : PlanStart
        What the scenario says.
    mesh : Mesh
        The surface.
    surface : SurfaceIndex
        The same, for distance queries.
    site : Site
        Where the flight ends.

    Returns
    -------
    (3,) float, m, body frame

    Raises
    ------
    KeyRefused
        It lies inside the body, or is the site itself.
    """
    start = np.array(section.start_m, dtype=np.float64)
    key = "position_m" if section.position_km is None else "position_km"
    path = ("plan", "initial_state", key)
    if math.dist(start, site.position_m) < 1e-3:
        raise KeyRefused(path, "is the landing site, the apex of the safety cone", "start above it")
    depth = -float(signed_distances(surface, start[None])[0])
    if depth >= 0.0:
        raise KeyRefused(path, f"lies {depth:.4g} m inside the body", "start outside the surface")
    return start


def _start_acceleration(section: PlanSection, asteroid: Asteroid, start: FloatArray) -> FloatArray:
    given = section.initial_state.acceleration_m_s2
    if given is not None:
        return np.array(given)
    coasting = np.zeros((1, 3))
    field, v = asteroid.gravity, np.array([section.initial_state.velocity_m_s])
    natural_accelerations(field.kind, field.params, asteroid.rotation_rate_rad_s, start[None], v, coasting)
    return coasting[0]
