"""Where a path comes near the ellipsoid and leaves again (Zhao 2022, eq 5).

A dip is a local minimum over time of |xi| = sqrt(r' Re r), found where its rate changes sign within a step
and refined on the cubic Hermite interpolant between the step's ends.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import part
from landing_cli.kernel_record import by_reference
from landing_cli.reach.costate_dynamics import Extremal

Floats = NDArray[np.float64]

MAX_DIPS = 4
# Dips that stay above this level of |xi| do not count.
FAR = 1.2
# A dip: the step it lies in, where in the step, |xi|, and the second derivative of |xi| over time.
STEP, FRACTION, LEVEL, BEND = range(4)


@by_reference
class Dips(NamedTuple):
    """The dips of one path."""

    places: Floats  # (MAX_DIPS, 4)
    normal: Floats  # (3,), and what follows: scratch space
    r: Floats  # (3,)
    v: Floats  # (3,)
    dr: Floats  # (3, 7)
    dv: Floats  # (3, 7)
    rate: Floats  # (7,)
    bend: Floats  # (3, 3)


@part
def level_and_gradient(inverse_axes: Floats, r: Floats, normal: Floats) -> float:
    """|xi| = sqrt(r' Re r), and its gradient into ``normal``."""
    level2 = 0.0
    for i in range(3):
        level2 += (inverse_axes[i] * r[i]) ** 2
    level = max(math.sqrt(level2), 1e-9)
    for i in range(3):
        normal[i] = inverse_axes[i] ** 2 * r[i] / level
    return level


@part
def add_level_bend(inverse_axes: Floats, level: float, normal: Floats, weight: float, K: Floats) -> None:
    """Add ``weight`` times the Hessian of |xi| to the leading 3 x 3 block."""
    for i in range(3):
        K[i, i] += weight * inverse_axes[i] ** 2 / level
        for j in range(3):
            K[i, j] -= weight * normal[i] * normal[j] / level


def new_dips() -> Dips:
    """Room for the dips of one path."""
    return Dips(
        np.zeros((MAX_DIPS, 4)),
        np.zeros(3),
        np.zeros(3),
        np.zeros(3),
        np.zeros((3, 7)),
        np.zeros((3, 7)),
        np.zeros(7),
        np.zeros((3, 3)),
    )


@part
def hermite(f: float) -> tuple[float, float, float, float, float, float, float, float]:
    """Cubic Hermite weights of (r0, h v0, r1, h v1) for the value and for h times the rate at f in [0, 1]."""
    g = 1.0 - f
    return (
        g * g * (1.0 + 2.0 * f),
        g * g * f,
        f * f * (3.0 - 2.0 * f),
        -f * f * g,
        -6.0 * f * g,
        g * (1.0 - 3.0 * f),
        6.0 * f * g,
        f * (3.0 * f - 2.0),
    )


@part
def interpolate(h: float, f: float, before: Floats, after: Floats, r: Floats, v: Floats) -> None:
    """Position and velocity within a step, from the states at its ends."""
    a, b, c, d, ta, tb, tc, td = hermite(f)
    for i in range(3):
        r[i] = a * before[i] + b * h * before[3 + i] + c * after[i] + d * h * after[3 + i]
        v[i] = (ta * before[i] + tc * after[i]) / h + tb * before[3 + i] + td * after[3 + i]


@part
def find_dips(inverse_axes: Floats, extremal: Extremal, n: int, dips: Dips) -> int:
    """Find where the path comes near the ellipsoid and leaves again; returns how many places.

    The rate of |xi| changes sign from - to + within a step; the place is refined on the cubic Hermite
    interpolant. The last node belongs to the handover's row.
    """
    count = 0
    places, normal, r, v = dips.places, dips.normal, dips.r, dips.v
    level_and_gradient(inverse_axes, extremal.state[0], normal)
    before = _dot3(normal, extremal.state[0], 3)
    for k in range(n):
        level = level_and_gradient(inverse_axes, extremal.state[k + 1], normal)
        after = _dot3(normal, extremal.state[k + 1], 3)
        if before < 0.0 and after >= 0.0 and level < 1.5 * FAR and count < MAX_DIPS:
            lo, hi, f_lo, f_hi = 0.0, 1.0, before, after
            f = 0.0
            for _ in range(30):
                f = hi - f_hi * (hi - lo) / (f_hi - f_lo)
                interpolate(extremal.step[k], f, extremal.state[k], extremal.state[k + 1], r, v)
                level = level_and_gradient(inverse_axes, r, normal)
                rate = _dot3(normal, v, 0)
                if abs(rate) < 1e-13 or hi - lo < 1e-12:
                    break
                if rate > 0.0:
                    hi, f_hi, f_lo = f, rate, 0.5 * f_lo
                else:
                    lo, f_lo, f_hi = f, rate, 0.5 * f_hi
            if level < FAR:
                places[count, STEP], places[count, FRACTION], places[count, LEVEL] = k, f, level
                places[count, BEND] = max((after - before) / extremal.step[k], 1e-9)
                count += 1
        before = after
    return count


@part
def _dot3(a: Floats, b: Floats, offset: int) -> float:
    return a[0] * b[offset] + a[1] * b[offset + 1] + a[2] * b[offset + 2]


@part
def dip_row(
    inverse_axes: Floats,
    extremal: Extremal,
    nodes: Floats,
    dips: Dips,
    which: int,
    row: Floats,
    weight: float,
    hessian: Floats,
) -> None:
    """Derivative (7,) of |xi| at a dip with respect to the initial costates.

    At a dip the time of it does not matter to first order. To second order it does: the Hessian without the
    path's own second derivative, times ``weight``, is added to ``hessian`` (7, 7).
    """
    k, f, bend = int(dips.places[which, STEP]), dips.places[which, FRACTION], dips.places[which, BEND]
    before, after = extremal.state[k], extremal.state[k + 1]
    a, b, c, d, ta, tb, tc, td = hermite(f)
    h = extremal.step[k]
    r, v, normal, dr, dv, rate, Q = dips.r, dips.v, dips.normal, dips.dr, dips.dv, dips.rate, dips.bend
    interpolate(h, f, before, after, r, v)
    level = level_and_gradient(inverse_axes, r, normal)
    X, Y = nodes[k], nodes[k + 1]
    for i in range(3):
        for j in range(7):
            dr[i, j] = a * X[i, j] + b * h * X[3 + i, j] + c * Y[i, j] + d * h * Y[3 + i, j]
            dv[i, j] = (ta * X[i, j] + tc * Y[i, j]) / h + tb * X[3 + i, j] + td * Y[3 + i, j]
        for j in range(3):
            Q[i, j] = 0.0
    add_level_bend(inverse_axes, level, normal, 1.0, Q)
    for j in range(7):
        row[j] = rate[j] = 0.0
        for i in range(3):
            row[j] += normal[i] * dr[i, j]
            rate[j] += normal[i] * dv[i, j]
            for q in range(3):
                rate[j] += Q[i, q] * v[q] * dr[i, j]
    for j in range(7):
        for q in range(7):
            total = -rate[j] * rate[q] / bend
            for i in range(3):
                for p in range(3):
                    total += dr[i, j] * Q[i, p] * dr[p, q]
            hessian[j, q] += weight * total
