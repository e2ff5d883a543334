"""The baseline's compiled flight: fixed-step RK4, by costates (the paper's way) or by thrust nodes.

Scales: length a0 t_p^2, time t_p, mass m0, a0 = T_max / m0; then T_max = 1 and lambda0 = 1/2. Rotating frame.
A problem is one vector: r0 v0 r_c n 1/semi_axes^2 (3 each), spin, v_exhaust, t_final, cos(theta),
compensated (1 or 0), gm, radius, c20, c22, s22.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

R0, V0, RC, NORMAL, SHAPE = 0, 3, 6, 9, 12
SPIN, EXHAUST, FINAL, COSINE, COMPENSATED, GM, RADIUS, C20, C22, S22 = range(15, 25)
STEPS = 40  # RK4 steps of the descent stage
CHECKS = 20  # nodes at which the ellipsoid is checked
ARC = 5  # points of the final arc at which the thrust is checked
SIZE = 2 + CHECKS + 2 + ARC  # objective, transversality, ellipsoid, glide slope, final thrust

compiled = njit(cache=True, nogil=True, error_model="numpy")


@compiled
def gravity(p, x, y, z, out):
    """Acceleration of degree-2 harmonics into out[:3], its Hessian (xx yy zz xy xz yz) into out[3:]."""
    r2 = x * x + y * y + z * z
    i1 = 1.0 / math.sqrt(r2)
    i2 = i1 * i1
    i5 = i1 * i2 * i2
    k = p[GM] * p[RADIUS] ** 2
    a, b, c, d = -0.5 * p[C20] + 3 * p[C22], -0.5 * p[C20] - 3 * p[C22], p[C20], 3 * p[S22]
    hx, hy, hz = a * x + d * y, b * y + d * x, c * z
    q = x * hx + y * hy + z * hz
    radial = -p[GM] * i1 * i2 - 5 * k * q * i5 * i2
    out[0], out[1], out[2] = (
        radial * x + 2 * k * i5 * hx,
        radial * y + 2 * k * i5 * hy,
        radial * z + 2 * k * i5 * hz,
    )
    s = 3 * p[GM] * i5 + 35 * k * q * i5 * i2 * i2
    t, u = -10 * k * i5 * i2, 2 * k * i5
    out[3] = radial + s * x * x + 2 * t * x * hx + u * a
    out[4] = radial + s * y * y + 2 * t * y * hy + u * b
    out[5] = radial + s * z * z + 2 * t * z * hz + u * c
    out[6] = s * x * y + t * (x * hy + y * hx) + u * d
    out[7] = s * x * z + t * (x * hz + z * hx)
    out[8] = s * y * z + t * (y * hz + z * hy)


@compiled
def extremal_rates(p, y, g, f):
    """Rates of (r, v, m, lambda_r, lambda_v, lambda_m, energy) along an extremal (eqs 1, 8-11)."""
    w = p[SPIN]
    gravity(p, y[0], y[1], y[2], g)
    l0, l1, l2 = y[10], y[11], y[12]
    size = math.sqrt(l0 * l0 + l1 * l1 + l2 * l2)
    u = min(max(size / y[6] + y[13] / p[EXHAUST], 0.0), 1.0)
    push = -u / (y[6] * max(size, 1e-300))
    f[0], f[1], f[2] = y[3], y[4], y[5]
    f[3] = 2 * w * y[4] + w * w * y[0] + g[0] + push * l0
    f[4] = -2 * w * y[3] + w * w * y[1] + g[1] + push * l1
    f[5] = g[2] + push * l2
    f[6] = -u / p[EXHAUST]
    f[7] = -w * w * l0 - g[3] * l0 - g[6] * l1 - g[7] * l2
    f[8] = -w * w * l1 - g[6] * l0 - g[4] * l1 - g[8] * l2
    f[9] = -g[7] * l0 - g[8] * l1 - g[5] * l2
    f[10] = -y[7] + 2 * w * l1
    f[11] = -y[8] - 2 * w * l0
    f[12] = -y[9]
    f[13] = -size * u / (y[6] * y[6])
    f[14] = 0.5 * u * u


@compiled
def node_rates(p, y, u, g, f):
    """Rates of (r, v, m, energy in y[14]) under a given thrust u (3,)."""
    w = p[SPIN]
    gravity(p, y[0], y[1], y[2], g)
    square = u[0] * u[0] + u[1] * u[1] + u[2] * u[2]
    f[0], f[1], f[2] = y[3], y[4], y[5]
    f[3] = 2 * w * y[4] + w * w * y[0] + g[0] + u[0] / y[6]
    f[4] = -2 * w * y[3] + w * w * y[1] + g[1] + u[1] / y[6]
    f[5] = g[2] + u[2] / y[6]
    f[6] = -math.sqrt(square) / p[EXHAUST]
    f[14] = 0.5 * square


@compiled
def final_stage(p, y, out):
    """Final stage from the state reached: J2 (returned), glide slope and thrust margins into out."""
    T, w = p[FINAL], p[SPIN]
    g, A, B, d = np.empty(9), np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        d[i] = y[i] - p[RC + i]
        A[i] = 3 * d[i] / T**2 + y[3 + i] / T
        B[i] = -2 * d[i] / T**3 - y[3 + i] / T**2
    for end in range(2):
        along = size = 0.0
        for i in range(3):
            direction = A[i] + end * T * B[i]
            along += direction * p[NORMAL + i]
            size += direction * direction
        out[end] = 2 * (along - p[COSINE] * math.sqrt(size))
    for k in range(ARC):
        s = T * k / (ARC - 1)
        x0 = p[RC] + s * s * (A[0] + B[0] * s)
        x1 = p[RC + 1] + s * s * (A[1] + B[1] * s)
        x2 = p[RC + 2] + s * s * (A[2] + B[2] * s)
        v0, v1 = -s * (2 * A[0] + 3 * B[0] * s), -s * (2 * A[1] + 3 * B[1] * s)
        gravity(p, x0, x1, x2, g)
        c = p[COMPENSATED]
        f0 = 2 * A[0] + 6 * B[0] * s - c * (g[0] + 2 * w * v1 + w * w * x0)
        f1 = 2 * A[1] + 6 * B[1] * s - c * (g[1] - 2 * w * v0 + w * w * x1)
        f2 = 2 * A[2] + 6 * B[2] * s - c * g[2]
        out[2 + k] = 1.0 - y[6] * math.sqrt(f0 * f0 + f1 * f1 + f2 * f2)
    j2 = 0.0
    for i in range(3):
        j2 += 2 * A[i] ** 2 * T + 6 * A[i] * B[i] * T**2 + 6 * B[i] ** 2 * T**3
    return j2


@compiled
def fly(p, z, by_nodes, out):
    """Objective and constraints of one guess into out (SIZE,); equality second, inequalities >= 0."""
    y, w, f, total, g = np.zeros(15), np.zeros(15), np.zeros(15), np.zeros(15), np.empty(9)
    for i in range(6):
        y[i] = p[i]
    y[6] = 1.0
    if not by_nodes:
        for i in range(7):
            y[7 + i] = z[i]
    h, every = 1.0 / STEPS, STEPS // CHECKS
    for step in range(STEPS):
        u = z[3 * (step * (z.shape[0] // 3) // STEPS) :]
        total[:] = 0.0
        for stage in range(4):
            lag = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
            for i in range(15):
                w[i] = y[i] + lag * h * f[i]
            if by_nodes:
                node_rates(p, w, u, g, f)
            else:
                extremal_rates(p, w, g, f)
            weight = h / 3 if 0 < stage < 3 else h / 6
            for i in range(15):
                total[i] += weight * f[i]
        for i in range(15):
            y[i] += total[i]
        if (step + 1) % every == 0:
            depth = y[0] ** 2 * p[SHAPE] + y[1] ** 2 * p[SHAPE + 1] + y[2] ** 2 * p[SHAPE + 2]
            out[1 + (step + 1) // every] = depth - 1.0
    out[1] = y[13]
    out[0] = y[14] + final_stage(p, y, out[2 + CHECKS :])


@compiled
def differences(p, z, by_nodes, base, jacobian):
    """Forward differences of fly into jacobian (len(z), SIZE)."""
    for i in range(z.shape[0]):
        kept = z[i]
        step = 1.5e-8 * max(1.0, abs(kept))
        z[i] = kept + step
        fly(p, z, by_nodes, jacobian[i])
        z[i] = kept
        for k in range(SIZE):
            jacobian[i, k] = (jacobian[i, k] - base[k]) / step
