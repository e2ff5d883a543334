"""The figures that ``landing shapes`` prints, by name and unit."""

from __future__ import annotations

import numpy as np

from landing_cli.body.mass_properties import mass_properties
from landing_cli.body.mesh import Mesh
from landing_cli.body.shape_facts import ShapeFacts
from landing_cli.body.surface_deviation import radial_deviation, triangle_quality


def facts_figures(facts: ShapeFacts) -> dict[str, object]:
    """Name the figures of a body.

    Parameters
    ----------
    facts : ShapeFacts
        Of the body.

    Returns
    -------
    dict
        Numbers, arrays of three numbers, truths.
    """
    degree2, principal = facts.degree2, facts.principal
    dipole, turned = facts.dipole, facts.long_axis_dipole
    return {
        "vertices": facts.vertex_count,
        "facets": facts.facet_count,
        "extents_m": facts.extents_m,
        "volume_km3": facts.mass.volume_m3 / 1e9,
        "area_km2": facts.area_m2 / 1e6,
        "mean_radius_m": facts.mass.mean_radius_m,
        "center_of_mass_m": facts.mass.center_of_mass_m,
        "principal_moments_m2": principal.moments_m2,
        "principal_axis_1_to_xyz_deg": principal.angles_deg[0],
        "principal_axis_2_to_xyz_deg": principal.angles_deg[1],
        "principal_axis_3_to_xyz_deg": principal.angles_deg[2],
        "ellipsoid_m": facts.ellipsoid_m,
        "mean_edge_m": facts.mean_edge_m,
        "longest_edge_m": facts.longest_edge_m,
        "equilateral_height_m": facts.equilateral_height_m,
        "reference_radius_m": degree2.reference_radius_m,
        "c20": degree2.c20,
        "c21": degree2.c21,
        "c22": degree2.c22,
        "s21": degree2.s21,
        "s22": degree2.s22,
        "dipole_mass_fraction": dipole.mass_fraction if dipole else None,
        "dipole_separation_m": dipole.separation_m if dipole else None,
        "long_axis_azimuth_deg": float(np.degrees(turned.azimuth_rad)) if turned else None,
        "long_axis_dipole_mass_fraction": turned.mass_fraction if turned else None,
        "long_axis_dipole_separation_m": turned.separation_m if turned else None,
        "star_shaped": facts.star_shaped,
    }


def deviation_figures(source: Mesh, mesh: Mesh) -> dict[str, object]:
    """Compare a resampled mesh with its source.

    Parameters
    ----------
    source, mesh : Mesh
        Both star-shaped about the centre of mass of the source.

    Returns
    -------
    dict
        Numbers and arrays of three numbers.
    """
    old, new = mass_properties(source), mass_properties(mesh)
    forth = radial_deviation(source, mesh, old.center_of_mass_m)
    back = radial_deviation(mesh, source, old.center_of_mass_m)
    quality = triangle_quality(mesh)
    return {
        "vertices": len(mesh.vertices),
        "facets": len(mesh.faces),
        "source_to_new_rms_m": forth.rms_m,
        "source_to_new_max_m": forth.greatest_m,
        "new_to_source_rms_m": back.rms_m,
        "new_to_source_max_m": back.greatest_m,
        "volume_ratio_minus_1": new.volume_m3 / old.volume_m3 - 1.0,
        "center_of_mass_m": new.center_of_mass_m,
        "center_of_mass_shift_m": float(np.linalg.norm(new.center_of_mass_m - old.center_of_mass_m)),
        "extents_m": np.ptp(mesh.vertices, axis=0),
        "least_angle_deg": quality.least_angle_deg,
        "greatest_angle_deg": quality.greatest_angle_deg,
        "greatest_edge_ratio": quality.greatest_edge_ratio,
        "longest_over_mean_edge": quality.longest_over_mean_edge,
    }
