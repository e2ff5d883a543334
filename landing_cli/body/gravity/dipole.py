"""Rotating mass dipole (Zeng et al. 2015): two point masses on the body x axis."""

from __future__ import annotations

import numpy as np
from numba import njit

from landing_cli.body.gravity.checks import checked_gm, checked_number
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.kernel_types import Params, Symmetric, Vector, VectorAndSymmetric
from landing_cli.body.gravity.point_mass import (
    point_acceleration,
    point_acceleration_and_gradient,
    point_curvature,
    point_potential,
)


def dipole_field(gm_m3_s2: float, mass_fraction: float, separation_m: float) -> GravityField:
    """Return the field of two point masses on the x axis, centre of mass at the origin.

    Parameters
    ----------
    gm_m3_s2 : float
        Gravitational parameter of both masses together, m3/s2.
    mass_fraction : float
        Share of the mass at +x, between 0 and 1.
    separation_m : float
        Distance between the masses, m.

    Returns
    -------
    GravityField
        ``params`` is GM at +x, its x, GM at -x, its x.

    Raises
    ------
    InputRefused
        A value is out of range.
    """
    gm = checked_gm(gm_m3_s2)
    share = checked_number("mass_fraction", mass_fraction, above=0.0, below=1.0)
    distance = checked_number("separation_m", separation_m, above=0.0)
    params = np.array([gm * share, (1.0 - share) * distance, gm * (1.0 - share), -share * distance])
    return GravityField(GravityKind.DIPOLE, params)


@njit(cache=True, nogil=True, error_model="numpy")
def dipole_potential(params: Params, x: float, y: float, z: float) -> float:
    """Return U of the two masses."""
    return point_potential(params[0], x - params[1], y, z) + point_potential(params[2], x - params[3], y, z)


@njit(cache=True, nogil=True, error_model="numpy")
def dipole_acceleration(params: Params, x: float, y: float, z: float) -> Vector:
    """Return the gradient of U."""
    ax, ay, az = point_acceleration(params[0], x - params[1], y, z)
    bx, by, bz = point_acceleration(params[2], x - params[3], y, z)
    return ax + bx, ay + by, az + bz


@njit(cache=True, nogil=True, error_model="numpy")
def dipole_acceleration_and_gradient(params: Params, x: float, y: float, z: float) -> VectorAndSymmetric:
    """Return the gradient and the Hessian (xx, yy, zz, xy, xz, yz) of U."""
    a = point_acceleration_and_gradient(params[0], x - params[1], y, z)
    b = point_acceleration_and_gradient(params[2], x - params[3], y, z)
    return (
        a[0] + b[0],
        a[1] + b[1],
        a[2] + b[2],
        a[3] + b[3],
        a[4] + b[4],
        a[5] + b[5],
        a[6] + b[6],
        a[7] + b[7],
        a[8] + b[8],
    )


@njit(cache=True, nogil=True, error_model="numpy")
def dipole_curvature(
    params: Params, x: float, y: float, z: float, lx: float, ly: float, lz: float
) -> Symmetric:
    """Return the derivative of the Hessian of U along (lx, ly, lz)."""
    a = point_curvature(params[0], x - params[1], y, z, lx, ly, lz)
    b = point_curvature(params[2], x - params[3], y, z, lx, ly, lz)
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]
