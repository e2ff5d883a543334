"""Motion about one centre: Kepler's problem in universal variables, for every conic.

The universal anomaly s has ds/dt = 1/r. With beta = 2 mu/r - v^2 and the functions
G0 = cos(sqrt(beta) s), G1 = sin(sqrt(beta) s)/sqrt(beta), G2 = (1 - G0)/beta, G3 = (s - G1)/beta (Stumpff;
hyperbolic where beta < 0), Kepler's equation is t(s) = r0 G1 + (r.v)0 G2 + mu G3, which increases
with slope r(s) >= q. It is solved by Laguerre's method of degree 5 (Conway 1986), held in a bracket that
follows from that slope, so it cannot diverge.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.kernel import kernel, part

FloatArray = NDArray[np.float64]
State = tuple[float, float, float, float, float, float]

_ITERATIONS = 60
_CUBIC_ENOUGH = 1e-7  # relative step after which a third-order method is at rounding
_SERIES_BELOW = 0.5  # |beta s^2| under which the closed forms would cancel


@part
def stumpff_g(beta: float, s: float) -> tuple[float, float, float, float]:
    """The functions G0 to G3 of universal variables.

    Parameters
    ----------
    beta : float, m2/s2
        Minus twice the specific energy.
    s : float, s/m
        Universal anomaly.

    Returns
    -------
    tuple of 4 float
        G0 (1), G1 (s/m), G2 (s2/m2) and G3 (s3/m3).
    """
    psi = beta * s * s
    if abs(psi) < _SERIES_BELOW:
        c3 = c2 = 0.0
        for k in range(8, 0, -1):
            c3 = 1.0 - psi * c3 / ((2 * k + 2) * (2 * k + 3))
            c2 = 1.0 - psi * c2 / ((2 * k + 1) * (2 * k + 2))
        g2, g3 = 0.5 * s * s * c2, s * s * s / 6.0 * c3
        return 1.0 - beta * g2, s - beta * g3, g2, g3
    root = math.sqrt(abs(beta))
    if beta > 0.0:
        sine, cosine = math.sin(0.5 * root * s), math.cos(0.5 * root * s)
        g1, g2 = 2.0 * sine * cosine / root, 2.0 * sine * sine / beta
    else:
        sine, cosine = math.sinh(0.5 * root * s), math.cosh(0.5 * root * s)
        g1, g2 = 2.0 * sine * cosine / root, -2.0 * sine * sine / beta
    return 1.0 - beta * g2, g1, g2, (s - g1) / beta


@part
def universal_anomaly(mu: float, r0: float, sigma: float, beta: float, t: float) -> float:
    """Solve Kepler's equation in universal variables forwards in time.

    Parameters
    ----------
    mu : float, m3/s2
        Gravitational parameter.
    r0 : float, m
        Distance at the start.
    sigma : float, m2/s
        r.v at the start.
    beta : float, m2/s2
        Minus twice the specific energy.
    t : float, s
        Time of flight, not negative; on an ellipse less than a revolution.

    Returns
    -------
    float, s/m
        Universal anomaly; NaN where it did not converge.
    """
    # r(s) >= q, and r(s) >= mu s^2/2 about the periapsis of an open orbit
    square = max(0.0, 2.0 * mu * r0 - beta * r0 * r0 - sigma * sigma)  # angular momentum squared
    e = math.sqrt(max(0.0, 1.0 - beta * square / (mu * mu)))
    q = square / (mu * (1.0 + e))
    high = (24.0 * t / mu) ** (1.0 / 3.0) if beta <= 0.0 else 2.0 * math.pi / math.sqrt(beta)
    if q * high > t:
        high = t / q
    low = 0.0
    s = min(t / r0, high)
    if beta > 0.0:  # the mean motion is a fair guess
        s = min(high, t * beta / mu)
    for _ in range(_ITERATIONS):
        g0, g1, g2, g3 = stumpff_g(beta, s)
        excess = r0 * g1 + sigma * g2 + mu * g3 - t
        if excess > 0.0:
            high = s
        else:
            low = s
        slope = r0 + (mu - beta * r0) * g2 + sigma * g1  # r(s)
        curvature = sigma * g0 + (mu - beta * r0) * g1
        step = -5.0 * excess / (slope + math.sqrt(abs(16.0 * slope * slope - 20.0 * excess * curvature)))
        if abs(step) <= _CUBIC_ENOUGH * s:
            return s + step
        s = s + step if low < s + step < high else 0.5 * (low + high)
    return math.nan


@part
def kepler_state(
    mu: float, x: float, y: float, z: float, vx: float, vy: float, vz: float, dt: float
) -> State:
    """Fly a state along its conic.

    Parameters
    ----------
    mu : float, m3/s2
        Gravitational parameter.
    x, y, z : float, m, inertial frame about the centre
        Position; not the centre itself.
    vx, vy, vz : float, m/s
        Velocity.
    dt : float, s
        Time of flight, forwards or backwards.

    Returns
    -------
    tuple of 6 float, m and m/s
        Position and velocity; NaN where Kepler's equation did not converge.
    """
    r0 = math.sqrt(x * x + y * y + z * z)
    sigma = x * vx + y * vy + z * vz
    beta = 2.0 * mu / r0 - (vx * vx + vy * vy + vz * vz)
    t = abs(dt)
    if beta > 0.0:
        period = 2.0 * math.pi * mu / (beta * math.sqrt(beta))
        if t > period:
            t = t % period
    # backwards is forwards with the velocity turned round
    way = 1.0 if dt >= 0.0 else -1.0
    s = universal_anomaly(mu, r0, way * sigma, beta, t)
    _, g1, g2, _ = stumpff_g(beta, s)
    r = r0 + (mu - beta * r0) * g2 + way * sigma * g1
    # t - mu G3 would cancel over a long arc
    f, g = 1.0 - mu / r0 * g2, way * (r0 * g1 + way * sigma * g2)
    f_rate, g_rate = -way * mu / (r * r0) * g1, 1.0 - mu / r * g2
    return (
        f * x + g * vx,
        f * y + g * vy,
        f * z + g * vz,
        f_rate * x + g_rate * vx,
        f_rate * y + g_rate * vy,
        f_rate * z + g_rate * vz,
    )


@kernel
def kepler_batch(mu: float, states: FloatArray, dt: FloatArray, out: FloatArray) -> None:
    """Fly n states along their conics.

    Parameters
    ----------
    mu : float, m3/s2
        Gravitational parameter.
    states : (n, 6) float, m and m/s
        Position and velocity, inertial frame about the centre.
    dt : (n,) float, s
        Times of flight.
    out : (n, 6) float
        Receives the states; may be ``states`` itself.
    """
    for i in range(states.shape[0]):
        x, y, z, vx, vy, vz = kepler_state(
            mu, states[i, 0], states[i, 1], states[i, 2], states[i, 3], states[i, 4], states[i, 5], dt[i]
        )
        out[i, 0], out[i, 1], out[i, 2] = x, y, z
        out[i, 3], out[i, 4], out[i, 5] = vx, vy, vz


def propagate_kepler(states: ArrayLike, dt_s: ArrayLike, mu_m3_s2: float) -> FloatArray:
    """Fly states along their conics.

    Parameters
    ----------
    states : (6,) or (n, 6) float, m and m/s
        Position and velocity, inertial frame about the centre.
    dt_s : float or (n,) float, s
        Times of flight, forwards or backwards.
    mu_m3_s2 : float, m3/s2
        Gravitational parameter of the centre.

    Returns
    -------
    (n, 6) float, m and m/s
        One row for each state or time; NaN where Kepler's equation did not converge.
    """
    dt = np.atleast_1d(np.asarray(dt_s, dtype=np.float64))
    rows = np.atleast_2d(np.asarray(states, dtype=np.float64))
    n = max(len(rows), len(dt))
    out = np.zeros((n, 6))
    start = np.ascontiguousarray(np.broadcast_to(rows, (n, 6)))
    kepler_batch(mu_m3_s2, start, np.ascontiguousarray(np.broadcast_to(dt, (n,))), out)
    return out
