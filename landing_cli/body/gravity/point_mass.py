"""A point mass at the origin: the field far from any body, and the building block of the dipole."""

from __future__ import annotations

import math

import numpy as np

from landing_cli.body.gravity.checks import checked_gm
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.kernel_types import Params, Symmetric, Vector, VectorAndSymmetric
from landing_cli.kernel import kernel, part


def point_mass_field(gm_m3_s2: float) -> GravityField:
    """Return the field of a point mass at the origin.

    Parameters
    ----------
    gm_m3_s2 : float
        Gravitational parameter, m3/s2.

    Returns
    -------
    GravityField
        ``params`` holds GM alone.

    Raises
    ------
    InputRefused
        GM is not positive and finite.
    """
    return GravityField(GravityKind.POINT_MASS, np.array([checked_gm(gm_m3_s2)]))


@part
def point_potential(gm: float, x: float, y: float, z: float) -> float:
    """Return GM / r."""
    return gm / math.sqrt(x * x + y * y + z * z)


@part
def point_acceleration(gm: float, x: float, y: float, z: float) -> Vector:
    """Return the gradient of GM / r."""
    r2 = x * x + y * y + z * z
    w = -gm / (r2 * math.sqrt(r2))
    return w * x, w * y, w * z


@part
def point_acceleration_and_gradient(gm: float, x: float, y: float, z: float) -> VectorAndSymmetric:
    """Return the gradient and the Hessian (xx, yy, zz, xy, xz, yz) of GM / r."""
    r2 = x * x + y * y + z * z
    w = -gm / (r2 * math.sqrt(r2))
    s = -3.0 * w / r2
    return (
        w * x,
        w * y,
        w * z,
        w + s * x * x,
        w + s * y * y,
        w + s * z * z,
        s * x * y,
        s * x * z,
        s * y * z,
    )


@part
def point_curvature(gm: float, x: float, y: float, z: float, lx: float, ly: float, lz: float) -> Symmetric:
    """Return the derivative of the Hessian of GM / r along (lx, ly, lz)."""
    r2 = x * x + y * y + z * z
    s = 3.0 * gm / (r2 * r2 * math.sqrt(r2))
    along = x * lx + y * ly + z * lz
    d = s * along
    c = -5.0 * d / r2
    return (
        d + 2.0 * s * x * lx + c * x * x,
        d + 2.0 * s * y * ly + c * y * y,
        d + 2.0 * s * z * lz + c * z * z,
        s * (x * ly + lx * y) + c * x * y,
        s * (x * lz + lx * z) + c * x * z,
        s * (y * lz + ly * z) + c * y * z,
    )


@kernel
def point_mass_potential(params: Params, x: float, y: float, z: float) -> float:
    """Return U."""
    return point_potential(params[0], x, y, z)


@kernel
def point_mass_acceleration(params: Params, x: float, y: float, z: float) -> Vector:
    """Return the gradient of U."""
    return point_acceleration(params[0], x, y, z)


@kernel
def point_mass_acceleration_and_gradient(params: Params, x: float, y: float, z: float) -> VectorAndSymmetric:
    """Return the gradient and the Hessian (xx, yy, zz, xy, xz, yz) of U."""
    return point_acceleration_and_gradient(params[0], x, y, z)


@kernel
def point_mass_curvature(
    params: Params, x: float, y: float, z: float, lx: float, ly: float, lz: float
) -> Symmetric:
    """Return the derivative of the Hessian of U along (lx, ly, lz)."""
    return point_curvature(params[0], x, y, z, lx, ly, lz)
