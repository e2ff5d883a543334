"""A polyhedron of constant density: the exact field of a triangle mesh (Werner & Scheeres 1996).

With r from the field point to a point of the edge or facet, L_e the edge's logarithm and w_f the facet's
solid angle::

    U     = 1/2 G rho [sum_e r.E.r L_e - sum_f r.F.r w_f]
    g     =    -G rho [sum_e   E.r L_e - sum_f   F.r w_f]
    dg/dr =     G rho [sum_e     E L_e - sum_f     F w_f],    its trace is -G rho sum_f w_f

The kernels read one record a facet, once, from front to back. Close to the body as many digits hold as the
mesh has; far away U, g and the Hessian lose (r/R)^2 in relative accuracy, as the sums cancel. On an edge
U and g stay right; the Hessian, which is infinite there, is finite and meaningless.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from landing_cli.body.gravity.checks import checked_gm
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.kernel_types import Params, Symmetric, Vector, VectorAndSymmetric
from landing_cli.body.gravity.polyhedron_records import facet_records
from landing_cli.kernel import inlined, kernel, part

_HEADER = 3
_FACET = 13  # three corners, the unit normal, twice the area
_EDGE = 7  # its length, then E: xx, yy, zz, xy, xz, yz


def polyhedron_field(vertices: ArrayLike, faces: ArrayLike, gm_m3_s2: float) -> GravityField:
    """Return the field of a closed, outward-wound triangle mesh of constant density.

    Parameters
    ----------
    vertices : (n, 3) float, m, body frame
        Relative to the centre of mass, or to whatever origin the positions will refer to.
    faces : (m, 3) int
        0-based vertex indices, counter-clockwise seen from outside.
    gm_m3_s2 : float
        Gravitational parameter of the whole body, m3/s2.

    Returns
    -------
    GravityField
        ``params`` is the number of facets that own two edges, of those that own one, G rho, then the
        records of ``facet_records``.

    Raises
    ------
    InputRefused
        The mesh is not closed, has a facet without area, or is wound inwards; or GM is not positive.
    """
    gm = checked_gm(gm_m3_s2)
    two, one, volume = facet_records(vertices, faces)
    header = [len(two), len(one), gm / volume]
    return GravityField(GravityKind.POLYHEDRON, np.concatenate([header, two.ravel(), one.ravel()]))


@part
def _odd_series(t: float, u: float) -> float:
    """Return 2 (t + t u/3 + t u^2/5 + ...): 2 atanh t for u = t^2, 2 atan t for u = -t^2; |t| < 0.1."""
    u2 = u * u
    low = (1.0 + u * (1.0 / 3.0)) + (0.2 + u * (1.0 / 7.0)) * u2
    high = (1.0 / 9.0 + u * (1.0 / 11.0)) + (1.0 / 13.0 + u * (1.0 / 15.0)) * u2
    return 2.0 * t * (low + high * (u2 * u2))


@part
def edge_log(length: float, r_sum: float) -> float:
    """Return ln((r1 + r2 + e)/(r1 + r2 - e)); on the edge itself it stays finite.

    Far from the edge the logarithm's argument is near 1 and loses its digits; the series keeps them all.
    """
    t = length / r_sum
    if t < 0.1:
        return _odd_series(t, t * t)
    t = min(t, 1.0 - 2.0**-52)
    return math.log((1.0 + t) / (1.0 - t))


@part
def solid_angle(triple: float, dots: float) -> float:
    """Return 2 atan2(a.(b x c), abc + a b.c + b a.c + c a.b) (Van Oosterom & Strackee 1983)."""
    if abs(triple) < 0.1 * dots:
        t = triple / dots
        return _odd_series(t, -t * t)
    return 2.0 * math.atan2(triple, dots)


@part
def from_point(params: Params, k: int, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Return corner ``params[k:k + 3]`` relative to the point, and its distance."""
    rx, ry, rz = params[k] - x, params[k + 1] - y, params[k + 2] - z
    return rx, ry, rz, math.sqrt(rx * rx + ry * ry + rz * rz)


