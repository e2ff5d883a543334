"""Landing cases that the solver's tests share."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh
from scipy.integrate import solve_ivp

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.ellipsoid import least_volume_ellipsoid
from landing_cli.body.gravity.field_values import accelerations
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
    params.setflags(write=scaled.gravity_params.flags.writeable)
    return scaled._replace(gravity_params=params)


def some_thrust(intervals: int, level: float = 0.6, seed: int = 0) -> np.ndarray:
    """Thrust nodes of changing size and direction, at most ``level``; (N, 3), scaled."""
    rng = np.random.default_rng(seed)
    t = (np.arange(intervals) + 0.5) / intervals
    waves = np.stack([np.sin(a * t + b) for a, b in rng.uniform(1.0, 4.0, (3, 2))], axis=1)
    return level * waves / np.linalg.norm(waves, axis=1).max()


def flown_by_dop853(case: LandingCase, thrust_n: np.ndarray, samples: int = 1) -> np.ndarray:
    """States in the rotating frame and SI units, ``samples`` an interval, from their own equations.

    Thrust is constant over equal intervals, in the inertial axes that are the body's at the handover.
    """
    craft, spin = case.spacecraft, case.asteroid.rotation_rate_rad_s
    w = np.array([0.0, 0.0, spin])
    width = case.descent_s / len(thrust_n)

    def rates(t: float, y: np.ndarray, force: np.ndarray) -> np.ndarray:
        angle = spin * (case.descent_s - t)
        c, s = np.cos(angle), np.sin(angle)
        turned = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ force
        r, v, m = y[:3], y[3:6], y[6]
        gravity = accelerations(case.asteroid.gravity, r)[0]
        acceleration = gravity + turned / m - 2 * np.cross(w, v) - np.cross(w, np.cross(w, r))
        return np.concatenate([v, acceleration, [-np.linalg.norm(force) / (craft.isp_s * 9.80665)]])

    states = [np.concatenate([case.position_m, case.velocity_m_s, [craft.mass_kg]])]
    for k, force in enumerate(thrust_n):
        times = np.linspace(k, k + 1, samples + 1) * width
        span = (times[0], times[-1])
        flown = solve_ivp(rates, span, states[-1], "DOP853", times, args=(force,), rtol=1e-12, atol=1e-9)
        states.extend(flown.y[:, 1:].T)
    return np.array(states)
