"""Rotating mass dipole (Zeng et al. 2015): two point masses that turn with the body."""

from __future__ import annotations

import math

import numpy as np

from landing_cli.body.gravity.checks import checked_gm, checked_number
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.kernel_types import Params, Symmetric, Vector, VectorAndSymmetric
from landing_cli.body.gravity.point_mass import (
    point_acceleration,
    point_acceleration_and_gradient,
    point_curvature,
    point_potential,
)
from landing_cli.kernel import kernel


def dipole_field(
    gm_m3_s2: float, mass_fraction: float, separation_m: float, azimuth_rad: float = 0.0
) -> GravityField:
    """Return the field of two point masses in the equatorial plane, centre of mass at the origin.

    Parameters
    ----------
    gm_m3_s2 : float
        Gravitational parameter of both masses together, m3/s2.
    mass_fraction : float
        Share of the mass at +x, between 0 and 1.
    separation_m : float
        Distance between the masses, m.
    azimuth_rad : float
        Angle of the masses' axis from the body x axis, about +z.

    Returns
    -------
    GravityField
        ``params`` is GM, x and y of the mass at +x, then of the other.

    Raises
    ------
    InputRefused
        A value is out of range.
    """
    gm = checked_gm(gm_m3_s2)
    share = checked_number("mass_fraction", mass_fraction, above=0.0, below=1.0)
    distance = checked_number("separation_m", separation_m, above=0.0)
    azimuth = checked_number("azimuth_rad", azimuth_rad)
    along = np.array([math.cos(azimuth), math.sin(azimuth)])
    front, back = (1.0 - share) * distance * along, -share * distance * along
    params = np.array([gm * share, *front, gm * (1.0 - share), *back])
    return GravityField(GravityKind.DIPOLE, params)


@kernel
def dipole_potential(params: Params, x: float, y: float, z: float) -> float:
    """Return U of the two masses."""
    a = point_potential(params[0], x - params[1], y - params[2], z)
    return a + point_potential(params[3], x - params[4], y - params[5], z)


@kernel
def dipole_acceleration(params: Params, x: float, y: float, z: float) -> Vector:
    """Return the gradient of U."""
    ax, ay, az = point_acceleration(params[0], x - params[1], y - params[2], z)
    bx, by, bz = point_acceleration(params[3], x - params[4], y - params[5], z)
    return ax + bx, ay + by, az + bz


@kernel
def dipole_acceleration_and_gradient(params: Params, x: float, y: float, z: float) -> VectorAndSymmetric:
    """Return the gradient and the Hessian (xx, yy, zz, xy, xz, yz) of U."""
    a = point_acceleration_and_gradient(params[0], x - params[1], y - params[2], z)
    b = point_acceleration_and_gradient(params[3], x - params[4], y - params[5], z)
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


@kernel
def dipole_curvature(
    params: Params, x: float, y: float, z: float, lx: float, ly: float, lz: float
) -> Symmetric:
    """Return the derivative of the Hessian of U along (lx, ly, lz)."""
    a = point_curvature(params[0], x - params[1], y - params[2], z, lx, ly, lz)
    b = point_curvature(params[3], x - params[4], y - params[5], z, lx, ly, lz)
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]
