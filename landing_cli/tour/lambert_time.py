"""Dimensionless time of flight of a Lambert arc, and its inverse: Izzo 2015, "Revisiting Lambert's problem".

The unknown is x of Lancaster and Blanchard (x = 1 on the parabola, x < 1 on ellipses); Householder's
third-order iteration finds it from Izzo's starting values, held in a bracket. Departures from the paper:

- eta = y - lambda x is formed without cancellation for either sign of lambda;
- Battin's series (eq 20) is used wherever it converges quickly, not only next to the parabola;
- the starting value between T1 and T0 is (T/T0)^(ln 2/ln(T1/T0)) - 1, which passes through both ends; eq 30
  prints a logarithm that does not.
"""

from __future__ import annotations

import math

from landing_cli.kernel import part

_STEP = 1e-6  # the iteration is of order 4
_ITERATIONS = 25
_SERIES_BELOW = 0.1
_PARABOLIC = 1e-5


@part
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


@part
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


@part
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


@part
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
