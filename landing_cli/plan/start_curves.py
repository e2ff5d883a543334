"""A first path to improve: two cubics through a point above the site, bulged around the body."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.clearance import signed_distances
from landing_cli.body.gravity.field_values import accelerations
from landing_cli.plan.records import PlanCase

FloatArray = NDArray[np.float64]

_BULGES = (0.1, 0.2, 0.35, 0.6, 1.0)  # of the chord
_DIRECTIONS = 8
_SAMPLES = 96


def start_acceleration(case: PlanCase, entry_s: float, times_s: FloatArray, before: int) -> FloatArray:
    """Thrust acceleration along the most promising of a family of simple paths.

    Up to the cone entry a path is a cubic from the initial state to rest-like descent above the site, plus a
    quartic bulge across the chord; after it, a cubic down to the landing state. Of all bulges the one is
    taken that stays farthest within the clearance, and of those that keep it the one of least energy.

    Parameters
    ----------
    case : PlanCase
        What is asked.
    entry_s : float, s
        When the path is above the site, entering the cone for good.
    times_s : (n,) float, s
        Where the acceleration is wanted, ascending.
    before : int
        How many of the times belong to the path before the entry.

    Returns
    -------
    (n, 3) float, m/s2, rotating body frame
        Unbounded: it may exceed the thrust.
    """
    grid = np.linspace(0.0, entry_s, _SAMPLES + 1)
    best, chosen = (np.inf, np.inf), None
    for bulge in _bulges(case, entry_s):
        r, u = _approach(case, entry_s, bulge, grid)
        lack = float(np.maximum(case.clearance_m - signed_distances(case.surface, r), 0.0).max())
        score = (lack, float((u * u).sum()))
        if score < best:
            best, chosen = score, bulge
    assert chosen is not None  # there is always the path without a bulge
    first = _approach(case, entry_s, chosen, times_s[:before])[1]
    last = _descent(case, entry_s, times_s[before:])
    return np.concatenate([first, last])


def _gate(case: PlanCase, entry_s: float) -> tuple[FloatArray, FloatArray]:
    """Position and velocity at the cone entry: above the site, so low that half the thrust brakes in time."""
    left = case.tof_s - entry_s
    thrust = case.spacecraft.thrust_max_n / case.spacecraft.mass_kg
    height = max(1.3 * case.clearance_m, 0.25 * thrust * left**2)
    normal = case.site.normal
    return case.site.position_m + height * normal, -1.5 * height / left * normal


def _bulges(case: PlanCase, entry_s: float) -> Iterator[FloatArray]:
    chord = case.position_m - _gate(case, entry_s)[0]
    length = float(np.linalg.norm(chord))
    along = chord / length
    side = np.cross(along, case.site.normal)
    if np.linalg.norm(side) < 1e-6:  # straight above the site: any side will do
        side = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    side /= np.linalg.norm(side)
    up = np.cross(side, along)
    yield np.zeros(3)
    for share in _BULGES:
        for angle in 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS:
            yield share * length * (np.cos(angle) * up + np.sin(angle) * side)


def _approach(
    case: PlanCase, entry_s: float, bulge: FloatArray, t: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Position and thrust acceleration before the entry."""
    r, v, a = _cubic((case.position_m, case.velocity_m_s), _gate(case, entry_s), entry_s, t)
    x = (t / entry_s)[:, None]
    bump, slope, curve = (x * (1 - x)) ** 2, 2 * x * (1 - x) * (1 - 2 * x), 2 - 12 * x + 12 * x * x
    r, v, a = (r + 16 * bump * bulge, v + 16 * slope / entry_s * bulge, a + 16 * curve / entry_s**2 * bulge)
    return r, _thrust(case, r, v, a)


def _descent(case: PlanCase, entry_s: float, t: FloatArray) -> FloatArray:
    """Thrust acceleration after the entry."""
    end = case.site.position_m, case.landing_velocity_m_s
    return _thrust(case, *_cubic(_gate(case, entry_s), end, case.tof_s - entry_s, t - entry_s))


def _cubic(
    start: tuple[FloatArray, FloatArray], end: tuple[FloatArray, FloatArray], duration: float, t: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Position, velocity and acceleration of the cubic between two states."""
    (r0, v0), (r1, v1) = start, end
    gap, drift = r1 - r0 - duration * v0, duration * (v1 - v0)
    square, cube = (3.0 * gap - drift) / duration**2, (drift - 2.0 * gap) / duration**3
    t = t[:, None]
    return (
        r0 + t * (v0 + t * (square + t * cube)),
        v0 + t * (2.0 * square + 3.0 * t * cube),
        2.0 * square + 6.0 * t * cube,
    )


def _thrust(case: PlanCase, r: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    """Thrust acceleration that a path asks for (Lyu 2026, eq 28)."""
    w = np.array([0.0, 0.0, case.asteroid.rotation_rate_rad_s])
    free = accelerations(case.asteroid.gravity, r) - 2.0 * np.cross(w, v) - np.cross(w, np.cross(w, r))
    return np.asarray(a - free)