@inlined
def _facet(
    params: Params, k: int, x: float, y: float, z: float
) -> tuple[float, float, float, float, float, float, float, float, float, float, float]:
    """Return the corners a and b with their distances, the distance of c, the height and the solid angle.

    The height is that of the facet's plane over the point: positive where the point lies on the inner side.
    """
    ax, ay, az, a = from_point(params, k, x, y, z)
    bx, by, bz, b = from_point(params, k + 3, x, y, z)
    cx, cy, cz, c = from_point(params, k + 6, x, y, z)
    height = ax * params[k + 9] + ay * params[k + 10] + az * params[k + 11]
    bc, ac, ab = bx * cx + by * cy + bz * cz, ax * cx + ay * cy + az * cz, ax * bx + ay * by + az * bz
    angle = solid_angle(height * params[k + 12], a * b * c + a * bc + b * ac + c * ab)
    return ax, ay, az, a, bx, by, bz, b, c, height, angle


@part
def _edge_pull(params: Params, k: int, r_sum: float, rx: float, ry: float, rz: float) -> Vector:
    """Return E.r L of the edge at ``k``."""
    log = edge_log(params[k], r_sum)
    return (
        log * (params[k + 1] * rx + params[k + 4] * ry + params[k + 5] * rz),
        log * (params[k + 4] * rx + params[k + 2] * ry + params[k + 6] * rz),
        log * (params[k + 5] * rx + params[k + 6] * ry + params[k + 3] * rz),
    )


@kernel
def polyhedron_potential(params: Params, x: float, y: float, z: float) -> float:
    """Return U."""
    twos, facets = int(params[0]), int(params[0]) + int(params[1])
    total = 0.0
    k = _HEADER
    for i in range(facets):
        ax, ay, az, a, bx, by, bz, b, c, height, angle = _facet(params, k, x, y, z)
        px, py, pz = _edge_pull(params, k + _FACET, a + b, ax, ay, az)
        total += px * ax + py * ay + pz * az - height * height * angle
        k += _FACET + _EDGE
        if i < twos:
            px, py, pz = _edge_pull(params, k, b + c, bx, by, bz)
            total += px * bx + py * by + pz * bz
            k += _EDGE
    return 0.5 * params[2] * total


@kernel
def polyhedron_acceleration(params: Params, x: float, y: float, z: float) -> Vector:
    """Return the gradient of U."""
    twos, facets = int(params[0]), int(params[0]) + int(params[1])
    gx = gy = gz = 0.0
    k = _HEADER
    for i in range(facets):
        ax, ay, az, a, bx, by, bz, b, c, height, angle = _facet(params, k, x, y, z)
        nx, ny, nz = params[k + 9], params[k + 10], params[k + 11]
        pull = height * angle
        px, py, pz = _edge_pull(params, k + _FACET, a + b, ax, ay, az)
        gx += pull * nx - px
        gy += pull * ny - py
        gz += pull * nz - pz
        k += _FACET + _EDGE
        if i < twos:
            px, py, pz = _edge_pull(params, k, b + c, bx, by, bz)
            gx -= px
            gy -= py
            gz -= pz
            k += _EDGE
    return params[2] * gx, params[2] * gy, params[2] * gz


@part
def _edge_tensor(params: Params, k: int, factor: float) -> Symmetric:
    """Return E of the edge at ``k``, times ``factor``."""
    return (
        factor * params[k + 1],
        factor * params[k + 2],
        factor * params[k + 3],
        factor * params[k + 4],
        factor * params[k + 5],
        factor * params[k + 6],
    )


