"""Planning cases for the tests: the paper's on the reference mesh, and one on a small lumpy body."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from shape_helpers import fibonacci_ellipsoid

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.bvh import build_surface_index
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.body.landing_site import Site
from landing_cli.body.mesh import Mesh, facet_centroids, facet_normals
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.plan.records import PlanCase
from landing_cli.sources.shape_files import read_shape

EROS_GM = 4.4628e5
PAPER_FACET = 2396
PUBLISHED_GUIDE_POINTS_M = (
    np.array([-2001.35, 12095.55, -2235.11]),  # r_ac
    np.array([1273.95, 8305.80, -2058.21]),  # r_ao, with x and z unswapped
)


def facet_site(mesh: Mesh, facet: int) -> Site:
    return Site(facet_centroids(mesh)[facet], facet_normals(mesh)[facet], facet)


def paper_mesh(reference_shapes: Path) -> Mesh:
    return read_shape(reference_shapes / "eros_near_3897.obj", "km").mesh


def paper_case(mesh: Mesh, polyhedron: bool = False, **changes: Any) -> PlanCase:
    """Lyu 2026, Table 1, with the facet's own normal."""
    field = polyhedron_field(mesh.vertices, mesh.faces, EROS_GM) if polyhedron else point_mass_field(EROS_GM)
    fields: dict[str, Any] = {
        "name": "paper",
        "asteroid": Asteroid("eros", mesh, 3.3117e-4, field, EROS_GM),
        "spacecraft": Spacecraft(mass_kg=500.0, thrust_max_n=60.0, isp_s=150.0),
        "position_m": np.array([-32335.78, 13393.92, 0.0]),
        "velocity_m_s": np.array([1.34, 3.23, 0.0]),
        "acceleration_m_s2": np.array([0.00065, -0.00027, 0.0]),
        "site": changes.get("site") or facet_site(mesh, PAPER_FACET),
        "landing_velocity_m_s": np.zeros(3),
        "landing_acceleration_m_s2": np.zeros(3),
        "tof_s": 2000.0,
        "clearance_m": 300.0,
        "clearance_metric": "surface",
        "cone_half_angle_rad": np.radians(30.0),
        "mass_model": "constant",
        "surface": build_surface_index(mesh),
    }
    return PlanCase(**{**fields, **changes})


def lumpy_mesh(count: int = 800) -> Mesh:
    """An elongated body of 16 x 8 x 6 km with lumps."""
    ball = fibonacci_ellipsoid((1.0, 1.0, 1.0), count)
    u = ball.vertices
    lumps = 1.0 + 0.08 * np.sin(7 * u[:, 0]) * np.cos(5 * u[:, 1] + 1.0) * np.sin(6 * u[:, 2] + 2.0)
    return Mesh(u * lumps[:, None] * [16000.0, 8000.0, 6000.0], ball.faces)


def lumpy_case(start_longitude_deg: float = 195.0, polyhedron: bool = False, **changes: Any) -> PlanCase:
    """From the 35 km circle to the facet of the lumpy body that is closest to +y."""
    mesh = lumpy_mesh()
    facet = int(np.argmax(facet_centroids(mesh)[:, 1]))
    angle = np.radians(start_longitude_deg)
    away = np.array([np.cos(angle), np.sin(angle), 0.0])
    start = {
        "position_m": 35000.0 * away,
        "velocity_m_s": 3.497 * np.array([away[1], -away[0], 0.0]),
        "acceleration_m_s2": -7.0e-4 * away,
        "site": facet_site(mesh, facet),
    }
    return paper_case(mesh, polyhedron, **{**start, **changes})
