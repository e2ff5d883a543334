"""Volume, centre of mass and inertia of a body of uniform density, exact for its polyhedron."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landing_cli.body.mesh import FloatArray, IntArray, Mesh


@dataclass(frozen=True, eq=False)
class MassProperties:
    """What a uniform density makes of a closed mesh.

    Attributes
    ----------
    volume_m3 : float
        Signed: negative when the facets are wound inwards.
    center_of_mass_m : (3,) float, m, body frame
        From the origin of the mesh.
    inertia_m2 : (3, 3) float, m2
        Inertia tensor about the centre of mass, per unit mass, along the body axes.
    """

    volume_m3: float
    center_of_mass_m: FloatArray
    inertia_m2: FloatArray

    @property
    def mean_radius_m(self) -> float:
        """Radius of the sphere of the same volume, m."""
        return float(np.cbrt(0.75 * abs(self.volume_m3) / np.pi))


@dataclass(frozen=True, eq=False)
class PrincipalAxes:
    """The principal axes of inertia about the centre of mass.

    Attributes
    ----------
    moments_m2 : (3,) float, m2
        Per unit mass, ascending.
    axes : (3, 3) float
        Row i is the unit vector of axis i in the body frame; right-handed.
    angles_deg : (3, 3) float, deg
        ``angles_deg[i, j]`` lies between principal axis i and body axis j (x, y, z), 0 to 90.
    """

    moments_m2: FloatArray
    axes: FloatArray
    angles_deg: FloatArray


def mass_properties(mesh: Mesh) -> MassProperties:
    """Integrate volume, first and second moments over the tetrahedra between a point and each facet.

    Parameters
    ----------
    mesh : Mesh
        Closed and consistently wound.

    Returns
    -------
    MassProperties

    Notes
    -----
    Over the tetrahedron (0, a, b, c) with s = a + b + c the integral of x x' is
    V/20 (a a' + b b' + c c' + s s').
    """
    # Moments are taken about the mean vertex, so that an origin far away costs no digits.
    pivot = mesh.vertices.mean(axis=0)
    corners = mesh.corners - pivot
    a, b, c = np.moveaxis(corners, 1, 0)
    tetrahedra = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
    volume = float(tetrahedra.sum())
    total = corners.sum(axis=1)
    center = tetrahedra @ total / (4.0 * volume)
    weighted = corners * tetrahedra[:, None, None]
    second = np.einsum("fki,fkj->ij", weighted, corners) + (total * tetrahedra[:, None]).T @ total
    covariance = second / (20.0 * volume) - np.outer(center, center)
    inertia = np.trace(covariance) * np.eye(3) - covariance
    return MassProperties(volume, pivot + center, 0.5 * (inertia + inertia.T))


def principal_axes(properties: MassProperties) -> PrincipalAxes:
    """Diagonalise the inertia tensor.

    Parameters
    ----------
    properties : MassProperties
        Of the body; only the inertia tensor is read.

    Returns
    -------
    PrincipalAxes
        Each axis points to the side of the body axis it is closest to.
    """
    moments, columns = np.linalg.eigh(properties.inertia_m2)
    axes = columns.T.copy()
    for axis in axes:
        axis *= np.sign(axis[np.argmax(np.abs(axis))])
    if np.linalg.det(axes) < 0.0:
        axes[np.argmin(np.abs(axes).max(axis=1))] *= -1.0
    angles = np.degrees(np.arccos(np.clip(np.abs(axes), 0.0, 1.0)))
    return PrincipalAxes(moments, axes, angles)


def translated(mesh: Mesh, shift_m: FloatArray) -> Mesh:
    """Move a mesh.

    Parameters
    ----------
    mesh : Mesh
        Any mesh.
    shift_m : (3,) float, m, body frame
        Added to every vertex.

    Returns
    -------
    Mesh
    """
    return Mesh(mesh.vertices + shift_m, mesh.faces)


def centred(mesh: Mesh) -> Mesh:
    """Move the origin of a mesh to its centre of mass (no rotation: the spin axis stays +z)."""
    return translated(mesh, -mass_properties(mesh).center_of_mass_m)


def is_star_shaped(mesh: Mesh, center_m: FloatArray) -> bool:
    """Tell whether every facet faces away from a point, so that a ray from it meets the surface once.

    Parameters
    ----------
    mesh : Mesh
        One closed body, wound outwards.
    center_m : (3,) float, m
        Where the rays start.

    Returns
    -------
    bool
    """
    return not len(facets_hidden_from(mesh, center_m))


def facets_hidden_from(mesh: Mesh, center_m: FloatArray) -> IntArray:
    """List the facets that do not face away from a point, (k,) int, 0-based."""
    a, b, c = np.moveaxis(mesh.corners - center_m, 1, 0)
    return np.flatnonzero(np.einsum("ij,ij->i", a, np.cross(b, c)) <= 0.0)
