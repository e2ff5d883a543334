"""Evaluation of a field around a whole body: near facets exactly, the rest as a polynomial.

The parameters are where the polyhedron's own begin and where the coefficients begin, half the side of the
cube that is divided, the radius beyond which one expansion holds, the error that was measured, and GM. Then
comes the tree: at every node the first of its eight children, which follow each other, or less the place of
its piece, or 0; then the facets (`facet_potential`), the pieces (where their coefficients are, 1 or 0 for
GM/r, how many facets are near, and where those are), the coefficients, those of the outer expansion first,
and the polyhedron.

U of a piece is GM/r or that of its near facets, and the polynomial; all else is derived from it. Beyond the
radius D it is (D/r) V(y) with V a harmonic polynomial of y = D x/r^2, by Kelvin's inversion: the exterior
harmonics up to its degree.
"""

from __future__ import annotations

import math
from typing import Any

from landing_cli.body.gravity.facet_potential import facet_curvature, facet_gradient, facet_pull
from landing_cli.body.gravity.horner import polynomial_gradient, polynomial_pull
from landing_cli.body.gravity.kernel_types import Params, Symmetric, Vector, VectorAndSymmetric
from landing_cli.body.gravity.point_mass import point_acceleration_and_gradient, point_curvature
from landing_cli.body.gravity.polyhedron import (
    polyhedron_acceleration,
    polyhedron_acceleration_and_gradient,
    polyhedron_curvature,
    polyhedron_potential,
)
from landing_cli.kernel import kernel, part

NEAR_DEGREE, FAR_DEGREE, OUTER_DEGREE = 10, 12, 14
HEADER = 6
ERROR, GM = 4, 5
DENSITY = 2  # where a polyhedron's parameters hold G rho
_HALF, _OUTER = 2, 3
_STEP = 1e-30  # of the complex step: its square vanishes beside 1
_SHARE = 1e-4  # of the distance: the step of a difference, beyond the radius


@part
def _piece_at(params: Params, x: float, y: float, z: float) -> tuple[int, float, float, float, float]:
    """Return the place of the piece that holds a point, 0 for none; where in it, -1 to 1; its half side."""
    px, py, pz, h = x, y, z, params[_HALF]
    if not (abs(px) <= h and abs(py) <= h and abs(pz) <= h):
        return 0, 0.0, 0.0, 0.0, 1.0
    node = int(params[HEADER])
    while node > 0:
        h *= 0.5
        child = (1 if px >= 0.0 else 0) + (2 if py >= 0.0 else 0) + (4 if pz >= 0.0 else 0)
        px += -h if px >= 0.0 else h
        py += -h if py >= 0.0 else h
        pz += -h if pz >= 0.0 else h
        node = int(params[HEADER + node + child])
    return -node, px / h, py / h, pz / h, h


@part
def _is_beyond(params: Params, x: float, y: float, z: float) -> bool:
    """Tell whether the outer expansion holds at a point."""
    return bool(x * x + y * y + z * z > params[_OUTER] * params[_OUTER])


@part
def _degree(params: Params, c: int) -> int:
    """Return the degree of the polynomial of the piece at ``c``."""
    return FAR_DEGREE if params[c + 1] > 0.0 else NEAR_DEGREE


@part
def _outer_pull(params: Params, x: Any, y: Any, z: Any) -> Any:
    """Return U beyond the radius, and its gradient; complex at a complex point."""
    d = params[_OUTER]
    inverse = 1.0 / (x * x + y * y + z * z)
    s, k = d * inverse, d * (inverse**0.5)
    f, fx, fy, fz = polynomial_pull(params, int(params[1]), OUTER_DEGREE, s * x, s * y, s * z)
    along = 2.0 * (x * fx + y * fy + z * fz) * inverse
    fall = k * (f * inverse + s * along)
    return k * f, k * s * fx - fall * x, k * s * fy - fall * y, k * s * fz - fall * z


@part
def _outer_hessian(params: Params, x: float, y: float, z: float) -> Symmetric:
    """Return the Hessian of U beyond the radius, by complex steps along x, y and z."""
    step = _STEP * params[_OUTER]
    _u, xx, _xy, _xz = _outer_pull(params, complex(x, step), complex(y, 0.0), complex(z, 0.0))
    _u, xy, yy, _yz = _outer_pull(params, complex(x, 0.0), complex(y, step), complex(z, 0.0))
    _u, xz, yz, zz = _outer_pull(params, complex(x, 0.0), complex(y, 0.0), complex(z, step))
    p = 1.0 / step
    return p * xx.imag, p * yy.imag, p * zz.imag, p * xy.imag, p * xz.imag, p * yz.imag


@part
def _outer_curvature(
    params: Params, x: float, y: float, z: float, lx: float, ly: float, lz: float
) -> Symmetric:
    """Return the derivative of that Hessian along l: a central difference, for want of second steps."""
    size = math.sqrt(lx * lx + ly * ly + lz * lz)
    if not size > 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    h = _SHARE * math.sqrt(x * x + y * y + z * z) / size
    a = _outer_hessian(params, x + h * lx, y + h * ly, z + h * lz)
    b = _outer_hessian(params, x - h * lx, y - h * ly, z - h * lz)
    p = 0.5 / h
    return (
        p * (a[0] - b[0]),
        p * (a[1] - b[1]),
        p * (a[2] - b[2]),
        p * (a[3] - b[3]),
        p * (a[4] - b[4]),
        p * (a[5] - b[5]),
    )


