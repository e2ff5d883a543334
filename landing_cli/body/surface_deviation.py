"""How far two surfaces of one body lie apart, and how even the triangles of one are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landing_cli.body.adjacency import edge_lengths_m
from landing_cli.body.mass_properties import translated
from landing_cli.body.mesh import FloatArray, Mesh
from landing_cli.body.remesh import corner_angles
from landing_cli.body.resample import facet_samples
from landing_cli.body.star_surface import StarSurface

_DIVISIONS = 6


@dataclass(frozen=True)
class RadialDeviation:
    """Differences of radius, sampled evenly by area on the first surface.

    Attributes
    ----------
    rms_m : float
        Root mean square, m.
    greatest_m : float
        Largest absolute value, m.
    """

    rms_m: float
    greatest_m: float


@dataclass(frozen=True)
class TriangleQuality:
    """Worst figures over the facets.

    Attributes
    ----------
    least_angle_deg, greatest_angle_deg : float
        Interior angles.
    greatest_edge_ratio : float
        Longest over shortest edge of one facet.
    longest_over_mean_edge : float
        Over the whole mesh.
    """

    least_angle_deg: float
    greatest_angle_deg: float
    greatest_edge_ratio: float
    longest_over_mean_edge: float


def radial_deviation(mesh: Mesh, other: Mesh, center_m: FloatArray) -> RadialDeviation:
    """Measure one surface against another along the rays from a point.

    Parameters
    ----------
    mesh : Mesh
        Sampled at 36 points a facet.
    other : Mesh
        Met by the rays through those points.
    center_m : (3,) float, m
        Where the rays start: both bodies are star-shaped about it.

    Returns
    -------
    RadialDeviation
    """
    points, areas, _ = facet_samples(translated(mesh, -center_m), _DIVISIONS)
    met = StarSurface(translated(other, -center_m)).points_along(points)
    gap = np.linalg.norm(met, axis=1) - np.linalg.norm(points, axis=1)
    return RadialDeviation(float(np.sqrt(areas @ gap**2 / areas.sum())), float(np.abs(gap).max()))


def triangle_quality(mesh: Mesh) -> TriangleQuality:
    """Report the worst triangles of a mesh.

    Parameters
    ----------
    mesh : Mesh
        Any closed mesh.

    Returns
    -------
    TriangleQuality
    """
    angles = np.degrees(corner_angles(mesh))
    sides = np.linalg.norm(np.roll(mesh.corners, -1, axis=1) - mesh.corners, axis=2)
    lengths = edge_lengths_m(mesh)
    return TriangleQuality(
        float(angles.min()),
        float(angles.max()),
        float((sides.max(axis=1) / sides.min(axis=1)).max()),
        float(lengths.max() / lengths.mean()),
    )
