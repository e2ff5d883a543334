"""Evaluation of an interpolated field: down a tree of cubes; near facets exactly, far ones as a polynomial.

The parameters are where the polyhedron's own begin and where the coefficients begin, the center and the half
side of the first cube, then the tree: at every node the first of its eight children, which follow each other,
or less the place of its piece. Then come the facets, the pieces (where its coefficients are, how many facets
are near, and where they are), the coefficients of the pulls of far facets, three a power, and the polyhedron.

The pull of a facet and its gradient, with r from the point to its edges, their outward normals nu in its
plane, their logarithms L, its height h over the point and its solid angle w (Werner & Scheeres 1996)::

    g = G rho n I,  I = h w - sum_e nu.r L,    dg_i/dr_j = G rho n_i (sum_e nu L - n w)_j

Sums over some facets are no gradient of a potential, so dg_i/dr_j is taken with i <= j everywhere.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.kernel_types import FloatArray, Params, Symmetric, Vector, VectorAndSymmetric
from landing_cli.body.gravity.polyhedron import (
    edge_log,
    edge_log_slope,
    from_point,
    polyhedron_acceleration,
    polyhedron_acceleration_and_gradient,
    polyhedron_curvature,
    polyhedron_potential,
    solid_angle,
)
from landing_cli.kernel import kernel

DEGREE = 7
POWERS = (DEGREE + 1) * (DEGREE + 2) * (DEGREE + 3) // 6
HEADER = 6
_CENTER, _HALF = 2, 5
_DENSITY = 2  # where a polyhedron's parameters hold G rho
FACET = (
    25  # three corners, the normal, twice the area; of each edge from a corner to the next its length and nu
)
_EDGES = 13

# What takes values at +-1/8, 1/4, 3/8 and 1/2 to the slope at 0, exactly for powers below the ninth.
_SLOPE_AT = (0.125, 0.25, 0.375, 0.5)
_SLOPE_WEIGHTS = (6.4, -1.6, 32.0 / 105.0, -1.0 / 35.0)


@kernel
def _piece_at(params: Params, x: float, y: float, z: float) -> tuple[int, float, float, float, float]:
    """Return the place of the piece that holds a point, 0 for none; where in it, -1 to 1; its half side."""
    px, py, pz, h = x - params[_CENTER], y - params[_CENTER + 1], z - params[_CENTER + 2], params[_HALF]
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


@kernel
def _far_pull(params: Params, c: int, px: float, py: float, pz: float) -> Vector:
    """Return the pull of far facets whose coefficients begin at ``c``."""
    gx = gy = gz = 0.0
    for i in range(DEGREE + 1):
        qx = qy = qz = 0.0
        for j in range(i + 1):
            sx = sy = sz = 0.0
            for _ in range(j + 1):
                sx = sx * pz + params[c]
                sy = sy * pz + params[c + 1]
                sz = sz * pz + params[c + 2]
                c += 3
            qx = qx * py + sx
            qy = qy * py + sy
            qz = qz * py + sz
        gx = gx * px + qx
        gy = gy * px + qy
        gz = gz * px + qz
    return gx, gy, gz


@kernel
def _far_gradient(params: Params, c: int, px: float, py: float, pz: float) -> VectorAndSymmetric:
    """Return that pull and its derivatives xx, yy, zz, xy, xz, yz by the piece's coordinates."""
    gx = gy = gz = xx = yy = zz = xy = xz = yz = 0.0
    for i in range(DEGREE + 1):
        qx = qy = qz = qxy = qxz = qyy = qyz = qzz = 0.0
        for j in range(i + 1):
            sx = sy = sz = sxz = syz = szz = 0.0
            for _ in range(j + 1):
                sxz = sxz * pz + sx
                syz = syz * pz + sy
                szz = szz * pz + sz
                sx = sx * pz + params[c]
                sy = sy * pz + params[c + 1]
                sz = sz * pz + params[c + 2]
                c += 3
            qxy = qxy * py + qx
            qyy = qyy * py + qy
            qxz = qxz * py + sxz
            qyz = qyz * py + syz
            qzz = qzz * py + szz
            qx = qx * py + sx
            qy = qy * py + sy
            qz = qz * py + sz
        xx = xx * px + gx
        xy = xy * px + qxy
        xz = xz * px + qxz
        yy = yy * px + qyy
        yz = yz * px + qyz
        zz = zz * px + qzz
        gx = gx * px + qx
        gy = gy * px + qy
        gz = gz * px + qz
    return gx, gy, gz, xx, yy, zz, xy, xz, yz


