"""Landings that the tests of guidance and transcription fly: the paper's on Eros, and a cheap one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from gravity_helpers import read_obj_km
from shape_helpers import fibonacci_ellipsoid

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.bvh import build_surface_index
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.body.mesh import Mesh, facet_centroids, facet_normals
from landing_cli.flight.replay import replay
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.flight.trajectory import Trajectory
from landing_cli.observe.observed import Path as FlownPath
from landing_cli.observe.records import Landmarks, ObserveCase, Prior, Sensor
from landing_cli.observe.site_frame import site_frame

INNER_M = np.array([[-28.67, 71.88], [1.92, 21.90]])
"""The printed centres, the second with the sign that puts both on one side."""


def landing_case(mesh: Mesh, facet: int, gm: float, spin: float, start_m: Any, **changes: Any) -> ObserveCase:
    site, normal = facet_centroids(mesh)[facet], facet_normals(mesh)[facet]
    frame = site_frame(site, normal, "radial", facet)
    nothing = Landmarks(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), (), np.zeros(0, dtype=np.int64))
    field = polyhedron_field(mesh.vertices, mesh.faces, gm)
    case = ObserveCase(
        name="sample",
        asteroid=Asteroid("sample", mesh, spin, field, gm),
        spacecraft=Spacecraft(500.0, 60.0, 225.0),
        position_m=frame.to_body(np.array(start_m)),
        velocity_m_s=np.zeros(3),
        frame=frame,
        time_of_flight="fixed",
        tof_s=800.0,
        tof_range_s=(200.0, 1500.0),
        landmarks=nothing,
        sensor=Sensor("lidar", 0.5, "nadir", 0.0, 1e4, 1.4, 1.4, 0.1, 1e-3, 1.0),
        prior=Prior(1.0, 0.1),
        sun_direction=None,
        clearance_m=None,
        clearance_free_m=30.0,
        glide_slope_half_angle_rad=None,
        surface=build_surface_index(mesh),
    )
    return replace(case, **changes)


def eros_case(shapes: Path, **changes: Any) -> ObserveCase:
    """The reference case: facet 6551 of the 7790, the file's own origin, radial frame."""
    mesh = read_obj_km(shapes / "eros_near_3897.obj")
    return landing_case(mesh, 6551, 4.46311e5, 3.31165e-4, (-60.0, 70.0, 65.0), **changes)


def potato_case(**changes: Any) -> ObserveCase:
    """A body of 396 facets that pulls with 2 mm/s2 and turns once in an hour and three quarters."""
    mesh = fibonacci_ellipsoid((900.0, 700.0, 500.0), 200)
    facet = int(np.argmax(facet_centroids(mesh) @ np.array([0.5, 0.4, 0.77])))
    return landing_case(mesh, facet, 900.0, 1e-3, (-60.0, 70.0, 95.0), **changes)


def reflown(case: ObserveCase, path: FlownPath, integrator: Any = "gauss") -> Trajectory:
    return replay(
        case.position_m,
        case.velocity_m_s,
        case.spacecraft.mass_kg,
        [path.leg],
        rotation_rate_rad_s=case.asteroid.rotation_rate_rad_s,
        field=case.asteroid.gravity,
        exhaust_velocity_m_s=case.spacecraft.exhaust_velocity_m_s,
        integrator=integrator,
    )


def miss_m(case: ObserveCase, path: FlownPath, integrator: Any = "gauss") -> float:
    """Distance between the site and where the thrust, flown open loop, ends."""
    return float(np.linalg.norm(reflown(case, path, integrator).position_m[-1] - case.frame.origin_m))
