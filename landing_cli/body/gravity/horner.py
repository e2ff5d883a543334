"""Polynomials of three coordinates and their derivatives, by Horner's scheme.

Their coefficients lie among other parameters: powers of x, then y, then z, falling.
"""

from __future__ import annotations

from typing import Any

from landing_cli.body.gravity.kernel_types import Params
from landing_cli.kernel import part


@part
def polynomial_pull(params: Params, c: int, degree: int, px: Any, py: Any, pz: Any) -> Any:
    """Return the polynomial whose coefficients begin at ``c``, and its gradient; also at complex points."""
    # the head of `polynomial_gradient`, at a third of its sums: flights ask for the pull alone most often
    zero = 0.0 * px
    f = fx = fy = fz = zero
    for i in range(degree + 1):
        q = qy = qz = zero
        for j in range(i + 1):
            s = sz = zero
            for _ in range(j + 1):
                sz = sz * pz + s
                s = s * pz + params[c]
                c += 1
            qy = qy * py + q
            qz = qz * py + sz
            q = q * py + s
        fx = fx * px + f
        fy = fy * px + qy
        fz = fz * px + qz
        f = f * px + q
    return f, fx, fy, fz


@part
def polynomial_gradient(params: Params, c: int, degree: int, px: Any, py: Any, pz: Any) -> Any:
    """Return the same and the Hessian (xx, yy, zz, xy, xz, yz)."""
    zero = 0.0 * px
    # second derivatives along one axis are halved; f_xy is named fxy
    f = fx = fy = fz = fxx = fyy = fzz = fxy = fxz = fyz = zero
    for i in range(degree + 1):
        q = qy = qz = qyy = qzz = qyz = zero
        for j in range(i + 1):
            s = sz = szz = zero
            for _ in range(j + 1):
                szz = szz * pz + sz
                sz = sz * pz + s
                s = s * pz + params[c]
                c += 1
            qyy = qyy * py + qy
            qyz = qyz * py + qz
            qy = qy * py + q
            qzz = qzz * py + szz
            qz = qz * py + sz
            q = q * py + s
        fxx = fxx * px + fx
        fxy = fxy * px + fy
        fxz = fxz * px + fz
        fx = fx * px + f
        fyy = fyy * px + qyy
        fyz = fyz * px + qyz
        fzz = fzz * px + qzz
        fy = fy * px + qy
        fz = fz * px + qz
        f = f * px + q
    return f, fx, fy, fz, 2.0 * fxx, 2.0 * fyy, 2.0 * fzz, fxy, fxz, fyz
