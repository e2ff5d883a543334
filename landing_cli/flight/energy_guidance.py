"""D'Souza's energy-optimal guidance to rest on a target, and the trajectory that it flies.

D'Souza, "An optimal guidance law for planetary landing" (AIAA 97-3709); Shen 2026, eqs 2-3. With d and v the
position and velocity relative to the target at rest, and a uniform acceleration g, the thrust acceleration of
least energy and its cost over the time to go t are

    u = -4 v / t - 6 d / t^2 - g,        J/2 = 2 v^2 / t + 6 v.d / t^2 + 6 d^2 / t^3 + g.v + g^2 t / 2,

and where t is free, it is a root of t^4 - 4 v^2/g^2 t^2 - 24 v.d/g^2 t - 36 d^2/g^2 = 0. There can be three
positive roots: the one of least cost is taken.

Departure: g is the effective gravity at the present state (gravity, centrifugal, Coriolis), not gravity
alone: the law then cancels all that acts, and the flight between two solutions of the quartic is exactly the
cubic d = s^2 (A + B s) in the time to go s. No integrator is needed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.field_values import accelerations
from landing_cli.flight.dynamics import natural_acceleration
from landing_cli.flight.linear_arcs import frame_slopes

FloatArray = NDArray[np.float64]

_MOST_CYCLES = 20_000
_LAST_CYCLES = 2.0  # to go, in cycles: from then on the time to go is counted down
_QUADRATURE = np.polynomial.legendre.leggauss(24)
_SCAN = 41


@dataclass(frozen=True, eq=False)
class GuidedFlight:
    """A flown guidance: one cubic for each time that the time to go was solved for.

    Attributes
    ----------
    start_s : (k,) float, s
        When each cubic begins; increasing from 0.
    to_go_s : (k,) float, s
        Time to go there.
    square, cube : (k, 3) float, m/s2, m/s3, rotating body frame
        A and B.
    target_m : (3,) float, m, body frame
    arrived : bool
        Whether it comes to rest on the target; the time to go may fail to shrink.
    """

    start_s: FloatArray
    to_go_s: FloatArray
    square: FloatArray
    cube: FloatArray
    target_m: FloatArray
    arrived: bool

    @property
    def duration_s(self) -> float:
        """From the start to the touchdown, s."""
        return float(self.start_s[-1] + self.to_go_s[-1])

    def states(self, t_s: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position, velocity and acceleration at times (k,), s; each (k, 3), m, m/s, m/s2, body frame."""
        t = np.asarray(t_s, dtype=np.float64)
        piece = np.clip(np.searchsorted(self.start_s, t, side="right") - 1, 0, len(self.start_s) - 1)
        s = (self.start_s + self.to_go_s)[piece, None] - t[:, None]
        A, B = self.square[piece], self.cube[piece]
        return self.target_m + s * s * (A + B * s), -s * (2.0 * A + 3.0 * B * s), 2.0 * A + 6.0 * B * s


def cost_to_go(to_go_s: ArrayLike, d: FloatArray, v: FloatArray, g: FloatArray) -> FloatArray:
    """Integral of u'u over the time to go, under a uniform acceleration.

    Parameters
    ----------
    to_go_s : (k,) float, s
        Times to go.
    d, v, g : (3,) float, m, m/s, m/s2
        Position and velocity relative to the target; acceleration without thrust.

    Returns
    -------
    (k,) float, m2/s3
        J, twice the cost whose slope is the quartic.
    """
    t = np.asarray(to_go_s, dtype=np.float64)
    return np.asarray(
        4.0 * (v @ v) / t + 12.0 * (v @ d) / t**2 + 12.0 * (d @ d) / t**3 + 2.0 * (g @ v) + (g @ g) * t
    )


def times_to_go(d: FloatArray, v: FloatArray, g: FloatArray) -> FloatArray:
    """Find the times to go at which the cost is stationary (Shen 2026, eq 3).

    Parameters
    ----------
    d, v, g : (3,) float, m, m/s, m/s2
        Position and velocity relative to the target; acceleration without thrust, not zero.

    Returns
    -------
    (1,) or (3,) float, s
        The positive simple roots, ascending; empty on the target at rest.
    """
    g2 = g @ g
    unit = max(np.sqrt(np.sqrt(36.0 * (d @ d) / g2)), np.sqrt(4.0 * (v @ v) / g2))
    if unit == 0.0:
        return np.zeros(0)
    quartic = np.array(
        [
            1.0,
            0.0,
            -4.0 * (v @ v) / g2 / unit**2,
            -24.0 * (v @ d) / g2 / unit**3,
            -36.0 * (d @ d) / g2 / unit**4,
        ]
    )
    roots = np.roots(quartic)
    real = roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 1e-12)].real
    slope = np.polyder(quartic)
    for _ in range(3):  # the eigenvalues of a companion matrix are good to 1e-14 of the largest root
        change = np.polyval(slope, real)
        real = real - np.divide(
            np.polyval(quartic, real), change, out=np.zeros_like(real), where=change != 0.0
        )
    return np.asarray(unit * np.sort(real))


def time_to_go(d: FloatArray, v: FloatArray, g: FloatArray) -> float:
    """Return the time to go of least cost, s; 0 on the target at rest.

    Parameters
    ----------
    d, v, g : (3,) float, m, m/s, m/s2
        Position and velocity relative to the target; acceleration without thrust, not zero.
    """
    roots = times_to_go(d, v, g)
    return float(roots[np.argmin(cost_to_go(roots, d, v, g))]) if len(roots) else 0.0


