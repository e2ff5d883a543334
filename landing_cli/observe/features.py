"""The landmarks on the mesh: a drawn field, or a list put in its place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.adjacency import mean_edge_m
from landing_cli.body.bvh import SurfaceIndex
from landing_cli.body.clearance import closest_facets
from landing_cli.body.closest_points import closest_points
from landing_cli.body.mesh import Mesh, facet_normals
from landing_cli.body.ray_cast import first_hits
from landing_cli.errors import InputRefused
from landing_cli.observe.records import Landmarks, SiteFrame
from landing_cli.sources.landmark_files import LandmarkTable

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class ThomasField:
    """A Thomas cluster process in the site's x-y plane (Thomas, Biometrika 36, 1949), its parents counted.

    Attributes
    ----------
    seed : int
        The same seed draws the same landmarks.
    clusters : int
        Parents, drawn evenly over the square. The process has a Poisson number of them; here it is given, so
        that the number of clusters to be found is known.
    mean_per_cluster : float
        Mean of the Poisson number of landmarks around each parent.
    spread_m : float, m
        Standard deviation of a landmark's offset from its parent, each axis.
    extent_m : float, m
        Half-width of the square about the site.
    """

    seed: int
    clusters: int
    mean_per_cluster: float
    spread_m: float
    extent_m: float


def thomas_landmarks(mesh: Mesh, surface: SurfaceIndex, frame: SiteFrame, drawn: ThomasField) -> Landmarks:
    """Draw landmarks in the site's x-y plane and cast them along -z onto the mesh.

    Parameters
    ----------
    mesh : Mesh
        The surface.
    surface : SurfaceIndex
        The same, arranged for rays.
    frame : SiteFrame
        The site.
    drawn : ThomasField
        What is drawn.

    Returns
    -------
    Landmarks
        Where a ray from above the body first meets it; named L001, L002 and so on, cluster by cluster.

    Raises
    ------
    InputRefused
        A landmark falls beside the body, or none is drawn.
    """
    flat = thomas_points(drawn)
    if not len(flat):
        raise InputRefused(
            "draws no landmark", where="synthetic", fix="raise mean_per_cluster or change the seed"
        )
    above = 2.0 * float(np.linalg.norm(mesh.vertices, axis=1).max())
    origins = frame.to_body(np.column_stack([flat, np.full(len(flat), above)]))
    down = np.broadcast_to(-frame.axes[2], origins.shape)
    distance, facet = first_hits(surface, origins, down)
    if (facet < 0).any():
        x, y = flat[facet < 0][0]
        raise InputRefused(
            f"{np.count_nonzero(facet < 0)} of {len(flat)} landmarks fall beside the body, one at "
            f"x = {x:.4g} m, y = {y:.4g} m of the site frame",
            where="synthetic",
            fix="reduce extent_m or spread_m",
        )
    names = tuple(f"L{index:03d}" for index in range(1, len(flat) + 1))
    position = origins + distance[:, None] * down
    return Landmarks(position, facet_normals(mesh)[facet], np.full(len(flat), np.nan), names, facet)


def thomas_points(drawn: ThomasField) -> FloatArray:
    """Draw the points of a Thomas process, (n, 2) float, m, cluster by cluster."""
    rng = np.random.default_rng(drawn.seed)
    parents = rng.uniform(-drawn.extent_m, drawn.extent_m, (drawn.clusters, 2))
    counts = rng.poisson(drawn.mean_per_cluster, drawn.clusters)
    offsets = rng.normal(0.0, drawn.spread_m, (int(counts.sum()), 2))
    return np.asarray(np.repeat(parents, counts, axis=0) + offsets)


def placed_landmarks(table: LandmarkTable, mesh: Mesh, surface: SurfaceIndex) -> Landmarks:
    """Put listed landmarks on the mesh.

    Parameters
    ----------
    table : LandmarkTable
        What a file lists; positions in the body frame.
    mesh : Mesh
        The surface.
    surface : SurfaceIndex
        The same, arranged for rays.

    Returns
    -------
    Landmarks
        Those given by position lie at the closest point of the mesh, those given by longitude and latitude
        where a ray from the body's origin leaves the body for good.

    Raises
    ------
    InputRefused
        A position is farther from the mesh than its mean edge, or a ray leaves no body; its line is named.
    """
    outer, outer_facet = _outermost(table, mesh, surface)
    listed = np.isfinite(table.position_m[:, 0])
    facet = np.where(listed, -1, outer_facet)
    position = np.where(listed[:, None], 0.0, outer)
    if listed.any():
        facet[listed] = closest_facets(surface, table.position_m[listed])
        position[listed] = closest_points(mesh.corners[facet[listed]], table.position_m[listed])
        _check_near(table, position, listed, mean_edge_m(mesh))
    return Landmarks(position, facet_normals(mesh)[facet], table.diameter_m, table.name, facet)


def _outermost(table: LandmarkTable, mesh: Mesh, surface: SurfaceIndex) -> tuple[FloatArray, IntArray]:
    """Where each longitude and latitude leaves the body; NaN and -1 where none is given."""
    cosine = np.cos(table.latitude_rad)
    away = np.stack(
        [
            cosine * np.cos(table.longitude_rad),
            cosine * np.sin(table.longitude_rad),
            np.sin(table.latitude_rad),
        ],
        axis=1,
    )
    outside = 2.0 * float(np.linalg.norm(mesh.vertices, axis=1).max())
    points, facets = np.full_like(away, np.nan), np.full(len(away), -1, dtype=np.int64)
    given = np.flatnonzero(np.isfinite(table.latitude_rad))
    if not len(given):
        return points, facets
    shares, hit = first_hits(surface, outside * away[given], -outside * away[given])
    missing = np.flatnonzero((hit < 0) | (shares >= 1.0))
    if len(missing):
        row = given[missing[0]]
        raise InputRefused(
            f"no surface lies above the body's origin in the direction of landmark {table.name[row]!r}",
            where=table.where[row],
            fix="give its position instead",
        )
    points[given] = outside * away[given] * (1.0 - shares)[:, None]
    facets[given] = hit
    return points, facets


def _check_near(table: LandmarkTable, placed: FloatArray, listed: NDArray[np.bool_], most_m: float) -> None:
    """Refuse positions that are not on this body: a wrong unit, frame or origin."""
    miss = np.where(listed, np.linalg.norm(np.nan_to_num(table.position_m) - placed, axis=1), 0.0)
    worst = int(np.argmax(miss))
    if miss[worst] > most_m:
        raise InputRefused(
            f"landmark {table.name[worst]!r} is {miss[worst]:.4g} m from the surface, more than a mean edge "
            f"({most_m:.4g} m)",
            where=table.where[worst],
            fix="check the unit, and that positions are in the body frame (body.origin)",
        )
