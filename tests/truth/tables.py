"""Read the truth tables, and put their inputs into the package's own records.

A table is self-contained: every physical input stands in its header, every facet's centroid and normal in
its row, so that it stays true whatever becomes of the shapes that the project ships.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.gravity.dipole import dipole_field
from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.harmonics import harmonics_field
from landing_cli.body.gravity.scaled_field import scaled_field
from landing_cli.body.mass_properties import centred
from landing_cli.body.mesh import Mesh
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.records import LandingCase
from landing_cli.sources.kept_interpolation import is_kept, kept_interpolation
from landing_cli.sources.shape_files import read_shape

HERE = Path(__file__).resolve().parent
SHAPES = HERE.parent.parent / "shapes"
DEPTH_M = 10.0


@dataclass(frozen=True)
class TruthCase:
    """One case of a table: its inputs and, row by row, what is true of its facets.

    Attributes
    ----------
    name : str
    inputs : dict
        Physical inputs, SI (see ``problem.Problem``).
    centroids, normals : (n, 3) float
    tau, j, j_margin : (n,) float
        Least thrust level; least J, m2/s3, and the least r'Re r - 1 on that path (NaN where unreachable).
    ellipsoid_binds : (n,) bool
        Whether the ellipsoid shapes the path of least tau, or of least J where there is one.
    """

    name: str
    inputs: dict[str, Any]
    facets: np.ndarray
    centroids: np.ndarray
    normals: np.ndarray
    tau: np.ndarray
    j: np.ndarray
    j_margin: np.ndarray
    ellipsoid_binds: np.ndarray


def read_table(name: str) -> list[TruthCase]:
    """The cases of one table, by its name without ``.csv``."""
    lines = (HERE / f"{name}.csv").read_text().splitlines()
    headers = [json.loads(line[2:]) for line in lines if line.startswith("# ")]
    names, *rows = [line.split(",") for line in lines if not line.startswith("# ")]
    column = {name: np.array([row[i] for row in rows]) for i, name in enumerate(names)}

    def numbers(*wanted: str) -> np.ndarray:
        return np.column_stack([[float(v) if v else np.nan for v in column[name]] for name in wanted])

    binds = np.where(
        column["j_ellipsoid_binds"] != "", column["j_ellipsoid_binds"], column["tau_ellipsoid_binds"]
    )
    cases = []
    for header in headers:
        of = column["case"] == header["case"]
        cases.append(
            TruthCase(
                name=header["case"],
                inputs=header,
                facets=column["facet"][of].astype(int),
                centroids=numbers("r_c_x_m", "r_c_y_m", "r_c_z_m")[of],
                normals=numbers("n_x", "n_y", "n_z")[of],
                tau=numbers("tau")[of, 0],
                j=numbers("j_m2_s3")[of, 0],
                j_margin=numbers("j_ellipsoid_margin")[of, 0],
                ellipsoid_binds=binds[of] == "1",
            )
        )
    return cases


def landing_case(truth: TruthCase) -> tuple[LandingCase, np.ndarray]:
    """The package's case for a truth case, and the facet number of every row.

    The mesh is one small tetrahedron per row, under the facet: centroid and outward normal are the row's.
    """
    given = truth.inputs
    mesh, facets = tetrahedra(truth.centroids, truth.normals)
    gravity = gravity_field(given["gravity"])
    asteroid = Asteroid(truth.name, mesh, given["omega"], gravity, given["gravity"][1])
    case = LandingCase(
        name=truth.name,
        asteroid=asteroid,
        spacecraft=Spacecraft(given["mass"], given["thrust"], given["isp"]),
        position_m=np.array(given["r0"]),
        velocity_m_s=np.array(given["v0"]),
        tof_s=given["tof"],
        final_stage_s=given["t_final"],
        ellipsoid_m=np.array(given["semi_axes"]),
        glide_slope_half_angle_rad=given["theta"],
        handover=given["handover"],
        final_stage_thrust=given["final_thrust"],
    )
    return case, facets


def gravity_field(gravity: list[Any]) -> GravityField:
    """The package's field for a header's gravity; for a polyhedron the interpolated one."""
    kind, *numbers = gravity
    if kind == "polyhedron":
        return interpolated(numbers[0], *numbers[-2:])
    return {"harmonics": harmonics_field, "dipole": dipole_field}[kind](*numbers)


def is_fitted(gravity: list[Any]) -> bool:
    """Whether the package's field for a header's gravity takes no minute to make."""
    if gravity[0] != "polyhedron":
        return True
    mesh = centred(read_shape(SHAPES / gravity[-2], "km").mesh)
    return is_kept(mesh.vertices, mesh.faces)


@lru_cache(maxsize=1)
def interpolated(gm_m3_s2: float, name: str, sha256: str) -> GravityField:
    """The field fitted to a shipped shape's polyhedron; the table holds for one version of the shape."""
    shape = read_shape(SHAPES / name, "km")
    if shape.sha256 != sha256:
        raise ValueError(f"{name} has changed: make the tables anew that hold its polyhedron")
    mesh = centred(shape.mesh)
    return scaled_field(kept_interpolation(mesh.vertices, mesh.faces), gm_m3_s2)


def tetrahedra(centroids: np.ndarray, normals: np.ndarray) -> tuple[Mesh, np.ndarray]:
    """A mesh whose facets 0, 4, 8... have the given centroids and outward normals."""
    helper = np.where(np.abs(normals[:, 2:]) < 0.8, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    x = np.cross(helper, normals)
    x /= np.linalg.norm(x, axis=1)[:, None]
    y = np.cross(normals, x)
    angles = 2 * np.pi / 3 * np.arange(3)
    corners = [centroids + DEPTH_M * (np.cos(a) * x + np.sin(a) * y) for a in angles]
    vertices = np.stack([*corners, centroids - DEPTH_M * normals], axis=1).reshape(-1, 3)
    pattern = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    faces = (4 * np.arange(len(centroids)))[:, None, None] + pattern
    return Mesh(vertices, faces.reshape(-1, 3)), 4 * np.arange(len(centroids))
