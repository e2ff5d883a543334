"""Small cases for the tests of the information objective."""

from __future__ import annotations

from typing import Any

import numpy as np
from shape_helpers import fibonacci_ellipsoid

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.bvh import build_surface_index
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.mesh import Mesh, facet_centroids, facet_normals
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.observe.records import Landmarks, ObserveCase, Prior, Sensor, SiteFrame

GM = 4.46311e5
SPIN = 3.31165e-4


def sensor(**changes: Any) -> Sensor:
    fields: dict[str, Any] = {
        "kind": "lidar",
        "half_field_of_view_rad": np.radians(45.0),
        "boresight": "nadir",
        "range_min_m": 5.0,
        "range_max_m": 300.0,
        "emission_max_rad": np.radians(75.0),
        "incidence_max_rad": np.radians(80.0),
        "range_sigma_m": 0.5,
        "angle_sigma_rad": 2e-3,
        "rate_hz": 0.1,
    }
    return Sensor(**{**fields, **changes})


def site_frame_at(mesh: Mesh, facet: int) -> SiteFrame:
    """A frame along the facet's normal."""
    origin, normal = facet_centroids(mesh)[facet], facet_normals(mesh)[facet]
    east = np.cross([0.0, 0.0, 1.0], normal)
    east /= np.linalg.norm(east)
    axes = np.stack([east, np.cross(normal, east), normal])
    return SiteFrame(origin, axes, "normal", facet, normal)


def flat_landmarks(frame: SiteFrame, x_y_m: Any, tilt_seed: int = 0) -> Landmarks:
    """Landmarks in the site's plane, with normals a little off its own."""
    x_y = np.asarray(x_y_m, dtype=np.float64)
    rng = np.random.default_rng(tilt_seed)
    normal = np.column_stack([0.1 * rng.normal(size=(len(x_y), 2)), np.ones(len(x_y))])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    position = frame.to_body(np.column_stack([x_y, np.zeros(len(x_y))]))
    names = tuple(f"l{k}" for k in range(len(x_y)))
    nowhere = np.full(len(x_y), frame.facet)
    return Landmarks(position, normal @ frame.axes, np.full(len(x_y), np.nan), names, nowhere)


def lumpy_mesh(count: int = 800) -> Mesh:
    """An elongated body of 16 x 8 x 6 km with lumps."""
    ball = fibonacci_ellipsoid((1.0, 1.0, 1.0), count)
    u = ball.vertices
    lumps = 1.0 + 0.08 * np.sin(7 * u[:, 0]) * np.cos(5 * u[:, 1] + 1.0) * np.sin(6 * u[:, 2] + 2.0)
    return Mesh(u * lumps[:, None] * [16000.0, 8000.0, 6000.0], ball.faces)


def small_case(**changes: Any) -> ObserveCase:
    """A landing from 112 m on the lumpy body, with ten landmarks to the left of its track."""
    mesh = changes.pop("mesh", None) or lumpy_mesh()
    frame = site_frame_at(mesh, int(np.argmax(facet_centroids(mesh)[:, 1])))
    around = np.random.default_rng(5).normal(size=(10, 2)) * [15.0, 12.0] + [-20.0, 60.0]
    fields: dict[str, Any] = {
        "name": "small",
        "asteroid": Asteroid("lumpy", mesh, SPIN, point_mass_field(GM), GM),
        "spacecraft": Spacecraft(500.0, 60.0, 300.0),
        "position_m": frame.to_body(np.array([-60.0, -20.0, 90.0])),
        "velocity_m_s": np.zeros(3),
        "frame": frame,
        "time_of_flight": "fixed",
        "tof_s": 600.0,
        "tof_range_s": (300.0, 900.0),
        "landmarks": flat_landmarks(frame, around),
        "sensor": sensor(),
        "prior": Prior(20.0, 0.05, 1e-9),
        "sun_direction": None,
        "clearance_m": None,
        "clearance_free_m": 20.0,
        "glide_slope_half_angle_rad": None,
        "surface": build_surface_index(mesh),
    }
    return ObserveCase(**{**fields, **changes})
