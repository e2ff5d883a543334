"""The least-volume axis-aligned ellipsoid about the origin that holds every vertex."""

from __future__ import annotations

import numpy as np

from landing_cli.body.mesh import FloatArray
from landing_cli.errors import InputRefused

_ROUNDS = 200


def least_volume_ellipsoid(points: FloatArray) -> FloatArray:
    """Find the semi-axes of the smallest ellipsoid, aligned with the axes and centred on the origin.

    Parameters
    ----------
    points : (n, 3) float, m
        Not all in one coordinate plane.

    Returns
    -------
    (3,) float, m
        Semi-axes (a, b, c): x^2/a^2 + y^2/b^2 + z^2/c^2 <= 1 for every point, to the last bit.

    Raises
    ------
    InputRefused
        If the points are not finite or lie in a coordinate plane.

    Notes
    -----
    With w = (1/a^2, 1/b^2, 1/c^2) the problem is convex: maximise sum log w subject to
    (points^2) w <= 1. It is solved on a few points, and the point that sticks out most joins them
    until none does; at most three points bind in the end.
    """
    if not np.isfinite(points).all():
        raise InputRefused("the points of the ellipsoid are not all finite")
    reach = np.abs(points).max(axis=0)
    if not (reach > 0.0).all():
        raise InputRefused("the points lie in a coordinate plane, so that no least ellipsoid exists")
    squares = (points / reach) ** 2
    working = list(dict.fromkeys(np.argmax(squares, axis=0).tolist()))
    for _ in range(_ROUNDS):
        weights = _solve_few(squares[working])
        levels = squares @ weights
        worst = int(np.argmax(levels))
        if levels[worst] <= 1.0 + 1e-13 or worst in working:
            break
        working.append(worst)
    return _grown_to_hold(reach / np.sqrt(weights), points)


def _solve_few(squares: FloatArray) -> FloatArray:
    """Maximise sum log w subject to squares @ w <= 1 by a primal barrier and Newton's method."""
    weights = np.full(3, 0.5) / squares.sum(axis=1).max()
    barrier = 1.0
    while barrier > 1e-12:
        for _ in range(60):
            slack = 1.0 - squares @ weights
            gradient = 1.0 / weights - barrier * squares.T @ (1.0 / slack)
            hessian = np.diag(1.0 / weights**2) + barrier * (squares / slack[:, None] ** 2).T @ squares
            step = np.linalg.solve(hessian, gradient)
            decrement = float(gradient @ step)
            weights = weights + _longest_inside(weights, slack, squares @ step, step) * step
            if decrement < 1e-20:
                break
        barrier *= 0.2
    return weights


def _longest_inside(weights: FloatArray, slack: FloatArray, rise: FloatArray, step: FloatArray) -> float:
    """Return the share of a Newton step, at most 1, that keeps weights and slacks positive."""
    fall = np.concatenate([-step / weights, rise / slack])
    return min(1.0, 0.9 / max(float(fall.max()), 1e-300))


def _grown_to_hold(semi_axes: FloatArray, points: FloatArray) -> FloatArray:
    """Scale the semi-axes until no point is outside in floating point, however it is evaluated."""
    semi_axes = semi_axes * np.sqrt(max(float(((points / semi_axes) ** 2).sum(axis=1).max()), 1e-300))
    while _level(semi_axes, points) > 1.0:
        semi_axes = semi_axes * (1.0 + 4.0 * np.finfo(float).eps)
    return semi_axes


def _level(semi_axes: FloatArray, points: FloatArray) -> float:
    by_quotient = ((points / semi_axes) ** 2).sum(axis=1)
    by_inverse = points**2 @ (1.0 / semi_axes**2)
    return float(max(by_quotient.max(), by_inverse.max()))