@kernel
def _facet_terms(params: Params, k: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Return I and sum_e nu L - n w of the facet at ``k``."""
    ax, ay, az, a = from_point(params, k, x, y, z)
    bx, by, bz, b = from_point(params, k + 3, x, y, z)
    cx, cy, cz, c = from_point(params, k + 6, x, y, z)
    nx, ny, nz = params[k + 9], params[k + 10], params[k + 11]
    height = ax * nx + ay * ny + az * nz
    bc, ac, ab = bx * cx + by * cy + bz * cz, ax * cx + ay * cy + az * cz, ax * bx + ay * by + az * bz
    angle = solid_angle(height * params[k + 12], a * b * c + a * bc + b * ac + c * ab)
    e = k + _EDGES
    p, q, r = (
        edge_log(params[e], a + b),
        edge_log(params[e + 4], b + c),
        edge_log(params[e + 8], c + a),
    )
    value = height * angle - p * (params[e + 1] * ax + params[e + 2] * ay + params[e + 3] * az)
    value -= q * (params[e + 5] * bx + params[e + 6] * by + params[e + 7] * bz)
    value -= r * (params[e + 9] * cx + params[e + 10] * cy + params[e + 11] * cz)
    return (
        value,
        p * params[e + 1] + q * params[e + 5] + r * params[e + 9] - angle * nx,
        p * params[e + 2] + q * params[e + 6] + r * params[e + 10] - angle * ny,
        p * params[e + 3] + q * params[e + 7] + r * params[e + 11] - angle * nz,
    )


@kernel
def _facet_slopes(
    params: Params, k: int, x: float, y: float, z: float, lx: float, ly: float, lz: float
) -> Vector:
    """Return the derivative of sum_e nu L - n w of the facet at ``k`` along l.

    See ``polyhedron_curvature``.
    """
    ax, ay, az, a = from_point(params, k, x, y, z)
    bx, by, bz, b = from_point(params, k + 3, x, y, z)
    cx, cy, cz, c = from_point(params, k + 6, x, y, z)
    nx, ny, nz, twice_area = params[k + 9], params[k + 10], params[k + 11], params[k + 12]
    bc, ac, ab = bx * cx + by * cy + bz * cz, ax * cx + ay * cy + az * cz, ax * bx + ay * by + az * bz
    triple = (ax * nx + ay * ny + az * nz) * twice_area
    dots = a * b * c + a * bc + b * ac + c * ab
    la, lb, lc = lx * ax + ly * ay + lz * az, lx * bx + ly * by + lz * bz, lx * cx + ly * cy + lz * cz
    da, db, dc = -la / a, -lb / b, -lc / c
    triple_slope = -(lx * nx + ly * ny + lz * nz) * twice_area
    dots_slope = da * (b * c + bc) + db * (a * c + ac) + dc * (a * b + ab)
    dots_slope -= a * (lb + lc) + b * (la + lc) + c * (la + lb)
    angle = 2.0 * (dots * triple_slope - triple * dots_slope) / (triple * triple + dots * dots)
    e = k + _EDGES
    p, q, r = (
        edge_log_slope(params[e], a + b, da + db),
        edge_log_slope(params[e + 4], b + c, db + dc),
        edge_log_slope(params[e + 8], c + a, dc + da),
    )
    return (
        p * params[e + 1] + q * params[e + 5] + r * params[e + 9] - angle * nx,
        p * params[e + 2] + q * params[e + 6] + r * params[e + 10] - angle * ny,
        p * params[e + 3] + q * params[e + 7] + r * params[e + 11] - angle * nz,
    )


@kernel
def fill_pulls(table: FloatArray, chosen: NDArray[np.int64], points: FloatArray, pulls: FloatArray) -> None:
    """Write the pull (k, 3) of chosen facets of a table at points (k, 3), without G rho."""
    for i in range(len(points)):
        gx = gy = gz = 0.0
        for f in range(len(chosen)):
            k = FACET * chosen[f]
            value = _facet_terms(table, k, points[i, 0], points[i, 1], points[i, 2])[0]
            gx += value * table[k + 9]
            gy += value * table[k + 10]
            gz += value * table[k + 11]
        pulls[i, 0], pulls[i, 1], pulls[i, 2] = gx, gy, gz


@kernel
def interpolated_potential(params: Params, x: float, y: float, z: float) -> float:
    """Return U: the polyhedron's, as no flight asks for it."""
    return polyhedron_potential(params[int(params[0]) :], x, y, z)


@kernel
def interpolated_acceleration(params: Params, x: float, y: float, z: float) -> Vector:
    """Return the gradient of U."""
    c, px, py, pz, _h = _piece_at(params, x, y, z)
    if c == 0:
        return polyhedron_acceleration(params[int(params[0]) :], x, y, z)
    gx = gy = gz = 0.0
    for i in range(c + 2, c + 2 + int(params[c + 1])):
        k = int(params[i])
        value = _facet_terms(params, k, x, y, z)[0]
        gx += value * params[k + 9]
        gy += value * params[k + 10]
        gz += value * params[k + 11]
    fx, fy, fz = _far_pull(params, int(params[c]), px, py, pz)
    m = params[int(params[0]) + _DENSITY]
    return fx + m * gx, fy + m * gy, fz + m * gz


@kernel
def interpolated_acceleration_and_gradient(
    params: Params, x: float, y: float, z: float
) -> VectorAndSymmetric:
    """Return the gradient and the Hessian (xx, yy, zz, xy, xz, yz) of U."""
    c, px, py, pz, h = _piece_at(params, x, y, z)
    if c == 0:
        return polyhedron_acceleration_and_gradient(params[int(params[0]) :], x, y, z)
    gx = gy = gz = xx = yy = zz = xy = xz = yz = 0.0
    for i in range(c + 2, c + 2 + int(params[c + 1])):
        k = int(params[i])
        value, vx, vy, vz = _facet_terms(params, k, x, y, z)
        nx, ny, nz = params[k + 9], params[k + 10], params[k + 11]
        gx += value * nx
        gy += value * ny
        gz += value * nz
        xx += nx * vx
        yy += ny * vy
        zz += nz * vz
        xy += nx * vy
        xz += nx * vz
        yz += ny * vz
    f = _far_gradient(params, int(params[c]), px, py, pz)
    m = params[int(params[0]) + _DENSITY]
    return (
        f[0] + m * gx,
        f[1] + m * gy,
        f[2] + m * gz,
        f[3] / h + m * xx,
        f[4] / h + m * yy,
        f[5] / h + m * zz,
        f[6] / h + m * xy,
        f[7] / h + m * xz,
        f[8] / h + m * yz,
    )


@kernel
def interpolated_curvature(
    params: Params, x: float, y: float, z: float, lx: float, ly: float, lz: float
) -> Symmetric:
    """Return the derivative of the Hessian of U along (lx, ly, lz).

    Along a line the far facets' gradient is a polynomial: central differences give its slope exactly.
    """
    c, px, py, pz, h = _piece_at(params, x, y, z)
    size = max(abs(lx), abs(ly), abs(lz))
    if c == 0 or not size > 0.0:
        return polyhedron_curvature(params[int(params[0]) :], x, y, z, lx, ly, lz)
    xx = yy = zz = xy = xz = yz = 0.0
    m = params[int(params[0]) + _DENSITY]
    for i in range(c + 2, c + 2 + int(params[c + 1])):
        k = int(params[i])
        vx, vy, vz = _facet_slopes(params, k, x, y, z, lx, ly, lz)
        nx, ny, nz = m * params[k + 9], m * params[k + 10], m * params[k + 11]
        xx += nx * vx
        yy += ny * vy
        zz += nz * vz
        xy += nx * vy
        xz += nx * vz
        yz += ny * vz
    for i in range(2 * len(_SLOPE_AT)):
        sign = 1.0 - 2.0 * (i % 2)
        step, weight = sign * _SLOPE_AT[i // 2] / size, sign * _SLOPE_WEIGHTS[i // 2] * size / (h * h)
        f = _far_gradient(params, int(params[c]), px + step * lx, py + step * ly, pz + step * lz)
        xx += weight * f[3]
        yy += weight * f[4]
        zz += weight * f[5]
        xy += weight * f[6]
        xz += weight * f[7]
        yz += weight * f[8]
    return xx, yy, zz, xy, xz, yz
