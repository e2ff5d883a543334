"""What a single facet adds to a polyhedron's potential, and the derivatives of that.

With r from the field point to the facet, n its outward normal, h = n.r the height of its plane over the point
and I the integral of 1/r over it, the divergence theorem makes of the body's volume a sum over facets (Werner
& Scheeres 1996)::

    U_f = 1/2 G rho h I,    I = sum_e nu.r L_e - h w,    K = dI/dx = n w - sum_e nu L_e

with nu the outward normals of the edges in the facet's plane, L_e their logarithms and w the solid angle.
Werner & Scheeres drop h K from the gradient, since it vanishes in the sum over a closed surface. Kept, the
derivatives of a sum over any facets are those of one potential::

    2 g / (G rho) = h K - n I,    2 dg/dx / (G rho) = h H - n K' - K n'
    H = dK/dx = n (dw/dx)' - sum_e nu (dL_e/dx)'

For an edge from a to b, as the point sees them, and q = 1/(|a||b| + a.b), dL/dx = e (a/|a| + b/|b|) q and its
share of dw/dx is (a x b)(1/|a| + 1/|b|) q: no logarithm is taken twice.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.kernel_types import FloatArray, Symmetric, VectorAndSymmetric
from landing_cli.body.gravity.polyhedron import edge_log, from_point, solid_angle
from landing_cli.kernel import inlined, kernel, part

FACET = 25
"""Numbers of a facet: three corners, the normal, twice the area; then of each edge its length and nu."""
_EDGES = 13
_ON_EDGE = 1e-15  # of |a||b|: where 1/q is rounding

Pull = tuple[float, float, float, float]


def facet_table(corners: FloatArray) -> FloatArray:
    """Prepare facets for the kernels.

    Parameters
    ----------
    corners : (m, 3, 3) float, m
        Corner i of facet f is ``corners[f, i]``, counter-clockwise seen from outside.

    Returns
    -------
    (m, FACET) float
    """
    along = np.roll(corners, -1, axis=1) - corners
    areas = np.cross(along[:, 0], along[:, 1])
    twice_area = np.linalg.norm(areas, axis=1, keepdims=True)
    normals = areas / twice_area
    length = np.linalg.norm(along, axis=2, keepdims=True)
    edges = np.concatenate([length, np.cross(along / length, normals[:, None])], axis=2)
    m = len(corners)
    return np.hstack([corners.reshape(m, 9), normals, twice_area, edges.reshape(m, 12)])


@inlined
def facet_pull(table: FloatArray, k: int, x: float, y: float, z: float) -> Pull:
    """Return U and its gradient, both times 2/(G rho), of the facet that begins at ``k``."""
    ax, ay, az, a = from_point(table, k, x, y, z)
    bx, by, bz, b = from_point(table, k + 3, x, y, z)
    cx, cy, cz, c = from_point(table, k + 6, x, y, z)
    nx, ny, nz = table[k + 9], table[k + 10], table[k + 11]
    height = ax * nx + ay * ny + az * nz
    bc, ac, ab = bx * cx + by * cy + bz * cz, ax * cx + ay * cy + az * cz, ax * bx + ay * by + az * bz
    w = solid_angle(height * table[k + 12], a * b * c + a * bc + b * ac + c * ab)
    e = k + _EDGES
    p, q, r = edge_log(table[e], a + b), edge_log(table[e + 4], b + c), edge_log(table[e + 8], c + a)
    px, py, pz = p * table[e + 1], p * table[e + 2], p * table[e + 3]
    qx, qy, qz = q * table[e + 5], q * table[e + 6], q * table[e + 7]
    rx, ry, rz = r * table[e + 9], r * table[e + 10], r * table[e + 11]
    spread = px * ax + py * ay + pz * az + qx * bx + qy * by + qz * bz + rx * cx + ry * cy + rz * cz
    spread -= height * w
    return (
        height * spread,
        height * (nx * w - px - qx - rx) - nx * spread,
        height * (ny * w - py - qy - ry) - ny * spread,
        height * (nz * w - pz - qz - rz) - nz * spread,
    )


@kernel
def potential_of(table: FloatArray, chosen: NDArray[np.int64], point: FloatArray) -> float:
    """Return U, times 2/(G rho), of chosen facets of a table at a point (1, 3)."""
    u = 0.0
    for f in range(len(chosen)):
        u += facet_pull(table, FACET * chosen[f], point[0, 0], point[0, 1], point[0, 2])[0]
    return u


@inlined
def _edge(
    table: FloatArray,
    k: int,
    ax: float,
    ay: float,
    az: float,
    a: float,
    bx: float,
    by: float,
    bz: float,
    b: float,
) -> tuple[float, float, float, float, float, float, float]:
    """Return L of the edge at ``k`` from a to b, dL/dx, and its share of dw/dx."""
    inverse_a, inverse_b = 1.0 / a, 1.0 / b
    q = 1.0 / max(a * b + (ax * bx + ay * by + az * bz), _ON_EDGE * a * b)
    turn, pull = (inverse_a + inverse_b) * q, table[k] * q
    return (
        edge_log(table[k], a + b),
        pull * (ax * inverse_a + bx * inverse_b),
        pull * (ay * inverse_a + by * inverse_b),
        pull * (az * inverse_a + bz * inverse_b),
        turn * (ay * bz - az * by),
        turn * (az * bx - ax * bz),
        turn * (ax * by - ay * bx),
    )


@inlined
def facet_gradient(table: FloatArray, k: int, x: float, y: float, z: float) -> VectorAndSymmetric:
    """Return the gradient and the Hessian of U (xx, yy, zz, xy, xz, yz), times 2/(G rho)."""
    ax, ay, az, a = from_point(table, k, x, y, z)
    bx, by, bz, b = from_point(table, k + 3, x, y, z)
    cx, cy, cz, c = from_point(table, k + 6, x, y, z)
    nx, ny, nz = table[k + 9], table[k + 10], table[k + 11]
    height = ax * nx + ay * ny + az * nz
    bc, ac, ab = bx * cx + by * cy + bz * cz, ax * cx + ay * cy + az * cz, ax * bx + ay * by + az * bz
    w = solid_angle(height * table[k + 12], a * b * c + a * bc + b * ac + c * ab)
    wx = wy = wz = spread = kx = ky = kz = xx = yy = zz = xy = xz = yz = 0.0
    for i in range(3):
        e = k + _EDGES + 4 * i
        vx, vy, vz = table[e + 1], table[e + 2], table[e + 3]
        log, lx, ly, lz, sx, sy, sz = _edge(table, e, ax, ay, az, a, bx, by, bz, b)
        spread += log * (vx * ax + vy * ay + vz * az)
        kx -= log * vx
        ky -= log * vy
        kz -= log * vz
        wx += sx
        wy += sy
        wz += sz
        xx -= vx * lx
        yy -= vy * ly
        zz -= vz * lz
        xy -= vx * ly
        xz -= vx * lz
        yz -= vy * lz
        # the next edge goes from b to c, then from c to a
        ax, ay, az, a, bx, by, bz, b, cx, cy, cz, c = bx, by, bz, b, cx, cy, cz, c, ax, ay, az, a
    spread -= height * w
    kx, ky, kz = kx + nx * w, ky + ny * w, kz + nz * w
    return (
        height * kx - nx * spread,
        height * ky - ny * spread,
        height * kz - nz * spread,
        height * (xx + nx * wx) - 2.0 * nx * kx,
        height * (yy + ny * wy) - 2.0 * ny * ky,
        height * (zz + nz * wz) - 2.0 * nz * kz,
        height * (xy + nx * wy) - nx * ky - ny * kx,
        height * (xz + nx * wz) - nx * kz - nz * kx,
        height * (yz + ny * wz) - ny * kz - nz * ky,
    )


@kernel
def fill_gradients(
    table: FloatArray, chosen: NDArray[np.int64], points: FloatArray, g: FloatArray, G: FloatArray
) -> None:
    """Write gradient (k, 3) and Hessian (k, 3, 3) of U, times 2/(G rho), of chosen facets at points."""
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        gx = gy = gz = xx = yy = zz = xy = xz = yz = 0.0
        for f in range(len(chosen)):
            v = facet_gradient(table, FACET * chosen[f], x, y, z)
            gx += v[0]
            gy += v[1]
            gz += v[2]
            xx += v[3]
            yy += v[4]
            zz += v[5]
            xy += v[6]
            xz += v[7]
            yz += v[8]
        g[i, 0], g[i, 1], g[i, 2] = gx, gy, gz
        G[i, 0, 0], G[i, 1, 1], G[i, 2, 2] = xx, yy, zz
        G[i, 0, 1], G[i, 0, 2], G[i, 1, 2] = xy, xz, yz
        G[i, 1, 0], G[i, 2, 0], G[i, 2, 1] = xy, xz, yz


@inlined
def _edge_slope(
    table: FloatArray,
    k: int,
    ax: float,
    ay: float,
    az: float,
    a: float,
    bx: float,
    by: float,
    bz: float,
    b: float,
    lx: float,
    ly: float,
    lz: float,
) -> tuple[float, float, float, float, float, float]:
    """Return the derivatives of dL/dx and of the share of dw/dx along l: a and b change by -l."""
    p, r = 1.0 / a, 1.0 / b
    q = 1.0 / max(a * b + (ax * bx + ay * by + az * bz), _ON_EDGE * a * b)
    la, lb = (lx * ax + ly * ay + lz * az) * p, (lx * bx + ly * by + lz * bz) * r
    dq = q * q * (la * b + lb * a + la * a + lb * b)
    dp, dr = la * p * p, lb * r * r
    pull, dpull = table[k] * q, table[k] * dq
    turn, dturn = (p + r) * q, (dp + dr) * q + (p + r) * dq
    ex, ey, ez = bx - ax, by - ay, bz - az
    return (
        dpull * (ax * p + bx * r) + pull * (ax * dp + bx * dr - lx * (p + r)),
        dpull * (ay * p + by * r) + pull * (ay * dp + by * dr - ly * (p + r)),
        dpull * (az * p + bz * r) + pull * (az * dp + bz * dr - lz * (p + r)),
        dturn * (ay * bz - az * by) - turn * (ly * ez - lz * ey),
        dturn * (az * bx - ax * bz) - turn * (lz * ex - lx * ez),
        dturn * (ax * by - ay * bx) - turn * (lx * ey - ly * ex),
    )


@part
def facet_curvature(
    table: FloatArray, k: int, x: float, y: float, z: float, lx: float, ly: float, lz: float
) -> Symmetric:
    """Return the derivative of the Hessian of U along l, times 2/(G rho).

    It is h dH - n (H l)' - (H l) n' - (n.l) H, with dH that of H along l.
    """
    ax, ay, az, a = from_point(table, k, x, y, z)
    bx, by, bz, b = from_point(table, k + 3, x, y, z)
    cx, cy, cz, c = from_point(table, k + 6, x, y, z)
    nx, ny, nz = table[k + 9], table[k + 10], table[k + 11]
    height, along = ax * nx + ay * ny + az * nz, lx * nx + ly * ny + lz * nz
    xx = yy = zz = xy = xz = yz = 0.0
    txx = tyy = tzz = txy = txz = tyz = 0.0
    for i in range(3):
        e = k + _EDGES + 4 * i
        vx, vy, vz = table[e + 1], table[e + 2], table[e + 3]
        _log, gx, gy, gz, wx, wy, wz = _edge(table, e, ax, ay, az, a, bx, by, bz, b)
        xx += nx * wx - vx * gx
        yy += ny * wy - vy * gy
        zz += nz * wz - vz * gz
        xy += nx * wy - vx * gy
        xz += nx * wz - vx * gz
        yz += ny * wz - vy * gz
        gx, gy, gz, wx, wy, wz = _edge_slope(table, e, ax, ay, az, a, bx, by, bz, b, lx, ly, lz)
        txx += nx * wx - vx * gx
        tyy += ny * wy - vy * gy
        tzz += nz * wz - vz * gz
        txy += nx * wy - vx * gy
        txz += nx * wz - vx * gz
        tyz += ny * wz - vy * gz
        ax, ay, az, a, bx, by, bz, b, cx, cy, cz, c = bx, by, bz, b, cx, cy, cz, c, ax, ay, az, a
    hx, hy, hz = xx * lx + xy * ly + xz * lz, xy * lx + yy * ly + yz * lz, xz * lx + yz * ly + zz * lz
    return (
        height * txx - 2.0 * nx * hx - along * xx,
        height * tyy - 2.0 * ny * hy - along * yy,
        height * tzz - 2.0 * nz * hz - along * zz,
        height * txy - nx * hy - ny * hx - along * xy,
        height * txz - nx * hz - nz * hx - along * xz,
        height * tyz - ny * hz - nz * hy - along * yz,
    )