def guided_acceleration(d: FloatArray, v: FloatArray, g: FloatArray, to_go_s: float) -> FloatArray:
    """Return the law's thrust acceleration (Shen 2026, eq 2), (3,) float, m/s2.

    Parameters
    ----------
    d, v, g : (3,) float, m, m/s, m/s2
        Position and velocity relative to the target; acceleration without thrust.
    to_go_s : float, s
        Time to go.
    """
    return np.asarray(-4.0 * v / to_go_s - 6.0 * d / to_go_s**2 - g)


def fly_for(r: FloatArray, v: FloatArray, target_m: FloatArray, duration_s: float) -> GuidedFlight:
    """Fly the law with the time to go counted down from a given time of flight.

    Parameters
    ----------
    r, v : (3,) float, m, m/s, body frame
        Initial state, relative to the rotating frame.
    target_m : (3,) float, m, body frame
        Where to come to rest.
    duration_s : float, s
        Time of flight.

    Returns
    -------
    GuidedFlight
        A single cubic.
    """
    A, B = _cubic(r - target_m, v, duration_s)
    return GuidedFlight(np.zeros(1), np.array([duration_s]), A[None], B[None], target_m, True)


def fly_closed_loop(
    field: GravityField,
    rotation_rate_rad_s: float,
    r: FloatArray,
    v: FloatArray,
    target_m: FloatArray,
    cycle_s: float,
) -> GuidedFlight:
    """Fly the law with the time to go solved for again in every guidance cycle.

    Parameters
    ----------
    field : GravityField
        The field to fly in.
    rotation_rate_rad_s : float, rad/s
        Spin rate about +z.
    r, v : (3,) float, m, m/s, body frame
        Initial state, relative to the rotating frame.
    target_m : (3,) float, m, body frame
        Where to come to rest.
    cycle_s : float, s
        Length of a guidance cycle.

    Returns
    -------
    GuidedFlight
        Not ``arrived`` where the time to go has not run out after ten times its first value.
    """
    starts, times, squares, cubes = [], [], [], []
    now, arrived = 0.0, False
    for _ in range(_MOST_CYCLES):
        g = np.array(natural_acceleration(field.kind, field.params, rotation_rate_rad_s, *r, *v))
        to_go = time_to_go(r - target_m, v, g)
        A, B = _cubic(r - target_m, v, to_go)
        starts.append(now)
        times.append(to_go)
        squares.append(A)
        cubes.append(B)
        arrived = to_go <= _LAST_CYCLES * cycle_s
        if arrived or now > 10.0 * times[0]:
            break
        now, s = now + cycle_s, to_go - cycle_s
        r, v = target_m + s * s * (A + B * s), -s * (2.0 * A + 3.0 * B * s)
    return GuidedFlight(
        np.array(starts), np.array(times), np.array(squares), np.array(cubes), target_m, arrived
    )


def least_cost_duration(
    field: GravityField,
    rotation_rate_rad_s: float,
    r: FloatArray,
    v: FloatArray,
    target_m: FloatArray,
    range_s: tuple[float, float],
) -> float:
    """Search the time of flight in which the law, counted down, costs least.

    Parameters
    ----------
    field : GravityField
        The field to fly in.
    rotation_rate_rad_s : float, rad/s
        Spin rate about +z.
    r, v : (3,) float, m, m/s, body frame
        Initial state, relative to the rotating frame.
    target_m : (3,) float, m, body frame
        Where to come to rest.
    range_s : (float, float), s
        Shortest and longest time of flight.

    Returns
    -------
    float, s
        Of least J: the least of a scan, refined between its neighbours.
    """
    from scipy.optimize import minimize_scalar

    def cost(duration_s: float) -> float:
        return flown_cost(field, rotation_rate_rad_s, fly_for(r, v, target_m, duration_s))

    scan = np.geomspace(*range_s, _SCAN)
    costs = [cost(float(t)) for t in scan]
    best = int(np.argmin(costs))
    bounds = scan[max(best - 1, 0)], scan[min(best + 1, _SCAN - 1)]
    refined = minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 1e-6 * scan[best]})
    return float(refined.x if refined.fun < costs[best] else scan[best])


def flown_cost(field: GravityField, rotation_rate_rad_s: float, flight: GuidedFlight) -> float:
    """Integral of u'u of a flight of a single cubic, in the field it flies in, m2/s3.

    Parameters
    ----------
    field : GravityField
        The field.
    rotation_rate_rad_s : float, rad/s
        Spin rate about +z.
    flight : GuidedFlight
        From `fly_for`.
    """
    x, weight = _QUADRATURE
    t = 0.5 * flight.duration_s * (x + 1.0)
    r, v, a = flight.states(t)
    by_v, by_r = frame_slopes(rotation_rate_rad_s)
    u = a - accelerations(field, r) - r @ by_r.T - v @ by_v.T
    return float(0.5 * flight.duration_s * (weight @ (u * u).sum(axis=1)))


def _cubic(d: FloatArray, v: FloatArray, to_go_s: float) -> tuple[FloatArray, FloatArray]:
    """A and B of the cubic that brings (d, v) to rest on the target."""
    drift = to_go_s * v
    return (3.0 * d + drift) / to_go_s**2, -(2.0 * d + drift) / to_go_s**3
