"""Bezier curves flown in time: basis, derivatives, and the control points that boundary conditions fix.

Lyu 2026, eqs 6-11. Departures: its eq 7 prints n! for i! in the denominator; its eqs 8-9 and 29 print
B_{n-2,i} for the bases of both derivatives, sum one term too many, lack the 2 of the second difference and
the powers of 1/t_f. Here the k-th derivative is n!/(n-k)! B_{i,n-k} over the k-th differences, over t_f^k.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

LEAST_DEGREE = 5
"""Position, velocity and acceleration at both ends fix six control points."""


def bernstein(degree: int, tau: ArrayLike) -> FloatArray:
    """Bernstein polynomials (Lyu 2026, eq 7, with i! for the first n! of its denominator).

    Parameters
    ----------
    degree : int
        n.
    tau : (k,) float
        Share of the curve, 0 to 1.

    Returns
    -------
    (k, n + 1) float
        ``B_{i,n}(tau)`` in column i; every row sums to 1.
    """
    tau = np.asarray(tau, dtype=np.float64)[:, None]
    binomials = np.array([math.comb(degree, k) for k in range(degree + 1)], dtype=np.float64)
    return np.asarray(binomials * _powers(tau, degree) * _powers(1.0 - tau, degree)[:, ::-1])


def _powers(x: FloatArray, degree: int) -> FloatArray:
    """Powers 0 to degree of every x (k, 1), (k, degree + 1): products, which are faster than ``**``."""
    factors = np.repeat(x, degree + 1, axis=1)
    factors[:, 0] = 1.0
    return np.multiply.accumulate(factors, axis=1)


def bezier_basis(degree: int, tau: ArrayLike, order: int = 0) -> FloatArray:
    """Matrix that takes control points to a derivative of the curve by its share tau.

    Parameters
    ----------
    degree : int
        n.
    tau : (k,) float
        Share of the curve, 0 to 1.
    order : int
        Which derivative; 0 is the curve itself.

    Returns
    -------
    (k, n + 1) float
        M such that the derivative is ``M @ P`` for control points P, (n + 1, 3).
    """
    differences = np.diff(np.eye(degree + 1), order, axis=0)
    return np.asarray(math.perm(degree, order) * bernstein(degree - order, tau) @ differences)


def curve_states(
    points_m: FloatArray, duration_s: float, tau: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Position, velocity and acceleration along a curve (Lyu 2026, eqs 6, 8, 9, corrected).

    Parameters
    ----------
    points_m : (n + 1, 3) float, m
        Control points, n >= 2.
    duration_s : float, s
        t_f: the time from tau = 0 to 1.
    tau : (k,) float
        Share of the curve, 0 to 1.

    Returns
    -------
    r, v, a : (k, 3) float, m, m/s, m/s2, in the frame of the control points
    """
    n = len(points_m) - 1
    r, v, a = (bezier_basis(n, tau, order) @ points_m / duration_s**order for order in range(3))
    return r, v, a


def curve_jerks(points_m: FloatArray, duration_s: float, tau: ArrayLike) -> FloatArray:
    """Rate of the acceleration along a curve (Lyu 2026, eq 35, which lacks 1/t_f^3).

    Parameters
    ----------
    points_m : (n + 1, 3) float, m
        Control points, n >= 3.
    duration_s : float, s
        t_f: the time from tau = 0 to 1.
    tau : (k,) float
        Share of the curve, 0 to 1.

    Returns
    -------
    (k, 3) float, m/s3, in the frame of the control points
    """
    return np.asarray(bezier_basis(len(points_m) - 1, tau, 3) @ points_m / duration_s**3)


def first_control_points(
    degree: int, duration_s: float, r: ArrayLike, v: ArrayLike, a: ArrayLike
) -> FloatArray:
    """P_0, P_1, P_2 of a curve that begins with a given state (Lyu 2026, eq 10).

    Parameters
    ----------
    degree : int
        n, at least 2.
    duration_s : float, s
        t_f.
    r, v, a : (3,) float, m, m/s, m/s2
        Position, velocity and acceleration at the start.

    Returns
    -------
    (3, 3) float, m
    """
    r, v, a = (np.asarray(x, dtype=np.float64) for x in (r, v, a))
    step, bend = v * duration_s / degree, a * duration_s**2 / (degree * (degree - 1))
    return np.stack([r, r + step, r + 2.0 * step + bend])


def last_control_points(
    degree: int, duration_s: float, r: ArrayLike, v: ArrayLike, a: ArrayLike
) -> FloatArray:
    """P_{n-2}, P_{n-1}, P_n of a curve that ends with a given state (Lyu 2026, eq 10).

    Parameters
    ----------
    degree : int
        n, at least 2.
    duration_s : float, s
        t_f.
    r, v, a : (3,) float, m, m/s, m/s2
        Position, velocity and acceleration at the end.

    Returns
    -------
    (3, 3) float, m
    """
    return first_control_points(degree, -duration_s, r, v, a)[::-1].copy()