@part
def _pull(params: Params, c: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Return U and its gradient of the facets near the piece at ``c``, and of the point mass."""
    u = gx = gy = gz = 0.0
    for i in range(c + 3, c + 3 + int(params[c + 2])):
        v, vx, vy, vz = facet_pull(params, int(params[i]), x, y, z)
        u += v
        gx += vx
        gy += vy
        gz += vz
    m = 0.5 * params[int(params[0]) + DENSITY]
    s = 1.0 / math.sqrt(x * x + y * y + z * z) if params[c + 1] > 0.0 else 0.0
    p = params[GM] * s
    q = -p * s * s
    return m * u + p, m * gx + q * x, m * gy + q * y, m * gz + q * z


@kernel
def surrounding_potential(params: Params, x: float, y: float, z: float) -> float:
    """Return U."""
    if _is_beyond(params, x, y, z):
        return _outer_pull(params, x, y, z)[0]
    c, px, py, pz, _h = _piece_at(params, x, y, z)
    if c == 0:
        return polyhedron_potential(params[int(params[0]) :], x, y, z)
    return (
        _pull(params, c, x, y, z)[0]
        + polynomial_pull(params, int(params[c]), _degree(params, c), px, py, pz)[0]
    )


@kernel
def surrounding_acceleration(params: Params, x: float, y: float, z: float) -> Vector:
    """Return the gradient of U."""
    if _is_beyond(params, x, y, z):
        return _outer_pull(params, x, y, z)[1:]
    c, px, py, pz, h = _piece_at(params, x, y, z)
    if c == 0:
        return polyhedron_acceleration(params[int(params[0]) :], x, y, z)
    _u, gx, gy, gz = _pull(params, c, x, y, z)
    _f, fx, fy, fz = polynomial_pull(params, int(params[c]), _degree(params, c), px, py, pz)
    return gx + fx / h, gy + fy / h, gz + fz / h


@kernel
def surrounding_acceleration_and_gradient(params: Params, x: float, y: float, z: float) -> VectorAndSymmetric:
    """Return the gradient and the Hessian (xx, yy, zz, xy, xz, yz) of U."""
    if _is_beyond(params, x, y, z):
        return _outer_pull(params, x, y, z)[1:] + _outer_hessian(params, x, y, z)
    c, px, py, pz, h = _piece_at(params, x, y, z)
    if c == 0:
        return polyhedron_acceleration_and_gradient(params[int(params[0]) :], x, y, z)
    gx = gy = gz = xx = yy = zz = xy = xz = yz = 0.0
    for i in range(c + 3, c + 3 + int(params[c + 2])):
        g = facet_gradient(params, int(params[i]), x, y, z)
        gx += g[0]
        gy += g[1]
        gz += g[2]
        xx += g[3]
        yy += g[4]
        zz += g[5]
        xy += g[6]
        xz += g[7]
        yz += g[8]
    f = polynomial_gradient(params, int(params[c]), _degree(params, c), px, py, pz)
    m, p = 0.5 * params[int(params[0]) + DENSITY], 1.0 / h
    q = p * p
    if params[c + 1] > 0.0:
        m = 1.0  # no facet is near
        gx, gy, gz, xx, yy, zz, xy, xz, yz = point_acceleration_and_gradient(params[GM], x, y, z)
    return (
        m * gx + p * f[1],
        m * gy + p * f[2],
        m * gz + p * f[3],
        m * xx + q * f[4],
        m * yy + q * f[5],
        m * zz + q * f[6],
        m * xy + q * f[7],
        m * xz + q * f[8],
        m * yz + q * f[9],
    )


@kernel
def surrounding_curvature(
    params: Params, x: float, y: float, z: float, lx: float, ly: float, lz: float
) -> Symmetric:
    """Return the derivative of the Hessian of U along (lx, ly, lz); the polynomial's by a complex step."""
    if _is_beyond(params, x, y, z):
        return _outer_curvature(params, x, y, z, lx, ly, lz)
    c, px, py, pz, h = _piece_at(params, x, y, z)
    if c == 0:
        return polyhedron_curvature(params[int(params[0]) :], x, y, z, lx, ly, lz)
    xx = yy = zz = xy = xz = yz = 0.0
    for i in range(c + 3, c + 3 + int(params[c + 2])):
        t = facet_curvature(params, int(params[i]), x, y, z, lx, ly, lz)
        xx += t[0]
        yy += t[1]
        zz += t[2]
        xy += t[3]
        xz += t[4]
        yz += t[5]
    f = polynomial_gradient(
        params,
        int(params[c]),
        _degree(params, c),
        complex(px, _STEP * lx),
        complex(py, _STEP * ly),
        complex(pz, _STEP * lz),
    )
    m, q = 0.5 * params[int(params[0]) + DENSITY], 1.0 / (_STEP * h * h * h)
    if params[c + 1] > 0.0:
        m = 1.0  # no facet is near
        xx, yy, zz, xy, xz, yz = point_curvature(params[GM], x, y, z, lx, ly, lz)
    return (
        m * xx + q * f[4].imag,
        m * yy + q * f[5].imag,
        m * zz + q * f[6].imag,
        m * xy + q * f[7].imag,
        m * xz + q * f[8].imag,
        m * yz + q * f[9].imag,
    )
