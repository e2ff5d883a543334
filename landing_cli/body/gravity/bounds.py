"""Upper bounds of gravity outside a surface, for proofs that a place is out of reach.

Outside the masses |g|^2 is subharmonic (its Laplacian is 2 |dg/dr|^2), and it vanishes far away: its largest
value outside a closed surface that encloses the masses is attained on that surface. The surface is cut into
patches, and on each |g| is bounded by its value, slope and second derivative at the centre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.body.gravity.checks import checked_number
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.kernel_types import FloatArray, Vector
from landing_cli.body.gravity.kernels import acceleration_and_gradient, curvature
from landing_cli.body.gravity.polyhedron_records import recorded_corners
from landing_cli.body.gravity.surrounding_kernels import ERROR
from landing_cli.errors import InputRefused
from landing_cli.kernel import kernel, part

TOLERANCE = 0.005  # how far a bound may lie above the largest value met
FIT_MARGIN = 20.0  # a fitted field's error where it was not measured, over the largest that was, twice
_SECOND_ORDER_MARGIN = 2.0  # covers the change of the second derivative within a patch
_MOST_PATCHES = 200_000
_LEAST_ANGLE = 1e-5
_ROUNDING = 1e-12
_TURN = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]) @ np.array(
    [[1.0, 0.0, 0.0], [0.0, 12 / 13, -5 / 13], [0.0, 5 / 13, 12 / 13]]
)


def largest_acceleration_outside(
    field: GravityField,
    radii_m: ArrayLike,
    semi_axes_m: ArrayLike | None = None,
) -> FloatArray:
    """Bound |g| over all points that are at least ``radii_m`` away and outside an ellipsoid.

    Parameters
    ----------
    field : GravityField
        The gravity model.
    radii_m : (k,) float, m
        Least distances from the origin.
    semi_axes_m : (3,) float, m, optional
        Semi-axes of an ellipsoid, along the body axes about the origin, that the points are outside of.
        Spheres that cut the body are allowed with it: the bound is that of what both leave free.

    Returns
    -------
    (k,) float, m/s2
        At most TOLERANCE above the least bound.

    Raises
    ------
    InputRefused
        A radius is not positive, or sphere and ellipsoid together leave masses outside: a mass of the
        dipole, or a vertex of the polyhedron. (Harmonics and the point mass have theirs at the origin.)
    """
    radii = np.array(radii_m, dtype=np.float64).ravel()
    for radius in radii:
        checked_number("radius", radius, above=0.0)
    semi_axes = None if semi_axes_m is None else _checked_semi_axes(semi_axes_m)
    _refuse_masses_outside(field, float(radii.min(initial=math.inf)), semi_axes)
    bounds = np.array([_bound_outside(field, float(radius), semi_axes) for radius in radii])
    return bounds * room_for_fit(field)


def room_for_fit(field: GravityField) -> float:
    """Return by what a bound is multiplied for the error of a fitted field, 1 for all others.

    The field that was fitted is that of masses inside, and what is met of it is met within the fit's error;
    flights may meet the fit where it lies above. FIT_MARGIN times the largest error measured allows for both.
    """
    if field.kind is not GravityKind.INTERPOLATED:
        return 1.0
    return 1.0 + FIT_MARGIN * float(field.params[ERROR])


def _bound_outside(field: GravityField, radius: float, semi_axes: FloatArray | None) -> float:
    region = _Region(radius, semi_axes)
    attained, bound = 0.0, 0.0
    if semi_axes is not None:
        attained, bound = _bound_on_surface(field, semi_axes, region)
        if radius <= semi_axes.min():
            return bound
    return max(bound, _bound_on_surface(field, np.full(3, radius), region, attained)[1])


def largest_acceleration_on_ellipsoid(field: GravityField, semi_axes_m: ArrayLike) -> float:
    """Bound |g| over an ellipsoid and everything outside it.

    Parameters
    ----------
    field : GravityField
        The gravity model.
    semi_axes_m : (3,) float, m
        Semi-axes along the body axes, about the origin.

    Returns
    -------
    float, m/s2
        At most TOLERANCE above the least bound.

    Raises
    ------
    InputRefused
        The ellipsoid leaves masses of the field outside.
    """
    semi_axes = _checked_semi_axes(semi_axes_m)
    _refuse_masses_outside(field, 0.0, semi_axes)
    return _bound_on_surface(field, semi_axes, _Region(0.0, None))[1] * room_for_fit(field)


def _checked_semi_axes(semi_axes_m: ArrayLike) -> FloatArray:
    return np.array([checked_number("semi-axis", s, above=0.0) for s in np.ravel(semi_axes_m)])


def _refuse_masses_outside(field: GravityField, radius: float, semi_axes: FloatArray | None) -> None:
    masses = np.zeros((1, 3))
    if field.kind == GravityKind.DIPOLE:
        masses = np.array([[*field.params[1:3], 0.0], [*field.params[4:6], 0.0]])
    elif field.kind == GravityKind.POLYHEDRON:
        masses = recorded_corners(field.params)
    elif field.kind in (GravityKind.BOXED, GravityKind.INTERPOLATED):
        masses = recorded_corners(field.params[int(field.params[0]) :])
    inside = np.linalg.norm(masses, axis=1) < radius
    if semi_axes is not None:
        # a vertex may touch the least ellipsoid
        inside |= np.linalg.norm(masses / semi_axes, axis=1) <= 1.0 + 1e-9
    if not inside.all():
        stray = masses[~inside][0]
        raise InputRefused(
            f"mass at ({stray[0]:.6g}, {stray[1]:.6g}, {stray[2]:.6g}) m is not enclosed",
            where="bound of gravity",
            fix="give larger radii, or an ellipsoid that encloses the body",
        )


def _bound_on_surface(
    field: GravityField, semi_axes: FloatArray, region: _Region, attained: float = 0.0
) -> tuple[float, float]:
    """Return the largest |g| met and a bound of |g| over the part of an ellipsoid that lies in the region.

    Patches that may hold more than TOLERANCE above what is met are split, until none is left.
    """
    # a writable copy, as the solvers have: the kernels compile once
    triangles, params = _sphere_triangles(), field.params.copy()
    if field.kind in (GravityKind.POLYHEDRON, GravityKind.INTERPOLATED):
        # a vertex on the least ellipsoid lies where octants meet or in the middle of one: no patch may have
        # its centre there, where the second derivative is infinite, however often it is split
        triangles = triangles @ _TURN
    while True:
        directions, angles = _centres(triangles)
        sizes, ceilings, reaches = np.zeros((3, len(triangles)))
        _fill_ceilings(field.kind, params, directions, semi_axes, angles, sizes, ceilings, reaches)
        points = directions * semi_axes
        attained = max(attained, sizes[region.holds(points, 0.0)].max(initial=0.0))
        open_patches = (ceilings > (1.0 + TOLERANCE) * attained) & region.holds(points, reaches)
        if not open_patches.any():
            return attained, (1.0 + TOLERANCE) * attained
        if 4 * open_patches.sum() > _MOST_PATCHES or angles.max() < _LEAST_ANGLE:
            return attained, max(float(ceilings[open_patches].max()), (1.0 + TOLERANCE) * attained)
        triangles = _split(triangles[open_patches])


@dataclass(frozen=True, eq=False)
class _Region:
    """Points at least ``radius`` away and outside an ellipsoid; no semi-axes, no ellipsoid."""

    radius: float
    semi_axes: FloatArray | None

    def holds(self, points: FloatArray, reach: FloatArray | float) -> NDArray[np.bool_]:
        """Tell which points (n, 3) come within ``reach`` metres of the region."""
        near = 1.0 - _ROUNDING
        inside = _length(points) + reach >= near * self.radius
        if self.semi_axes is not None:
            level = _length(points / self.semi_axes)
            inside &= level + reach / self.semi_axes.min() >= near
        return np.asarray(inside)


@cache
def _sphere_triangles() -> FloatArray:
    """Return an octahedron's facets, split three times: (512, 3, 3), unit vectors; not to be written to."""
    signs = np.array([[x, y, z] for x in (1, -1) for y in (1, -1) for z in (1, -1)], dtype=np.float64)
    triangles = signs[:, :, None] * np.eye(3)
    for _ in range(3):
        triangles = _split(triangles)
    return triangles


