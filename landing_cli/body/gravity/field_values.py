"""Gravity at many points, as arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.kernels import acceleration, acceleration_and_gradient, gradient, potential
from landing_cli.kernel import kernel

FloatArray = NDArray[np.float64]


def potentials(field: GravityField, points: ArrayLike) -> FloatArray:
    """Return the potential at every point.

    Parameters
    ----------
    field : GravityField
        The gravity model.
    points : (n, 3) float, m, body frame
        Where to evaluate it.

    Returns
    -------
    (n,) float, m2/s2
        Positive: GM/r + ...
    """
    points = _rows(points)
    values = np.zeros(len(points))
    _fill_potentials(field.kind, field.params.copy(), points, values)
    return values


def accelerations(field: GravityField, points: ArrayLike) -> FloatArray:
    """Return the gravitational acceleration at every point.

    Parameters
    ----------
    field : GravityField
        The gravity model.
    points : (n, 3) float, m, body frame
        Where to evaluate it.

    Returns
    -------
    (n, 3) float, m/s2, body frame
    """
    points = _rows(points)
    values = np.zeros((len(points), 3))
    _fill_accelerations(field.kind, field.params.copy(), points, values)
    return values


def gradients(field: GravityField, points: ArrayLike) -> FloatArray:
    """Return the gradient of the acceleration at every point.

    Parameters
    ----------
    field : GravityField
        The gravity model.
    points : (n, 3) float, m, body frame
        Where to evaluate it.

    Returns
    -------
    (n, 3, 3) float, 1/s2, body frame
        Symmetric; ``[k, i, j]`` is the derivative of component i along axis j.
    """
    points = _rows(points)
    values = np.zeros((len(points), 3, 3))
    _fill_gradients(field.kind, field.params.copy(), points, values)
    return values


def accelerations_and_gradients(field: GravityField, points: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the acceleration and its gradient at every point, which share their work.

    Parameters
    ----------
    field : GravityField
        The gravity model.
    points : (n, 3) float, m, body frame
        Where to evaluate them.

    Returns
    -------
    g : (n, 3) float, m/s2, body frame
    G : (n, 3, 3) float, 1/s2
        ``[k, i, j]`` is the derivative of component i along axis j.
    """
    points = _rows(points)
    g, G = np.zeros((len(points), 3)), np.zeros((len(points), 3, 3))
    _fill_both(field.kind, field.params.copy(), points, g, G)
    return g, G


def _rows(points: ArrayLike) -> FloatArray:
    return np.array(points, dtype=np.float64, order="C").reshape(-1, 3)


@kernel
def _fill_potentials(kind: GravityKind, params: FloatArray, points: FloatArray, values: FloatArray) -> None:
    for i in range(len(points)):
        values[i] = potential(kind, params, points[i, 0], points[i, 1], points[i, 2])


@kernel
def _fill_accelerations(
    kind: GravityKind, params: FloatArray, points: FloatArray, values: FloatArray
) -> None:
    for i in range(len(points)):
        gx, gy, gz = acceleration(kind, params, points[i, 0], points[i, 1], points[i, 2])
        values[i, 0], values[i, 1], values[i, 2] = gx, gy, gz


@kernel
def _fill_gradients(kind: GravityKind, params: FloatArray, points: FloatArray, values: FloatArray) -> None:
    for i in range(len(points)):
        xx, yy, zz, xy, xz, yz = gradient(kind, params, points[i, 0], points[i, 1], points[i, 2])
        values[i, 0, 0], values[i, 1, 1], values[i, 2, 2] = xx, yy, zz
        values[i, 0, 1], values[i, 0, 2], values[i, 1, 2] = xy, xz, yz
        values[i, 1, 0], values[i, 2, 0], values[i, 2, 1] = xy, xz, yz


@kernel
def _fill_both(
    kind: GravityKind, params: FloatArray, points: FloatArray, g: FloatArray, G: FloatArray
) -> None:
    for i in range(len(points)):
        gx, gy, gz, xx, yy, zz, xy, xz, yz = acceleration_and_gradient(
            kind, params, points[i, 0], points[i, 1], points[i, 2]
        )
        g[i, 0], g[i, 1], g[i, 2] = gx, gy, gz
        G[i, 0, 0], G[i, 1, 1], G[i, 2, 2] = xx, yy, zz
        G[i, 0, 1], G[i, 0, 2], G[i, 1, 2] = xy, xz, yz
        G[i, 1, 0], G[i, 2, 0], G[i, 2, 1] = xy, xz, yz
