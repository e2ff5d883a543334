"""Observation cases on solids whose sight lines are plain to see."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.bvh import build_surface_index
from landing_cli.body.clearance import closest_facets
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.mesh import Mesh, facet_normals
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.observe.observed import Path
from landing_cli.observe.records import Landmarks, ObserveCase, Prior, Sensor
from landing_cli.observe.site_frame import site_frame

GM_M3_S2 = 100.0


def sensor(**changes: Any) -> Sensor:
    """A camera that sees almost everything, with whatever is changed."""
    given: dict[str, Any] = {
        "kind": "camera",
        "half_field_of_view_rad": math.radians(89.0),
        "boresight": "nadir",
        "range_min_m": 0.0,
        "range_max_m": 1e6,
        "emission_max_rad": math.radians(90.0),
        "incidence_max_rad": math.radians(90.0),
        "range_sigma_m": math.nan,
        "angle_sigma_rad": 1e-3,
        "rate_hz": 1.0,
    }
    return Sensor(**{**given, **changes})


def landmarks_at(mesh: Mesh, points: Any) -> Landmarks:
    """Landmarks at points of the surface."""
    position = np.array(points, dtype=np.float64).reshape(-1, 3)
    facet = closest_facets(build_surface_index(mesh), position)
    names = tuple(f"L{i:03d}" for i in range(1, len(position) + 1))
    return Landmarks(position, facet_normals(mesh)[facet], np.full(len(position), np.nan), names, facet)


def observe_case(mesh: Mesh, landmarks: Landmarks, site_m: Any, **changes: Any) -> ObserveCase:
    """A landing on a site whose outward normal is that of the closest facet."""
    surface = build_surface_index(mesh)
    site = np.array(site_m, dtype=np.float64)
    facet = int(closest_facets(surface, site)[0])
    given: dict[str, Any] = {
        "name": "sample",
        "asteroid": Asteroid("solid", mesh, 1e-3, point_mass_field(GM_M3_S2), GM_M3_S2),
        "spacecraft": Spacecraft(500.0, 20.0, 200.0),
        "position_m": site + 100.0 * facet_normals(mesh)[facet],
        "velocity_m_s": np.zeros(3),
        "frame": changes.get("frame") or site_frame(site, facet_normals(mesh)[facet], "normal", facet),
        "time_of_flight": "fixed",
        "tof_s": 100.0,
        "tof_range_s": (60.0, 3600.0),
        "landmarks": landmarks,
        "sensor": sensor(),
        "prior": Prior(1.0, 0.1),
        "sun_direction": None,
        "clearance_m": None,
        "clearance_free_m": 10.0,
        "glide_slope_half_angle_rad": None,
        "surface": surface,
    }
    return ObserveCase(**{**given, **changes})


def path_through(t_s: Any, position_m: Any, velocity_m_s: Any = None) -> Path:
    """A path whose thrust is of no interest."""
    t, r = np.array(t_s, dtype=np.float64), np.array(position_m, dtype=np.float64)
    v = np.gradient(r, t, axis=0) if velocity_m_s is None else np.array(velocity_m_s, dtype=np.float64)
    return Path(t, r, v, np.zeros_like(r), 0.0, 0.0, 0.0, 0.0, math.inf, 0.0, "planned", "", 0)
