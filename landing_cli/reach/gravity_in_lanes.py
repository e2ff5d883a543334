"""Gravity at one position, or at a position of each lane (`kernel_lanes`).

Harmonics, which fly most cases, are computed in all lanes at once; the other models one lane after another.
"""

from __future__ import annotations

from typing import Any

from numba import extending

from landing_cli.body.gravity import kernels
from landing_cli.body.gravity.field import GravityKind
from landing_cli.body.gravity.harmonics import harmonics_acceleration, harmonics_acceleration_and_gradient
from landing_cli.body.gravity.kernel_types import Params, Vector, VectorAndSymmetric
from landing_cli.body.gravity.models import number_of
from landing_cli.kernel import part
from landing_cli.kernel_lanes import WIDTH, lane, lanes, with_lane

_overload: Any = extending.overload
_HARMONICS = int(GravityKind.HARMONICS)
_plain_acceleration, _plain_both = kernels.acceleration, kernels.acceleration_and_gradient


def acceleration(kind: GravityKind, params: Params, x: float, y: float, z: float) -> Vector:
    """Return the acceleration (gx, gy, gz), m/s2, of positions in the body frame, m."""
    raise NotImplementedError


def acceleration_and_gradient(
    kind: GravityKind, params: Params, x: float, y: float, z: float
) -> VectorAndSymmetric:
    """Return the acceleration, m/s2, then its gradient, 1/s2, of positions in the body frame, m."""
    raise NotImplementedError


@part
def _accelerations(kind: GravityKind, params: Params, x: float, y: float, z: float) -> Vector:
    if number_of(kind) == _HARMONICS:
        return harmonics_acceleration(params, x, y, z)
    gx, gy, gz = x, y, z
    for k in range(WIDTH):
        g = _plain_acceleration(kind, params, lane(x, k), lane(y, k), lane(z, k))
        gx, gy, gz = with_lane(gx, k, g[0]), with_lane(gy, k, g[1]), with_lane(gz, k, g[2])
    return gx, gy, gz


@part
def _accelerations_and_gradients(
    kind: GravityKind, params: Params, x: float, y: float, z: float
) -> VectorAndSymmetric:
    if number_of(kind) == _HARMONICS:
        return harmonics_acceleration_and_gradient(params, x, y, z)
    a, b, c, xx, yy, zz, xy, xz, yz = x, y, z, x, x, x, x, x, x
    for k in range(WIDTH):
        g = _plain_both(kind, params, lane(x, k), lane(y, k), lane(z, k))
        a, b, c = with_lane(a, k, g[0]), with_lane(b, k, g[1]), with_lane(c, k, g[2])
        xx, yy, zz = with_lane(xx, k, g[3]), with_lane(yy, k, g[4]), with_lane(zz, k, g[5])
        xy, xz, yz = with_lane(xy, k, g[6]), with_lane(xz, k, g[7]), with_lane(yz, k, g[8])
    return a, b, c, xx, yy, zz, xy, xz, yz


@_overload(acceleration, inline="always", strict=False)
def _acceleration(kind: Any, params: Any, x: Any, y: Any, z: Any) -> Any:
    one = _accelerations if lanes in (x, y, z) else _plain_acceleration
    return lambda kind, params, x, y, z: one(kind, params, x, y, z)


@_overload(acceleration_and_gradient, inline="always", strict=False)
def _acceleration_and_gradient(kind: Any, params: Any, x: Any, y: Any, z: Any) -> Any:
    one = _accelerations_and_gradients if lanes in (x, y, z) else _plain_both
    return lambda kind, params, x, y, z: one(kind, params, x, y, z)
