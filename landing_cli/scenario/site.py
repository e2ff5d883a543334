"""The landing site that a scenario names, found on the mesh."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.bvh import SurfaceIndex
from landing_cli.body.clearance import closest_facets, signed_distances
from landing_cli.body.landing_site import Site
from landing_cli.body.mesh import Mesh, facet_centroids, facet_normals
from landing_cli.body.outermost import outermost_point
from landing_cli.scenario.build import KeyRefused
from landing_cli.scenario.messages import KeyPath
from landing_cli.scenario.schema_plan import SiteSection

FloatArray = NDArray[np.float64]

SURFACE_TOLERANCE_M = 0.05
"""How deep a given site may lie in the rock: rounding of printed coordinates, no more."""


def site_of(section: SiteSection, path: KeyPath, mesh: Mesh, surface: SurfaceIndex) -> Site:
    """Find the landing site on the mesh.

    Parameters
    ----------
    section : SiteSection
        What the scenario says.
    path : tuple of str
        Where it says so, for messages.
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
                path,
                "facet",
                f"{section.facet} is no facet of the shape",
                f"they are 0 to {len(mesh.faces) - 1}",
            )
        return _site_on(mesh, section.facet, facet_centroids(mesh)[section.facet])
    if section.lon_lat_deg is not None:
        lon, lat = map(math.radians, section.lon_lat_deg)
        direction = (math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat))
        found = outermost_point(mesh, direction)
        if found is None:
            raise _site_refused(
                path, "lon_lat_deg", "points past the body", "its origin lies outside the shape"
            )
        return _site_on(mesh, found[1], found[0])
    return _free_site(path, np.array(section.position_m), np.array(section.normal), mesh, surface)


def _site_on(mesh: Mesh, facet: int, position: FloatArray) -> Site:
    return Site(np.array(position), facet_normals(mesh)[facet].copy(), facet)


def _free_site(
    path: KeyPath, position: FloatArray, normal: FloatArray, mesh: Mesh, surface: SurfaceIndex
) -> Site:
    depth = -float(signed_distances(surface, position[None])[0])
    if depth > SURFACE_TOLERANCE_M:
        raise _site_refused(
            path,
            "position_m",
            f"lies {depth:.4g} m inside the body",
            "give a point on or above the surface, or a facet",
        )
    normal = normal / np.linalg.norm(normal)
    nearest = int(closest_facets(surface, position[None])[0])
    outward = facet_normals(mesh)[nearest]
    if -depth < SURFACE_TOLERANCE_M and normal @ outward <= 0.0:
        told = ", ".join(f"{value:.5f}" for value in outward)
        raise _site_refused(path, "normal", "points into the body", f"the facet there faces [{told}]")
    return Site(position, normal, -1)


def _site_refused(path: KeyPath, key: str, what: str, fix: str) -> KeyRefused:
    return KeyRefused((*path, key), what, fix)
