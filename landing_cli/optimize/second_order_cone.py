"""Nesterov-Todd scaling in the second-order cone Q = {(s0, s1) : s0 >= |s1|} of R^4.

The notation follows Vandenberghe, "The CVXOPT linear and quadratic cone program solvers" (2010):
for interior s and z there is one scaling W with W z = W^-1 s = lambda. With the scaling point w
(w0^2 - |w1|^2 = 1), J = diag(1, -1, -1, -1) and v = (w + e) / sqrt(2 (w0 + 1)),

    W = beta (2 v v' - J),    W^-2 = beta^-2 (2 (J w)(J w)' - J).

Cones are passed as four numbers, or as four lanes (`kernel_lanes`): they stay in registers and nothing is
allocated.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import part
from landing_cli.kernel_lanes import choose

Floats = NDArray[np.float64]

TINY = 1e-300
UNBOUNDED = 1e9


@part
def scaling_point(
    s0: float, s1: float, s2: float, s3: float, z0: float, z1: float, z2: float, z3: float
) -> tuple[float, float, float, float, float]:
    """Scaling point w and 1/beta^2 of an interior primal-dual pair.

    Returns
    -------
    w0, w1, w2, w3, inverse_beta2 : float
    """
    s_norm = math.sqrt(max(s0 * s0 - s1 * s1 - s2 * s2 - s3 * s3, TINY))
    z_norm = math.sqrt(max(z0 * z0 - z1 * z1 - z2 * z2 - z3 * z3, TINY))
    p, q = 1.0 / s_norm, 1.0 / z_norm
    gamma = math.sqrt(0.5 * (1.0 + p * q * (s0 * z0 + s1 * z1 + s2 * z2 + s3 * z3)))
    half = 0.5 / gamma
    return (
        (s0 * p + z0 * q) * half,
        (s1 * p - z1 * q) * half,
        (s2 * p - z2 * q) * half,
        (s3 * p - z3 * q) * half,
        z_norm * p,
    )


@part
def apply_scaling(
    v0: float, v1: float, v2: float, v3: float, beta: float, x0: float, x1: float, x2: float, x3: float
) -> tuple[float, float, float, float]:
    """W x for v = (w + e) / sqrt(2 (w0 + 1))."""
    t = 2.0 * (v0 * x0 + v1 * x1 + v2 * x2 + v3 * x3)
    return beta * (t * v0 - x0), beta * (t * v1 + x1), beta * (t * v2 + x2), beta * (t * v3 + x3)


@part
def apply_inverse_scaling(
    v0: float,
    v1: float,
    v2: float,
    v3: float,
    inverse_beta: float,
    x0: float,
    x1: float,
    x2: float,
    x3: float,
) -> tuple[float, float, float, float]:
    """W^-1 x for v = (w + e) / sqrt(2 (w0 + 1))."""
    t = 2.0 * (v0 * x0 - v1 * x1 - v2 * x2 - v3 * x3)
    return (
        inverse_beta * (t * v0 - x0),
        inverse_beta * (x1 - t * v1),
        inverse_beta * (x2 - t * v2),
        inverse_beta * (x3 - t * v3),
    )


@part
def apply_inverse_scaling_squared(
    w0: float,
    w1: float,
    w2: float,
    w3: float,
    inverse_beta2: float,
    x0: float,
    x1: float,
    x2: float,
    x3: float,
) -> tuple[float, float, float, float]:
    """W^-2 x."""
    t = 2.0 * (w0 * x0 - w1 * x1 - w2 * x2 - w3 * x3)
    return (
        inverse_beta2 * (t * w0 - x0),
        inverse_beta2 * (x1 - t * w1),
        inverse_beta2 * (x2 - t * w2),
        inverse_beta2 * (x3 - t * w3),
    )


@part
def complementarity_shift(
    w: Floats,
    inverse_beta2: float,
    z: Floats,
    affine_ds: Floats,
    affine_dz: Floats,
    target: float,
) -> tuple[float, float, float, float]:
    """Return the constant o of the Newton step dz = o - W^-2 ds.

    It solves lambda o (W dz + W^-1 ds) = target e - lambda o lambda - (W^-1 ds_a) o (W dz_a), where
    ``o`` is the cone's Jordan product and the last term is Mehrotra's second-order correction.

    Parameters
    ----------
    w, z, affine_ds, affine_dz : 4 floats each
        Scaling point, dual point, and the affine (predictor) directions.
    inverse_beta2 : float
        Scaling factor 1/beta^2.
    target : float
        Centring target sigma mu.

    Returns
    -------
    o0, o1, o2, o3 : float
    """
    inverse_beta = math.sqrt(inverse_beta2)
    beta, scale = 1.0 / inverse_beta, 1.0 / math.sqrt(2.0 * (w[0] + 1.0))
    v0, v1, v2, v3 = (w[0] + 1.0) * scale, w[1] * scale, w[2] * scale, w[3] * scale
    l0, l1, l2, l3 = apply_scaling(v0, v1, v2, v3, beta, z[0], z[1], z[2], z[3])
    q0, q1, q2, q3 = apply_scaling(
        v0, v1, v2, v3, beta, affine_dz[0], affine_dz[1], affine_dz[2], affine_dz[3]
    )
    p0, p1, p2, p3 = apply_inverse_scaling(
        v0, v1, v2, v3, inverse_beta, affine_ds[0], affine_ds[1], affine_ds[2], affine_ds[3]
    )
    r0 = target - (l0 * l0 + l1 * l1 + l2 * l2 + l3 * l3) - (p0 * q0 + p1 * q1 + p2 * q2 + p3 * q3)
    r1 = -2.0 * l0 * l1 - p0 * q1 - q0 * p1
    r2 = -2.0 * l0 * l2 - p0 * q2 - q0 * p2
    r3 = -2.0 * l0 * l3 - p0 * q3 - q0 * p3
    # x with lambda o x = r
    determinant = max(l0 * l0 - l1 * l1 - l2 * l2 - l3 * l3, TINY)
    x0 = (l0 * r0 - l1 * r1 - l2 * r2 - l3 * r3) / determinant
    shrink = 1.0 / l0
    x1, x2, x3 = shrink * (r1 - x0 * l1), shrink * (r2 - x0 * l2), shrink * (r3 - x0 * l3)
    return apply_inverse_scaling(v0, v1, v2, v3, inverse_beta, x0, x1, x2, x3)


@part
def longest_step(
    s0: float, s1: float, s2: float, s3: float, d0: float, d1: float, d2: float, d3: float
) -> float:
    """Largest t with s + t d in the cone, for s inside it (capped at ``UNBOUNDED``)."""
    a = d0 * d0 - d1 * d1 - d2 * d2 - d3 * d3
    b = s0 * d0 - s1 * d1 - s2 * d2 - s3 * d3
    c = s0 * s0 - s1 * s1 - s2 * s2 - s3 * s3
    discriminant = b * b - a * c
    root = math.sqrt(max(discriminant, 0.0))
    # the first root t of a t^2 + 2 b t + c, in the form that does not cancel
    above, below = choose(b <= 0.0, c, b + root), choose(b <= 0.0, root - b, -a)
    t = choose((discriminant >= 0.0) & (below > 0.0), above / below, UNBOUNDED)
    return min(t, choose(d0 < 0.0, -s0 / d0, UNBOUNDED))
