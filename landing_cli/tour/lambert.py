"""Lambert's problem with any number of revolutions: Izzo 2015, "Revisiting Lambert's problem".

One departure from the paper: lambda and sigma come from half the transfer angle, not from differences of
sides, and y + lambda x is formed without cancellation, so that arcs near 180 degrees lose no more than their
plane itself does (1/sin of the angle). `lambert_time` finds x.

Every arc is prograde: its angular momentum does not point below the frame's xy plane.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.kernel import kernel, part
from landing_cli.tour.lambert_time import solve_x

FloatArray = NDArray[np.float64]
# r1, r2, s, lambda, 1 - lambda^2, sigma, rho, unit vectors of r1, r2, and of the angular momentum
Geometry = tuple[
    float, float, float, float, float, float, float,
    float, float, float, float, float, float, float, float, float,
]  # fmt: skip
Velocities = tuple[float, float, float, float, float, float]


@part
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


@part
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


@part
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
