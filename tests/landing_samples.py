"""Landing cases that the solver's tests share."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.ellipsoid import least_volume_ellipsoid
from landing_cli.body.gravity.harmonics import harmonics_field
from landing_cli.body.mesh import Mesh
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.records import LandingCase
from landing_cli.reach.scaled_case import ScaledCase

SPIN_RAD_S = 2.0 * np.pi / (4.288 * 3600.0)
GM_M3_S2 = 4.892


def rock(subdivisions: int = 2, semi_axes_m: tuple[float, float, float] = (280.0, 260.0, 240.0)) -> Mesh:
    """An ellipsoid of 320 facets (by two subdivisions), about as large as Bennu."""
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions)
    return Mesh(np.asarray(sphere.vertices) * semi_axes_m, np.asarray(sphere.faces))


def asteroid(mesh: Mesh | None = None, gravity: float = 1.0, spin: float = 1.0) -> Asteroid:
    """The rock with Bennu's spin and gravity, or multiples of them; every degree-2 coefficient is at work."""
    field = harmonics_field(gravity * GM_M3_S2, 246.0, c20=-0.04, c22=0.01, s22=-0.006, c21=0.003, s21=-0.004)
    return Asteroid("rock", mesh or rock(), spin * SPIN_RAD_S, field, gravity * GM_M3_S2)


def landing_case(body: Asteroid | None = None, **changes: Any) -> LandingCase:
    """A descent to the rock from 800 m in 700 s, with whatever is changed."""
    body = body or asteroid()
    given: dict[str, Any] = {
        "name": "sample",
        "asteroid": body,
        "spacecraft": Spacecraft(2000.0, 20.0, 400.0),
        "position_m": np.array([500.0, 200.0, 600.0]),
        "velocity_m_s": np.array([0.05, -0.03, 0.02]),
        "tof_s": 700.0,
        "final_stage_s": 200.0,
        "ellipsoid_m": least_volume_ellipsoid(body.mesh.vertices),
        "glide_slope_half_angle_rad": np.radians(60.0),
    }
    return LandingCase(**{**given, **changes})


def without_gravity(scaled: ScaledCase) -> ScaledCase:
    params = np.zeros_like(scaled.gravity_params)
    params.setflags(write=False)
    return scaled._replace(gravity_params=params)


def some_thrust(intervals: int, level: float = 0.6, seed: int = 0) -> np.ndarray:
    """Thrust nodes of changing size and direction, at most ``level``; (N, 3), scaled."""
    rng = np.random.default_rng(seed)
    t = (np.arange(intervals) + 0.5) / intervals
    waves = np.stack([np.sin(a * t + b) for a, b in rng.uniform(1.0, 4.0, (3, 2))], axis=1)
    return level * waves / np.linalg.norm(waves, axis=1).max()
