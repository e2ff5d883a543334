"""Gravity coefficients of a uniform body, from exact integrals over its mesh."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_cli.body.gravity.checks import checked_gm, checked_number
from landing_cli.body.mass_properties import centred, mass_properties
from landing_cli.body.mesh import FloatArray, Mesh
from landing_cli.errors import InputRefused


@dataclass(frozen=True)
class Degree2:
    """Unnormalised degree-2 coefficients in the body frame, without the Condon-Shortley phase."""

    c20: float
    c21: float
    c22: float
    s21: float
    s22: float
    reference_radius_m: float


@dataclass(frozen=True)
class Dipole:
    """Two point masses in the equatorial plane about their centre of mass.

    Attributes
    ----------
    mass_fraction : float
        Share of the mass at +x.
    separation_m : float
        Distance between the masses.
    azimuth_rad : float
        Angle of their axis from the body x axis, about +z.
    """

    mass_fraction: float
    separation_m: float
    azimuth_rad: float = 0.0


def degree2_from_mesh(mesh: Mesh, reference_radius_m: float) -> Degree2:
    """Return the degree-2 coefficients of a uniform density.

    Parameters
    ----------
    mesh : Mesh
        Closed and wound outwards. The coefficients are about its origin, as it is given.
    reference_radius_m : float
        Radius that the coefficients will refer to, m.

    Returns
    -------
    Degree2

    Raises
    ------
    InputRefused
        The radius is not positive and finite.
    """
    radius = checked_number("reference_radius_m", reference_radius_m, above=0.0)
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = (_second_moments(mesh) / radius**2).tolist()
    return Degree2(
        c20=zz - 0.5 * (xx + yy),
        c21=xz,
        c22=0.25 * (xx - yy),
        s21=yz,
        s22=0.5 * xy,
        reference_radius_m=radius,
    )


def dipole_from_mesh(mesh: Mesh, azimuth_rad: float = 0.0) -> Dipole:
    """Fit a mass dipole to the degree-2 and degree-3 zonal moments about an axis, the body's x by default.

    With x along the axis and the means m2 of x^2 - (y^2 + z^2)/2 and m3 of x^3 - 3/2 x (y^2 + z^2) over the
    body, a dipole has m2 = mu (1 - mu) d^2 and m3/m2 = (1 - 2 mu) d, so that d^2 = 4 m2 + (m3/m2)^2.

    Parameters
    ----------
    mesh : Mesh
        Closed and wound outwards. The moments are taken about its centre of mass.
    azimuth_rad : float
        Angle of the axis from x, about +z; ``long_axis_azimuth`` fits an elongated body best.

    Returns
    -------
    Dipole

    Raises
    ------
    InputRefused
        The body is not elongated along the axis.
    """
    azimuth = checked_number("azimuth_rad", azimuth_rad)
    cos, sin = math.cos(azimuth), math.sin(azimuth)
    mesh = centred(mesh)
    mesh = Mesh(mesh.vertices @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]), mesh.faces)
    second = _second_moments(mesh)
    m2 = float(second[0, 0] - 0.5 * (second[1, 1] + second[2, 2]))
    if not m2 > 0.0:
        raise InputRefused(
            "the body is not elongated along the dipole's axis",
            where="gravity",
            fix="take the model harmonics or polyhedron",
        )
    skew = _third_zonal_moment(mesh) / m2
    separation = math.sqrt(4.0 * m2 + skew**2)
    return Dipole(0.5 * (1.0 - skew / separation), separation, azimuth)


def long_axis_azimuth(mesh: Mesh) -> float:
    """Return the angle from x to the long axis of the body in its equatorial plane, rad, within pi/2."""
    second = _second_moments(centred(mesh))
    return 0.5 * math.atan2(2.0 * second[0, 1], second[0, 0] - second[1, 1])


def kappa(gm_m3_s2: float, rotation_rate_rad_s: float, separation_m: float) -> float:
    """Return a dipole's ratio of gravity to spin, GM / (omega^2 d^3).

    Parameters
    ----------
    gm_m3_s2 : float
        Gravitational parameter, m3/s2.
    rotation_rate_rad_s : float
        Spin rate, not zero.
    separation_m : float
        Distance between the two masses, m.

    Returns
    -------
    float

    Raises
    ------
    InputRefused
        GM or the separation is not positive, or the rate is zero.
    """
    rate = checked_number("rotation_rate_rad_s", abs(rotation_rate_rad_s), above=0.0)
    return checked_gm(gm_m3_s2) / (rate**2 * checked_number("separation_m", separation_m, above=0.0) ** 3)


def _second_moments(mesh: Mesh) -> FloatArray:
    """Mean of r r' over the body about the mesh's origin, (3, 3), m2."""
    properties = mass_properties(mesh)
    center, inertia = properties.center_of_mass_m, properties.inertia_m2
    # about the centre of mass the inertia tensor is trace(mean) I - mean
    return np.asarray(0.5 * np.trace(inertia) * np.eye(3) - inertia + np.outer(center, center))


def _third_zonal_moment(mesh: Mesh) -> float:
    """Mean of x^3 - 3/2 x (y^2 + z^2) over the body.

    A cubic f integrates over the tetrahedron (0, a, b, c) to V/20 times the sum of its polar form over the
    ten ways to take three of a, b, c; with s = a + b + c that sum is
    [f(s) + 3 sum_v F(s, v, v) + 2 sum_v f(v)] / 6.
    """
    corners = mesh.corners
    a, b, c = np.moveaxis(corners, 1, 0)
    tetrahedra = np.einsum("fi,fi->f", a, np.cross(b, c)) / 6.0
    s = corners.sum(axis=1)
    mixed = _polar(s[:, None, :], corners).sum(axis=1)
    pure = _polar(corners, corners).sum(axis=1)
    tens = (_polar(s, s) + 3.0 * mixed + 2.0 * pure) / 6.0
    return float(tetrahedra @ tens / (20.0 * tetrahedra.sum()))


def _polar(u: FloatArray, v: FloatArray) -> FloatArray:
    """Polar form F(u, v, v) of x^3 - 3/2 x (y^2 + z^2), over the last axis."""
    cross = u[..., 1] * v[..., 1] + u[..., 2] * v[..., 2]
    return u[..., 0] * (v[..., 0] ** 2 - 0.5 * (v[..., 1] ** 2 + v[..., 2] ** 2)) - v[..., 0] * cross