def _split(triangles: FloatArray) -> FloatArray:
    """Split each spherical triangle into four at the middles of its sides."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    ab, bc, ca = (_unit(p + q) for p, q in ((a, b), (b, c), (c, a)))
    quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([np.stack(corners, axis=1) for corners in quarters])


def _centres(triangles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return each triangle's centre (n, 3) and the angle (n,) from it to the farthest corner."""
    centres = _unit(triangles[:, 0] + triangles[:, 1] + triangles[:, 2])
    chords = _length(triangles - centres[:, None, :])
    farthest = np.maximum(np.maximum(chords[:, 0], chords[:, 1]), chords[:, 2])
    return centres, 2.0 * np.arcsin(0.5 * farthest)


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / _length(vectors)[:, None])


def _length(vectors: FloatArray) -> FloatArray:
    """Return the lengths of vectors (..., 3); numpy's own norms along a short axis take twice as long."""
    return np.asarray(np.sqrt(np.einsum("...i,...i", vectors, vectors)))


@part
def _stretch2(u: Vector, semi_axes: FloatArray) -> float:
    """Return the largest |D t|^2 over unit tangents t at u, D = diag(semi_axes).

    D^2 on the tangent plane has the trace tr D^2 - u'D^2u and the determinant u' adj(D^2) u.
    """
    a, b, c = semi_axes[0] ** 2, semi_axes[1] ** 2, semi_axes[2] ** 2
    x, y, z = u[0] ** 2, u[1] ** 2, u[2] ** 2
    half_trace = 0.5 * (a + b + c - (a * x + b * y + c * z))
    determinant = b * c * x + a * c * y + a * b * z
    return half_trace + math.sqrt(max(half_trace * half_trace - determinant, 0.0))


