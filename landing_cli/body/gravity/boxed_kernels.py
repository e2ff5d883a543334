"""Evaluation of an interpolated field: down the tree of boxes, then Horner's scheme; else the polyhedron.

The parameters are where the polyhedron's own begin and where the coefficients begin, the box's origin, axes
(rows), center and half, the tree, the coefficients piece by piece, and the polyhedron's parameters.
"""

from __future__ import annotations

from landing_cli.body.gravity.horner import polynomial_gradient
from landing_cli.body.gravity.kernel_types import Params, Symmetric, Vector, VectorAndSymmetric
from landing_cli.body.gravity.polyhedron import (
    polyhedron_acceleration,
    polyhedron_acceleration_and_gradient,
    polyhedron_curvature,
    polyhedron_potential,
)
from landing_cli.kernel import kernel, part

DEGREE = 10
PER_PIECE = (DEGREE + 1) * (DEGREE + 2) * (DEGREE + 3) // 6
HEADER = 20
_ORIGIN, _AXES, _CENTER, _HALF = 2, 5, 14, 17
_ROUNDING = 1e-9  # of the box: how far outside a point still counts as on its face

Fitted = tuple[bool, float, float, float, float, float, float, float, float, float, float]


@part
def _fitted_values(params: Params, x: float, y: float, z: float) -> Fitted:
    """Return whether a piece holds the point, then U, g and its gradient (xx, yy, zz, xy, xz, yz)."""
    nothing = (False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    dx, dy, dz = x - params[_ORIGIN], y - params[_ORIGIN + 1], z - params[_ORIGIN + 2]
    a = params[_AXES : _AXES + 9]
    px = a[0] * dx + a[1] * dy + a[2] * dz - params[_CENTER]
    py = a[3] * dx + a[4] * dy + a[5] * dz - params[_CENTER + 1]
    pz = a[6] * dx + a[7] * dy + a[8] * dz - params[_CENTER + 2]
    hx, hy, hz = params[_HALF], params[_HALF + 1], params[_HALF + 2]
    reach = 1.0 + _ROUNDING
    if not (abs(px) <= hx * reach and abs(py) <= hy * reach and abs(pz) <= hz * reach):
        return nothing
    node = int(params[HEADER])
    while node > 0:
        # the longest side is halved, the first of equals
        if hx >= hy and hx >= hz:
            hx *= 0.5
            upper = px >= 0.0
            px += -hx if upper else hx
        elif hy >= hz:
            hy *= 0.5
            upper = py >= 0.0
            py += -hy if upper else hy
        else:
            hz *= 0.5
            upper = pz >= 0.0
            pz += -hz if upper else hz
        node = int(params[HEADER + node + (1 if upper else 0)])
    if node == 0:
        return nothing
    px, py, pz = px / hx, py / hy, pz / hz
    c = int(params[1]) + (-node - 1) * PER_PIECE
    f, fx, fy, fz, fxx, fyy, fzz, fxy, fxz, fyz = polynomial_gradient(params, c, DEGREE, px, py, pz)
    fx, fy, fz = fx / hx, fy / hy, fz / hz
    fxx, fyy, fzz = fxx / (hx * hx), fyy / (hy * hy), fzz / (hz * hz)
    fxy, fxz, fyz = fxy / (hx * hy), fxz / (hx * hz), fyz / (hy * hz)
    # columns of (gradient times axes), then axes' times those
    ax = fxx * a[0] + fxy * a[3] + fxz * a[6]
    ay = fxy * a[0] + fyy * a[3] + fyz * a[6]
    az = fxz * a[0] + fyz * a[3] + fzz * a[6]
    bx = fxx * a[1] + fxy * a[4] + fxz * a[7]
    by = fxy * a[1] + fyy * a[4] + fyz * a[7]
    bz = fxz * a[1] + fyz * a[4] + fzz * a[7]
    cx = fxx * a[2] + fxy * a[5] + fxz * a[8]
    cy = fxy * a[2] + fyy * a[5] + fyz * a[8]
    cz = fxz * a[2] + fyz * a[5] + fzz * a[8]
    return (
        True,
        f,
        a[0] * fx + a[3] * fy + a[6] * fz,
        a[1] * fx + a[4] * fy + a[7] * fz,
        a[2] * fx + a[5] * fy + a[8] * fz,
        a[0] * ax + a[3] * ay + a[6] * az,
        a[1] * bx + a[4] * by + a[7] * bz,
        a[2] * cx + a[5] * cy + a[8] * cz,
        a[1] * ax + a[4] * ay + a[7] * az,
        a[2] * ax + a[5] * ay + a[8] * az,
        a[2] * bx + a[5] * by + a[8] * bz,
    )


@kernel
def boxed_potential(params: Params, x: float, y: float, z: float) -> float:
    """Return U."""
    fitted = _fitted_values(params, x, y, z)
    if fitted[0]:
        return fitted[1]
    return polyhedron_potential(params[int(params[0]) :], x, y, z)


@kernel
def boxed_acceleration(params: Params, x: float, y: float, z: float) -> Vector:
    """Return the gradient of U."""
    fitted = _fitted_values(params, x, y, z)
    if fitted[0]:
        return fitted[2], fitted[3], fitted[4]
    return polyhedron_acceleration(params[int(params[0]) :], x, y, z)


@kernel
def boxed_acceleration_and_gradient(params: Params, x: float, y: float, z: float) -> VectorAndSymmetric:
    """Return the gradient and the Hessian (xx, yy, zz, xy, xz, yz) of U."""
    fitted = _fitted_values(params, x, y, z)
    if fitted[0]:
        return fitted[2:]
    return polyhedron_acceleration_and_gradient(params[int(params[0]) :], x, y, z)


@kernel
def boxed_curvature(
    params: Params, x: float, y: float, z: float, lx: float, ly: float, lz: float
) -> Symmetric:
    """Return the derivative of the polyhedron's Hessian along (lx, ly, lz): third derivatives are its own."""
    return polyhedron_curvature(params[int(params[0]) :], x, y, z, lx, ly, lz)
