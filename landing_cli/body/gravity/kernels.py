"""The gravity models behind one set of functions: which one is flown in is said by the ``kind``.

Every function takes ``(kind, params, x, y, z)``: ``field.kind``, ``field.params`` and a position in the
body frame, m. Second derivatives are ordered xx, yy, zz, xy, xz, yz. Nothing is allocated, and a position at
a singularity gives inf or nan. How a kind becomes code: see `models`.
"""

from __future__ import annotations

from typing import Any

from landing_cli.body.gravity import models
from landing_cli.body.gravity.field import GravityKind
from landing_cli.body.gravity.kernel_types import Params, Symmetric, Vector, VectorAndSymmetric
from landing_cli.kernel import kernel, part

_potential: Any = models.called(models.POTENTIAL)
_acceleration: Any = models.called(models.ACCELERATION)
_acceleration_and_gradient: Any = models.called(models.ACCELERATION_AND_GRADIENT)
_curvature: Any = models.called(models.CURVATURE)


@part
def potential(kind: GravityKind, params: Params, x: float, y: float, z: float) -> float:
    """Return the potential U, m2/s2, positive (GM/r + ...)."""
    return _potential(kind, params, x, y, z)


@kernel
def acceleration(kind: GravityKind, params: Params, x: float, y: float, z: float) -> Vector:
    """Return the acceleration (gx, gy, gz), m/s2: the gradient of U."""
    return _acceleration(kind, params, x, y, z)


@part
def acceleration_and_gradient(
    kind: GravityKind, params: Params, x: float, y: float, z: float
) -> VectorAndSymmetric:
    """Return the acceleration, m/s2, then its gradient, 1/s2: nine numbers that share their work."""
    return _acceleration_and_gradient(kind, params, x, y, z)


@part
def gradient(kind: GravityKind, params: Params, x: float, y: float, z: float) -> Symmetric:
    """Return the acceleration's gradient (gxx, gyy, gzz, gxy, gxz, gyz), 1/s2: the Hessian of U."""
    g = acceleration_and_gradient(kind, params, x, y, z)
    return g[3], g[4], g[5], g[6], g[7], g[8]


@part
def curvature(
    kind: GravityKind, params: Params, x: float, y: float, z: float, lx: float, ly: float, lz: float
) -> Symmetric:
    """Return sum_k d3U/(dxi dxj dxk) l_k, in the gradient's order, 1/(m s2) times the unit of l."""
    return _curvature(kind, params, x, y, z, lx, ly, lz)
