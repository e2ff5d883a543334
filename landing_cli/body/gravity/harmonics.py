"""Degree-2 spherical harmonics, written as a symmetric traceless tensor: no angle, no pole.

With q = r'Qr, the potential is GM/r + q/r^5, where (unnormalised coefficients, times GM R^2)

    Q = [[3 C22 - C20/2,  3 S22,           3/2 C21],
         [3 S22,         -3 C22 - C20/2,   3/2 S21],
         [3/2 C21,        3/2 S21,         C20    ]].
"""

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
from landing_cli.kernel import kernel, part


def harmonics_field(
    gm_m3_s2: float,
    reference_radius_m: float,
    c20: float,
    c22: float,
    s22: float = 0.0,
    c21: float = 0.0,
    s21: float = 0.0,
) -> GravityField:
    """Return the field of degree-2 harmonics about the centre of mass.

    Parameters
    ----------
    gm_m3_s2 : float
        Gravitational parameter, m3/s2.
    reference_radius_m : float
        Radius that the coefficients refer to, m.
    c20, c22, s22, c21, s21 : float
        Unnormalised coefficients in the body frame, without the Condon-Shortley phase.

    Returns
    -------
    GravityField
        ``params`` is GM, then Q's xx, yy, zz, xy, xz, yz in m5/s2.

    Raises
    ------
    InputRefused
        A value is not finite, or GM or the radius is not positive.
    """
    gm = checked_gm(gm_m3_s2)
    radius = checked_number("reference_radius_m", reference_radius_m, above=0.0)
    for name, value in (("c20", c20), ("c22", c22), ("s22", s22), ("c21", c21), ("s21", s21)):
        checked_number(name, value)
    tensor = np.array([3.0 * c22 - c20 / 2, -3.0 * c22 - c20 / 2, c20, 3.0 * s22, 1.5 * c21, 1.5 * s21])
    return GravityField(GravityKind.HARMONICS, np.concatenate([[gm], gm * radius**2 * tensor]))


@part
def _times_q(params: Params, x: float, y: float, z: float) -> Vector:
    return (
        params[1] * x + params[4] * y + params[5] * z,
        params[4] * x + params[2] * y + params[6] * z,
        params[5] * x + params[6] * y + params[3] * z,
    )


@kernel
def harmonics_potential(params: Params, x: float, y: float, z: float) -> float:
    """Return U of the point mass and degree 2."""
    r2 = x * x + y * y + z * z
    px, py, pz = _times_q(params, x, y, z)
    q = x * px + y * py + z * pz
    return point_potential(params[0], x, y, z) + q / (r2 * r2 * math.sqrt(r2))


@kernel
def harmonics_acceleration(params: Params, x: float, y: float, z: float) -> Vector:
    """Return the gradient of U."""
    r2 = x * x + y * y + z * z
    px, py, pz = _times_q(params, x, y, z)
    i5 = 1.0 / (r2 * r2 * math.sqrt(r2))
    radial = -5.0 * (x * px + y * py + z * pz) * i5 / r2
    gx, gy, gz = point_acceleration(params[0], x, y, z)
    return (
        gx + 2.0 * i5 * px + radial * x,
        gy + 2.0 * i5 * py + radial * y,
        gz + 2.0 * i5 * pz + radial * z,
    )


@kernel
def harmonics_acceleration_and_gradient(params: Params, x: float, y: float, z: float) -> VectorAndSymmetric:
    """Return the gradient and the Hessian (xx, yy, zz, xy, xz, yz) of U."""
    r2 = x * x + y * y + z * z
    px, py, pz = _times_q(params, x, y, z)
    i5 = 1.0 / (r2 * r2 * math.sqrt(r2))
    i7 = i5 / r2
    radial = -5.0 * (x * px + y * py + z * pz) * i7  # -5 q / r^7
    b = -7.0 * radial / r2  # 35 q / r^9
    c = -10.0 * i7
    gx, gy, gz, hxx, hyy, hzz, hxy, hxz, hyz = point_acceleration_and_gradient(params[0], x, y, z)
    return (
        gx + 2.0 * i5 * px + radial * x,
        gy + 2.0 * i5 * py + radial * y,
        gz + 2.0 * i5 * pz + radial * z,
        hxx + 2.0 * i5 * params[1] + radial + 2.0 * c * px * x + b * x * x,
        hyy + 2.0 * i5 * params[2] + radial + 2.0 * c * py * y + b * y * y,
        hzz + 2.0 * i5 * params[3] + radial + 2.0 * c * pz * z + b * z * z,
        hxy + 2.0 * i5 * params[4] + c * (px * y + x * py) + b * x * y,
        hxz + 2.0 * i5 * params[5] + c * (px * z + x * pz) + b * x * z,
        hyz + 2.0 * i5 * params[6] + c * (py * z + y * pz) + b * y * z,
    )


@kernel
def harmonics_curvature(
    params: Params, x: float, y: float, z: float, lx: float, ly: float, lz: float
) -> Symmetric:
    """Return the derivative of the Hessian of U along (lx, ly, lz).

    With p = Qr, m = Ql, s = r.l, the degree-2 part is::

        -10/r^7 [s Q + (m r' + r m') + (p l' + l p') + (p.l) I]
        + 35/r^9 [2 s (p r' + r p') + q s I + 2 (p.l) r r' + q (l r' + r l')] - 315 q s / r^11 r r'
    """
    r2 = x * x + y * y + z * z
    px, py, pz = _times_q(params, x, y, z)
    mx, my, mz = _times_q(params, lx, ly, lz)
    q = x * px + y * py + z * pz
    s = x * lx + y * ly + z * lz
    pl = px * lx + py * ly + pz * lz
    i7 = 1.0 / (r2 * r2 * r2 * math.sqrt(r2))
    a = -10.0 * i7
    i9 = 35.0 * i7 / r2
    # every outer product gathered on r: v r' + r v', and on l: w l' + l w'
    rr = 0.5 * i9 * (2.0 * pl - 9.0 * q * s / r2)
    identity = a * pl + i9 * q * s
    vx = a * mx + 2.0 * i9 * s * px + i9 * q * lx + rr * x
    vy = a * my + 2.0 * i9 * s * py + i9 * q * ly + rr * y
    vz = a * mz + 2.0 * i9 * s * pz + i9 * q * lz + rr * z
    wx, wy, wz = a * px, a * py, a * pz
    txx, tyy, tzz, txy, txz, tyz = point_curvature(params[0], x, y, z, lx, ly, lz)
    return (
        txx + a * s * params[1] + identity + 2.0 * (vx * x + wx * lx),
        tyy + a * s * params[2] + identity + 2.0 * (vy * y + wy * ly),
        tzz + a * s * params[3] + identity + 2.0 * (vz * z + wz * lz),
        txy + a * s * params[4] + vx * y + x * vy + wx * ly + lx * wy,
        txz + a * s * params[5] + vx * z + x * vz + wx * lz + lx * wz,
        tyz + a * s * params[6] + vy * z + y * vz + wy * lz + ly * wz,
    )
