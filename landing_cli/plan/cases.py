"""The planning cases of a scenario, with the checks that need the mesh."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.bvh import SurfaceIndex, build_surface_index
from landing_cli.body.clearance import closest_facets, signed_distances
from landing_cli.body.mesh import Mesh, facet_centroids, facet_normals
from landing_cli.body.outermost import outermost_point
from landing_cli.flight.acceleration_control import natural_accelerations
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.plan.records import PlanCase, Site
from landing_cli.scenario.build import KeyRefused
from landing_cli.scenario.load import LoadedScenario
from landing_cli.scenario.messages import Problem, refusal
from landing_cli.scenario.schema_plan import PlanSection, PlanStart, SiteSection
from landing_cli.scenario.sections import plan_section

FloatArray = NDArray[np.float64]

AUTO_CLEARANCE = 0.01
"""Of the shape's longest extent: what ``clearance_m: auto`` stands for."""

SURFACE_TOLERANCE_M = 0.05
"""How deep a given site may lie in the rock: rounding of printed coordinates, no more."""


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
        site = site_of(section.site, asteroid.mesh, surface)
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


def site_of(section: SiteSection, mesh: Mesh, surface: SurfaceIndex) -> Site:
    """Find the landing site on the mesh.

    Parameters
    ----------
    section : SiteSection
        What the scenario says.
    mesh : Mesh
        The surface.
    surface : SurfaceIndex
        The same, for distance queries.

    Returns
    -------
    Site

    Raises
    ------
    KeyRefused
        There is no such facet, no surface in that direction, or the position lies inside the body.
    """
    if section.facet is not None:
        if section.facet >= len(mesh.faces):
            raise _site_refused(
                "facet", f"{section.facet} is no facet of the shape", f"they are 0 to {len(mesh.faces) - 1}"
            )
        return _site_on(mesh, section.facet, facet_centroids(mesh)[section.facet])
    if section.lon_lat_deg is not None:
        lon, lat = map(math.radians, section.lon_lat_deg)
        direction = (math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat))
        found = outermost_point(mesh, direction)
        if found is None:
            raise _site_refused("lon_lat_deg", "points past the body", "its origin lies outside the shape")
        return _site_on(mesh, found[1], found[0])
    return _free_site(np.array(section.position_m), np.array(section.normal), mesh, surface)


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
    natural_accelerations(
        int(field.kind), field.params, asteroid.rotation_rate_rad_s, start[None], v, coasting
    )
    return coasting[0]


def _site_on(mesh: Mesh, facet: int, position: FloatArray) -> Site:
    return Site(np.array(position), facet_normals(mesh)[facet].copy(), facet)


def _free_site(position: FloatArray, normal: FloatArray, mesh: Mesh, surface: SurfaceIndex) -> Site:
    depth = -float(signed_distances(surface, position[None])[0])
    if depth > SURFACE_TOLERANCE_M:
        raise _site_refused(
            "position_m",
            f"lies {depth:.4g} m inside the body",
            "give a point on or above the surface, or a facet",
        )
    normal = normal / np.linalg.norm(normal)
    nearest = int(closest_facets(surface, position[None])[0])
    outward = facet_normals(mesh)[nearest]
    if -depth < SURFACE_TOLERANCE_M and normal @ outward <= 0.0:
        told = ", ".join(f"{value:.5f}" for value in outward)
        raise _site_refused("normal", "points into the body", f"the facet there faces [{told}]")
    return Site(position, normal, -1)


def _site_refused(key: str, what: str, fix: str) -> KeyRefused:
    return KeyRefused(("plan", "site", key), what, fix)