@kernel
def polyhedron_acceleration_and_gradient(params: Params, x: float, y: float, z: float) -> VectorAndSymmetric:
    """Return the gradient and the Hessian (xx, yy, zz, xy, xz, yz) of U."""
    twos, facets = int(params[0]), int(params[0]) + int(params[1])
    gx = gy = gz = hxx = hyy = hzz = hxy = hxz = hyz = 0.0
    k = _HEADER
    for i in range(facets):
        ax, ay, az, a, bx, by, bz, b, c, height, angle = _facet(params, k, x, y, z)
        nx, ny, nz = params[k + 9], params[k + 10], params[k + 11]
        wx, wy, wz = angle * nx, angle * ny, angle * nz
        xx, yy, zz, xy, xz, yz = _edge_tensor(params, k + _FACET, edge_log(params[k + _FACET], a + b))
        gx += height * wx - (xx * ax + xy * ay + xz * az)
        gy += height * wy - (xy * ax + yy * ay + yz * az)
        gz += height * wz - (xz * ax + yz * ay + zz * az)
        hxx += xx - wx * nx
        hyy += yy - wy * ny
        hzz += zz - wz * nz
        hxy += xy - wx * ny
        hxz += xz - wx * nz
        hyz += yz - wy * nz
        k += _FACET + _EDGE
        if i < twos:
            xx, yy, zz, xy, xz, yz = _edge_tensor(params, k, edge_log(params[k], b + c))
            gx -= xx * bx + xy * by + xz * bz
            gy -= xy * bx + yy * by + yz * bz
            gz -= xz * bx + yz * by + zz * bz
            hxx += xx
            hyy += yy
            hzz += zz
            hxy += xy
            hxz += xz
            hyz += yz
            k += _EDGE
    m = params[2]
    return m * gx, m * gy, m * gz, m * hxx, m * hyy, m * hzz, m * hxy, m * hxz, m * hyz


@part
def edge_log_slope(length: float, r_sum: float, r_sum_slope: float) -> float:
    """Return the derivative of the edge's logarithm, given that of r1 + r2."""
    return -2.0 * length * r_sum_slope / ((r_sum - length) * (r_sum + length))


@kernel
def polyhedron_curvature(
    params: Params, x: float, y: float, z: float, lx: float, ly: float, lz: float
) -> Symmetric:
    """Return the derivative of the Hessian of U along (lx, ly, lz).

    Only the logarithms and the solid angles depend on the point. Moving it along l moves every corner by -l
    as the point sees it: d|a| = -l.a/|a|, d(a.b) = -l.(a + b), and the triple product changes by -2 A l.n.
    """
    twos, facets = int(params[0]), int(params[0]) + int(params[1])
    txx = tyy = tzz = txy = txz = tyz = 0.0
    k = _HEADER
    for i in range(facets):
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
        dots_slope = (
            da * (b * c + bc)
            + db * (a * c + ac)
            + dc * (a * b + ab)
            - (a * (lb + lc) + b * (la + lc) + c * (la + lb))
        )
        norm = triple * triple + dots * dots
        angle_slope = 2.0 * (dots * triple_slope - triple * dots_slope) / norm
        wx, wy, wz = angle_slope * nx, angle_slope * ny, angle_slope * nz
        e = k + _FACET
        xx, yy, zz, xy, xz, yz = _edge_tensor(params, e, edge_log_slope(params[e], a + b, da + db))
        txx += xx - wx * nx
        tyy += yy - wy * ny
        tzz += zz - wz * nz
        txy += xy - wx * ny
        txz += xz - wx * nz
        tyz += yz - wy * nz
        k += _FACET + _EDGE
        if i < twos:
            xx, yy, zz, xy, xz, yz = _edge_tensor(params, k, edge_log_slope(params[k], b + c, db + dc))
            txx += xx
            tyy += yy
            tzz += zz
            txy += xy
            txz += xz
            tyz += yz
            k += _EDGE
    m = params[2]
    return m * txx, m * tyy, m * tzz, m * txy, m * txz, m * tyz


@part
def laplacian(params: Params, x: float, y: float, z: float) -> float:
    """Return the Laplacian of U, 1/s2: 0 outside the body and -4 pi G rho inside."""
    return -4.0 * math.pi * params[2] * inside_share(params, x, y, z)


@kernel
def inside_share(params: Params, x: float, y: float, z: float) -> float:
    """Return the solid angle that the surface fills, over 4 pi: 0 outside, 1 inside, between on a facet."""
    twos, facets = int(params[0]), int(params[0]) + int(params[1])
    total = 0.0
    k = _HEADER
    for i in range(facets):
        total += _facet(params, k, x, y, z)[10]
        k += _FACET + _EDGE
        if i < twos:
            k += _EDGE
    return total / (4.0 * math.pi)