@kernel
def _fill_ceilings(
    kind: GravityKind,
    params: FloatArray,
    directions: FloatArray,
    semi_axes: FloatArray,
    angles: FloatArray,
    sizes: FloatArray,
    ceilings: FloatArray,
    reaches: FloatArray,
) -> None:
    """Fill |g| at the centre of each patch of the ellipsoid x = D u, its bound, and how far the patch goes.

    Along a great circle u(s), the path x = D u(s) has x' = D u' and x'' = -x. With h = dg/dr and e = g/|g|,
    |g|' = e.hx' and |g|'' = (|hx'|^2 - (e.hx')^2)/|g| + e.(d2g/dr2)(x', x') - e.hx.
    """
    for i in range(len(directions)):
        u = (directions[i, 0], directions[i, 1], directions[i, 2])
        x, y, z = semi_axes[0] * u[0], semi_axes[1] * u[1], semi_axes[2] * u[2]
        gx, gy, gz, xx, yy, zz, xy, xz, yz = acceleration_and_gradient(kind, params, x, y, z)
        size = math.sqrt(gx * gx + gy * gy + gz * gz)
        ex, ey, ez = gx / size, gy / size, gz / size
        hx, hy, hz = xx * ex + xy * ey + xz * ez, xy * ex + yy * ey + yz * ez, xz * ex + yz * ey + zz * ez
        sx, sy, sz = semi_axes[0] * hx, semi_axes[1] * hy, semi_axes[2] * hz
        radial = sx * u[0] + sy * u[1] + sz * u[2]  # equals e.hx
        slope = math.sqrt(max(sx * sx + sy * sy + sz * sz - radial * radial, 0.0))
        hessian2 = xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz)
        txx, tyy, tzz, txy, txz, tyz = curvature(kind, params, x, y, z, ex, ey, ez)
        third = math.sqrt(txx * txx + tyy * tyy + tzz * tzz + 2.0 * (txy * txy + txz * txz + tyz * tyz))
        stretch2 = _stretch2(u, semi_axes)
        across = hessian2 - (hx * hx + hy * hy + hz * hz)
        second = stretch2 * (across / size + third) + abs(radial)
        angle = angles[i]
        sizes[i] = size
        ceilings[i] = size + angle * (slope + 0.5 * _SECOND_ORDER_MARGIN * angle * second)
        reaches[i] = angle * (
            math.sqrt(stretch2) + 0.5 * angle * max(semi_axes[0], semi_axes[1], semi_axes[2])
        )
