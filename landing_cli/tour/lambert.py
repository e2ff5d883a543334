"""Lambert's problem with any number of revolutions: Izzo 2015, "Revisiting Lambert's problem".

The unknown is x of Lancaster and Blanchard (x = 1 on the parabola, x < 1 on ellipses); Householder's
third-order iteration finds it from Izzo's starting values, held in a bracket. Departures from the paper:

- lambda and sigma come from half the transfer angle, not from differences of sides, so that arcs near 180
  degrees lose no more than the plane itself does (1/sin of the angle);
- eta = y - lambda x and y + lambda x are formed without cancellation for either sign of lambda;
- Battin's series (eq 20) is used wherever it converges quickly, not only next to the parabola;
- the starting value between T1 and T0 is (T/T0)^(ln 2/ln(T1/T0)) - 1, which passes through both ends; eq 30
  prints a logarithm that does not.

Every arc is prograde: its angular momentum does not point below the frame's xy plane.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.kernel import kernel

FloatArray = NDArray[np.float64]
# r1, r2, s, lambda, 1 - lambda^2, sigma, rho, unit vectors of r1, r2, and of the angular momentum
Geometry = tuple[
    float, float, float, float, float, float, float,
    float, float, float, float, float, float, float, float, float,
]  # fmt: skip
Velocities = tuple[float, float, float, float, float, float]

_STEP = 1e-6  # the iteration is of order 4
_ITERATIONS = 25
_SERIES_BELOW = 0.1
_PARABOLIC = 1e-5


@kernel
def time_of_flight(lam: float, rest: float, turns: int, x: float) -> float:
    """Dimensionless time of flight T(x) (Izzo 2015, eqs 18-20).

    Parameters
    ----------
    lam : float
        lambda, between -1 and 1.
    rest : float
        ``1 - lambda^2``.
    turns : int
        Whole revolutions.
    x : float
        Above -1; below 1 where ``turns`` is not 0.

    Returns
    -------
    float
    """
    u = (1.0 - x) * (1.0 + x)
    y = math.sqrt(rest + lam * lam * x * x)
    eta = rest / (y + lam * x) if lam * x > 0.0 else y - lam * x
    s1 = 0.5 * (1.0 - lam - x * eta)
    if abs(s1) < _SERIES_BELOW and x > 0.0:
        q = 1.0
        for n in range(17, -1, -1):
            q = 1.0 + (3.0 + n) / (2.5 + n) * s1 * q
        t = 0.5 * eta * (4.0 / 3.0 * eta * eta * q + 4.0 * lam)
        return t + turns * math.pi / (u * math.sqrt(u)) if turns else t
    root = math.sqrt(abs(u))
    if u > 0.0:
        psi = math.atan2(eta * root, x * y + lam * u) + turns * math.pi
    else:
        psi = math.asinh(eta * root)
    return (psi / root - x + lam * y) / u


@kernel
def time_slopes(lam: float, rest: float, x: float, t: float) -> tuple[float, float, float]:
    """First three derivatives of T(x) (Izzo 2015, eq 22).

    Parameters
    ----------
    lam : float
        lambda, between -1 and 1.
    rest : float
        ``1 - lambda^2``.
    x : float
        Not on the parabola, x = 1.
    t : float
        T(x).

    Returns
    -------
    tuple of 3 float
    """
    u = (1.0 - x) * (1.0 + x)
    square = lam * lam
    y2 = rest + square * x * x
    y = math.sqrt(y2)
    cube = square * lam / y
    first = (3.0 * t * x - 2.0 + 2.0 * cube * x) / u
    second = (3.0 * t + 5.0 * x * first + 2.0 * rest * cube / y2) / u
    third = (7.0 * x * second + 8.0 * first - 6.0 * rest * cube * square * x / (y2 * y2)) / u
    return first, second, third


@kernel
def least_time(lam: float, rest: float, turns: int) -> tuple[float, float]:
    """Shortest flight with some revolutions (Izzo 2015, section 2.3), by Halley's iteration on T'(x) = 0.

    Parameters
    ----------
    lam : float
        lambda, between -1 and 1.
    rest : float
        ``1 - lambda^2``.
    turns : int
        Whole revolutions, at least 1.

    Returns
    -------
    tuple of 2 float
        x and T there.
    """
    x = 0.1
    for _ in range(_ITERATIONS):
        t = time_of_flight(lam, rest, turns, x)
        first, second, third = time_slopes(lam, rest, x, t)
        step = -2.0 * first * second / (2.0 * second * second - first * third)
        x = max(-0.9999, min(0.9999, x + step))
        if abs(step) < 1e-9:
            break
    return x, time_of_flight(lam, rest, turns, x)


@kernel
def solve_x(lam: float, rest: float, t: float, turns: int, right: bool) -> float:
    """Find x for a time of flight (Izzo 2015, algorithm 2).

    Parameters
    ----------
    lam : float
        lambda, between -1 and 1.
    rest : float
        ``1 - lambda^2``.
    t : float
        Dimensionless time of flight, above 0.
    turns : int
        Whole revolutions.
    right : bool
        With revolutions: the root of larger x (the smaller semi-major axis on a slow arc).

    Returns
    -------
    float
        NaN where no such arc exists.
    """
    t0 = math.acos(lam) + lam * math.sqrt(rest)
    if turns == 0:
        t1 = 2.0 / 3.0 * (1.0 - lam * lam * lam)
        if t >= t0:
            x = (t0 / t) ** (2.0 / 3.0) - 1.0
        elif t < t1:
            x = 1.0 + 2.5 * t1 * (t1 - t) / (t * (1.0 - lam**5))
        else:
            x = math.exp(math.log(2.0) * math.log(t / t0) / math.log(t1 / t0)) - 1.0
        low, high = -1.0, math.inf
    else:
        low, high = -1.0, 1.0
        if t < t0 + turns * math.pi + 0.2:  # near the fold the starting values may lie on the other branch
            fold, least = least_time(lam, rest, turns)
            if t < least:
                return math.nan
            low, high = (fold, 1.0) if right else (-1.0, fold)
        if right:
            x = (8.0 * t / (turns * math.pi)) ** (2.0 / 3.0)
        else:
            x = ((turns + 1.0) * math.pi / (8.0 * t)) ** (2.0 / 3.0)
        x = (x - 1.0) / (x + 1.0)
        if not low < x < high:
            x = 0.5 * (low + high)
    rising = turns > 0 and right
    for _ in range(_ITERATIONS):
        found = time_of_flight(lam, rest, turns, x)
        excess = found - t
        if (excess > 0.0) == rising:
            high = x
        else:
            low = x
        if abs(1.0 - x) < _PARABOLIC and turns == 0:
            step = excess / (0.4 * (1.0 - lam**5))  # the slope on the parabola, to first order
        else:
            first, second, third = time_slopes(lam, rest, x, found)
            below = first * (first * first - excess * second) + third * excess * excess / 6.0
            step = -excess * (first * first - 0.5 * excess * second) / below
        if abs(step) < _STEP * (1.0 + x) and (turns == 0 or abs(step) < 1e-3 * (high - low)):
            return x + step
        if low < x + step < high:
            x = x + step
        elif high < math.inf:
            x = 0.5 * (low + high)
        else:
            x = 2.0 * x + 1.0
    return x if abs(excess) < 1e-13 * t else math.nan


@kernel
def arc_geometry(x1: float, y1: float, z1: float, x2: float, y2: float, z2: float) -> Geometry:
    """What an arc between two positions has whatever its time of flight.

    Parameters
    ----------
    x1, y1, z1, x2, y2, z2 : float, m
        Positions about the centre.

    Returns
    -------
    tuple of 16 float
        r1, r2, s (m), lambda, ``1 - lambda^2``, sigma, rho, and unit vectors of the positions and of the
        angular momentum, which is NaN where the positions lie on one line.
    """
    r1 = math.sqrt(x1 * x1 + y1 * y1 + z1 * z1)
    r2 = math.sqrt(x2 * x2 + y2 * y2 + z2 * z2)
    ax, ay, az, bx, by, bz = x1 / r1, y1 / r1, z1 / r1, x2 / r2, y2 / r2, z2 / r2
    hx, hy, hz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    h = math.sqrt(hx * hx + hy * hy + hz * hz)
    c = math.sqrt((x2 - x1) ** 2 + (y2 - y1) ** 2 + (z2 - z1) ** 2)
    s = 0.5 * (r1 + r2 + c)
    mean = math.sqrt(r1 * r2)
    cosine = 0.5 * math.sqrt((ax + bx) ** 2 + (ay + by) ** 2 + (az + bz) ** 2)  # of half the angle
    sine = 0.5 * math.sqrt((ax - bx) ** 2 + (ay - by) ** 2 + (az - bz) ** 2)
    lam = mean * cosine / s
    scale = 1.0 / h if h > 0.0 else math.nan
    if hz < 0.0:  # the short way round is retrograde
        lam, scale = -lam, -scale
    return (
        r1, r2, s, lam, c / s, 2.0 * mean * sine / c, (r1 - r2) / c,
        ax, ay, az, bx, by, bz, scale * hx, scale * hy, scale * hz,
    )  # fmt: skip


@kernel
def arc_velocities(mu: float, geometry: Geometry, x: float) -> Velocities:
    """Velocities at both ends of an arc (Izzo 2015, algorithm 1).

    Parameters
    ----------
    mu : float, m3/s2
        Gravitational parameter.
    geometry : tuple of 16 float
        Of `arc_geometry`.
    x : float
        Of `solve_x`.

    Returns
    -------
    tuple of 6 float, m/s
        At the first position, then at the second.
    """
    r1, r2, s, lam, rest, sigma, rho, ax, ay, az, bx, by, bz, hx, hy, hz = geometry
    y = math.sqrt(rest + lam * lam * x * x)
    gamma = math.sqrt(0.5 * mu * s)
    across = gamma * sigma * (rest / (y - lam * x) if lam * x < 0.0 else y + lam * x)
    one = gamma * ((lam * y - x) - rho * (lam * y + x)) / r1
    two = -gamma * ((lam * y - x) + rho * (lam * y + x)) / r2
    t1, t2 = across / r1, across / r2
    return (
        one * ax + t1 * (hy * az - hz * ay),
        one * ay + t1 * (hz * ax - hx * az),
        one * az + t1 * (hx * ay - hy * ax),
        two * bx + t2 * (hy * bz - hz * by),
        two * by + t2 * (hz * bx - hx * bz),
        two * bz + t2 * (hx * by - hy * bx),
    )


@kernel
def lambert_arc(
    mu: float,
    x1: float,
    y1: float,
    z1: float,
    x2: float,
    y2: float,
    z2: float,
    tof: float,
    turns: int,
    right: bool,
) -> Velocities:
    """Solve one arc.

    Parameters
    ----------
    mu : float, m3/s2
        Gravitational parameter.
    x1, y1, z1, x2, y2, z2 : float, m
        Positions about the centre, not on one line with it.
    tof : float, s
        Time of flight, above 0.
    turns : int
        Whole revolutions.
    right : bool
        With revolutions: which of the two arcs; without effect otherwise.

    Returns
    -------
    tuple of 6 float, m/s
        Velocity at the first position, then at the second; NaN where no such arc exists.
    """
    geometry = arc_geometry(x1, y1, z1, x2, y2, z2)
    s = geometry[2]
    t = math.sqrt(2.0 * mu / s) / s * tof
    return arc_velocities(mu, geometry, solve_x(geometry[3], geometry[4], t, turns, right))


@kernel
def lambert_arcs(
    mu: float,
    x1: float,
    y1: float,
    z1: float,
    x2: float,
    y2: float,
    z2: float,
    tof: float,
    turns_max: int,
    out: FloatArray,
) -> int:
    """Solve all arcs of one transfer: the direct one and both of each number of revolutions.

    Parameters
    ----------
    mu : float, m3/s2
        Gravitational parameter.
    x1, y1, z1, x2, y2, z2 : float, m
        Positions about the centre, not on one line with it.
    tof : float, s
        Time of flight, above 0.
    turns_max : int
        Most whole revolutions.
    out : (at least 2 turns_max + 1, 6) float, m/s
        Receives the velocities at both ends: row 0 the direct arc, rows ``2 n - 1`` and ``2 n`` the left
        and the right arc of n revolutions.

    Returns
    -------
    int
        Rows that were written: arcs of more revolutions do not exist.
    """
    geometry = arc_geometry(x1, y1, z1, x2, y2, z2)
    s, lam, rest = geometry[2], geometry[3], geometry[4]
    t = math.sqrt(2.0 * mu / s) / s * tof
    for row in range(2 * turns_max + 1):
        turns = (row + 1) // 2
        if t < turns * math.pi:
            return row
        x = solve_x(lam, rest, t, turns, row % 2 == 0)
        if not math.isfinite(x) and turns > 0:
            return row if row % 2 else row - 1
        a, b, c, d, e, f = arc_velocities(mu, geometry, x)
        out[row, 0], out[row, 1], out[row, 2], out[row, 3], out[row, 4], out[row, 5] = a, b, c, d, e, f
    return 2 * turns_max + 1


@kernel
def lambert_batch(
    mu: float,
    first: FloatArray,
    second: FloatArray,
    tof: FloatArray,
    turns: NDArray[np.int64],
    right: NDArray[np.bool_],
    out: FloatArray,
) -> None:
    """Solve n arcs.

    Parameters
    ----------
    mu : float, m3/s2
        Gravitational parameter.
    first, second : (n, 3) float, m
        Positions about the centre.
    tof : (n,) float, s
        Times of flight, above 0.
    turns : (n,) int
        Whole revolutions.
    right : (n,) bool
        With revolutions: which of the two arcs.
    out : (n, 6) float, m/s
        Receives the velocities at both ends; NaN where no such arc exists.
    """
    for i in range(first.shape[0]):
        a, b, c, d, e, f = lambert_arc(
            mu,
            first[i, 0],
            first[i, 1],
            first[i, 2],
            second[i, 0],
            second[i, 1],
            second[i, 2],
            tof[i],
            turns[i],
            right[i],
        )
        out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4], out[i, 5] = a, b, c, d, e, f


def solve_lambert(
    first_m: ArrayLike,
    second_m: ArrayLike,
    tof_s: ArrayLike,
    mu_m3_s2: float,
    revolutions: ArrayLike = 0,
    right: ArrayLike = False,
) -> tuple[FloatArray, FloatArray]:
    """Solve arcs between positions.

    Parameters
    ----------
    first_m, second_m : (3,) or (n, 3) float, m
        Positions about the centre, not on one line with it.
    tof_s : float or (n,) float, s
        Times of flight, above 0.
    mu_m3_s2 : float, m3/s2
        Gravitational parameter of the centre.
    revolutions : int or (n,) int
        Whole revolutions.
    right : bool or (n,) bool
        With revolutions: the arc of larger x; without effect otherwise.

    Returns
    -------
    tuple of two (n, 3) float, m/s
        Velocities at the first and at the second position, prograde; NaN where no such arc exists.
    """
    first = np.atleast_2d(np.asarray(first_m, dtype=np.float64))
    second = np.atleast_2d(np.asarray(second_m, dtype=np.float64))
    sizes = (len(first), len(second), *(np.size(value) for value in (tof_s, revolutions, right)))
    n = max(sizes)
    out = np.zeros((n, 6))
    lambert_batch(
        mu_m3_s2,
        np.ascontiguousarray(np.broadcast_to(first, (n, 3))),
        np.ascontiguousarray(np.broadcast_to(second, (n, 3))),
        np.ascontiguousarray(np.broadcast_to(np.asarray(tof_s, dtype=np.float64), (n,))),
        np.ascontiguousarray(np.broadcast_to(np.asarray(revolutions, dtype=np.int64), (n,))),
        np.ascontiguousarray(np.broadcast_to(np.asarray(right, dtype=np.bool_), (n,))),
        out,
    )
    return out[:, :3], out[:, 3:]
