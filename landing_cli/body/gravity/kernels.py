"""The gravity models behind one set of compiled functions, chosen by the integer ``kind``.

Every function takes ``(kind, params, x, y, z)``: ``int(field.kind)``, ``field.params`` and a position in
the body frame, m. Call them with exactly these types, so that each compiles once. Second derivatives are
ordered xx, yy, zz, xy, xz, yz. Nothing is allocated, and a position at a singularity gives inf or nan.
Here an interpolated field is the polyhedron that it was fitted to: its pieces answer arrays of points only
(`field_values`), as every kernel that is compiled with them would compile half as long again.
"""

from __future__ import annotations

from landing_cli.body.gravity.dipole import (
    dipole_acceleration,
    dipole_acceleration_and_gradient,
    dipole_curvature,
    dipole_potential,
)
from landing_cli.body.gravity.field import GravityKind
from landing_cli.body.gravity.harmonics import (
    harmonics_acceleration,
    harmonics_acceleration_and_gradient,
    harmonics_curvature,
    harmonics_potential,
)
from landing_cli.body.gravity.kernel_types import Params, Symmetric, Vector, VectorAndSymmetric
from landing_cli.body.gravity.point_mass import (
    point_acceleration,
    point_acceleration_and_gradient,
    point_curvature,
    point_potential,
)
from landing_cli.body.gravity.polyhedron import (
    polyhedron_acceleration,
    polyhedron_acceleration_and_gradient,
    polyhedron_curvature,
    polyhedron_potential,
)
from landing_cli.kernel import kernel

_POINT_MASS = int(GravityKind.POINT_MASS)
_HARMONICS = int(GravityKind.HARMONICS)
_DIPOLE = int(GravityKind.DIPOLE)
_INTERPOLATED = int(GravityKind.INTERPOLATED)


@kernel
def potential(kind: int, params: Params, x: float, y: float, z: float) -> float:
    """Return the potential U, m2/s2, positive (GM/r + ...)."""
    if kind == _POINT_MASS:
        return point_potential(params[0], x, y, z)
    if kind == _HARMONICS:
        return harmonics_potential(params, x, y, z)
    if kind == _DIPOLE:
        return dipole_potential(params, x, y, z)
    if kind == _INTERPOLATED:
        params = params[int(params[0]) :]
    return polyhedron_potential(params, x, y, z)


@kernel
def acceleration(kind: int, params: Params, x: float, y: float, z: float) -> Vector:
    """Return the acceleration (gx, gy, gz), m/s2: the gradient of U."""
    if kind == _POINT_MASS:
        return point_acceleration(params[0], x, y, z)
    if kind == _HARMONICS:
        return harmonics_acceleration(params, x, y, z)
    if kind == _DIPOLE:
        return dipole_acceleration(params, x, y, z)
    if kind == _INTERPOLATED:
        params = params[int(params[0]) :]
    return polyhedron_acceleration(params, x, y, z)


@kernel
def acceleration_and_gradient(kind: int, params: Params, x: float, y: float, z: float) -> VectorAndSymmetric:
    """Return the acceleration, m/s2, then its gradient, 1/s2: nine numbers that share their work."""
    if kind == _POINT_MASS:
        return point_acceleration_and_gradient(params[0], x, y, z)
    if kind == _HARMONICS:
        return harmonics_acceleration_and_gradient(params, x, y, z)
    if kind == _DIPOLE:
        return dipole_acceleration_and_gradient(params, x, y, z)
    if kind == _INTERPOLATED:
        params = params[int(params[0]) :]
    return polyhedron_acceleration_and_gradient(params, x, y, z)


@kernel
def gradient(kind: int, params: Params, x: float, y: float, z: float) -> Symmetric:
    """Return the acceleration's gradient (gxx, gyy, gzz, gxy, gxz, gyz), 1/s2: the Hessian of U."""
    g = acceleration_and_gradient(kind, params, x, y, z)
    return g[3], g[4], g[5], g[6], g[7], g[8]


@kernel
def curvature(
    kind: int, params: Params, x: float, y: float, z: float, lx: float, ly: float, lz: float
) -> Symmetric:
    """Return sum_k d3U/(dxi dxj dxk) l_k, in the gradient's order, 1/(m s2) times the unit of l."""
    if kind == _POINT_MASS:
        return point_curvature(params[0], x, y, z, lx, ly, lz)
    if kind == _HARMONICS:
        return harmonics_curvature(params, x, y, z, lx, ly, lz)
    if kind == _DIPOLE:
        return dipole_curvature(params, x, y, z, lx, ly, lz)
    if kind == _INTERPOLATED:
        params = params[int(params[0]) :]
    return polyhedron_curvature(params, x, y, z, lx, ly, lz)
