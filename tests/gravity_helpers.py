"""Bodies and fields that the gravity tests share."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from shape_helpers import fibonacci_ellipsoid

from landing_cli.body.gravity.dipole import dipole_field
from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.harmonics import harmonics_field
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.body.mesh import Mesh

POTATO = fibonacci_ellipsoid((300.0, 220.0, 180.0), 200)

FIELDS: dict[str, GravityField] = {
    "point_mass": point_mass_field(5.0),
    "harmonics": harmonics_field(5.0, 250.0, c20=-0.05, c22=0.02, s22=-0.013, c21=0.004, s21=-0.006),
    "dipole": dipole_field(18.0, 0.437, 463.1),
    "turned_dipole": dipole_field(18.0, 0.528, 463.1, azimuth_rad=-0.16),
    "polyhedron": polyhedron_field(POTATO.vertices, POTATO.faces, 5.0),
}


def points_around(radius_m: float, count: int, seed: int = 7) -> np.ndarray:
    directions = np.random.default_rng(seed).normal(size=(count, 3))
    return radius_m * directions / np.linalg.norm(directions, axis=1, keepdims=True)


def icosphere(radius_m: float, subdivisions: int) -> Mesh:
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius_m)
    return Mesh(np.asarray(sphere.vertices), np.asarray(sphere.faces))


def read_obj_km(path: Path) -> Mesh:
    """A trusted reference shape, in metres."""
    rows = [line.split() for line in path.read_text().splitlines()]
    vertices = np.array([row[1:4] for row in rows if row and row[0] == "v"], dtype=float)
    faces = np.array([row[1:4] for row in rows if row and row[0] == "f"], dtype=np.int64)
    return Mesh(1000.0 * vertices, faces - 1)
