"""What a mesh says about its body: the figures an analyst asks for first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landing_cli.body.adjacency import edge_lengths_m, equilateral_height_m
from landing_cli.body.ellipsoid import least_volume_ellipsoid
from landing_cli.body.gravity.coefficients import (
    Degree2,
    Dipole,
    degree2_from_mesh,
    dipole_from_mesh,
    long_axis_azimuth,
)
from landing_cli.body.mass_properties import (
    MassProperties,
    PrincipalAxes,
    centred,
    is_star_shaped,
    mass_properties,
    principal_axes,
)
from landing_cli.body.mesh import FloatArray, Mesh, facet_areas
from landing_cli.errors import InputRefused


@dataclass(frozen=True, eq=False)
class ShapeFacts:
    """Figures of a body of uniform density.

    Attributes
    ----------
    vertex_count, facet_count : int
    extents_m : (3,) float, m
        Along the body axes.
    area_m2 : float
    mass : MassProperties
    principal : PrincipalAxes
    ellipsoid_m : (3,) float, m
        Least-volume ellipsoid about the centre of mass, aligned with the body axes.
    mean_edge_m, longest_edge_m, equilateral_height_m : float
    degree2 : Degree2
        About the centre of mass, along the body axes, unnormalised.
    dipole : Dipole or None
        Rotating mass dipole along x; None for a body that is not elongated along x.
    long_axis_dipole : Dipole or None
        The same along the longest axis in the equatorial plane, with its azimuth from x.
    star_shaped : bool
        About the centre of mass.
    """

    vertex_count: int
    facet_count: int
    extents_m: FloatArray
    area_m2: float
    mass: MassProperties
    principal: PrincipalAxes
    ellipsoid_m: FloatArray
    mean_edge_m: float
    longest_edge_m: float
    equilateral_height_m: float
    degree2: Degree2
    dipole: Dipole | None
    long_axis_dipole: Dipole | None
    star_shaped: bool


def shape_facts(mesh: Mesh, reference_radius_m: float | None = None) -> ShapeFacts:
    """Gather the figures of a body.

    Parameters
    ----------
    mesh : Mesh
        Checked, about any origin.
    reference_radius_m : float, optional
        What the degree-2 coefficients refer to; the radius of the sphere of the same volume unless given.

    Returns
    -------
    ShapeFacts
    """
    mass = mass_properties(mesh)
    about_com = centred(mesh)
    lengths = edge_lengths_m(mesh)
    return ShapeFacts(
        vertex_count=len(mesh.vertices),
        facet_count=len(mesh.faces),
        extents_m=np.ptp(mesh.vertices, axis=0),
        area_m2=float(facet_areas(mesh).sum()),
        mass=mass,
        principal=principal_axes(mass),
        ellipsoid_m=least_volume_ellipsoid(about_com.vertices),
        mean_edge_m=float(lengths.mean()),
        longest_edge_m=float(lengths.max()),
        equilateral_height_m=equilateral_height_m(mesh),
        degree2=degree2_from_mesh(about_com, reference_radius_m or mass.mean_radius_m),
        dipole=_dipole_or_none(about_com, 0.0),
        long_axis_dipole=_dipole_or_none(about_com, long_axis_azimuth(about_com)),
        star_shaped=is_star_shaped(mesh, mass.center_of_mass_m),
    )


def _dipole_or_none(mesh: Mesh, azimuth_rad: float) -> Dipole | None:
    try:
        return dipole_from_mesh(mesh, azimuth_rad)
    except InputRefused:
        return None
