"""A small convex quadratic program whose rows may give way at a price.

    minimise    g'd + d'Hd / 2 + sum_i price_i t_i
    subject to  c_i + a_i'd + t_i >= 0,  t_i >= 0,  |d_j| <= radius_j

A row of infinite price does not give way. Without such rows there is always a solution. A row's multiplier
lies in [0, price_i]: a row that gives way has its price.
Primal-dual interior point with Mehrotra's predictor and corrector; everything reduces to one Cholesky
factor of the order of d.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import inlined, part
from landing_cli.kernel_record import by_reference
from landing_cli.optimize.small_dense import cholesky, cholesky_solve

Floats = NDArray[np.float64]

MAX_ITERATIONS = 40
SHORTEST = 1e-6
TOLERANCE = 1e-11  # of the mean complementarity, relative to what the rows can cost
FRACTION_TO_BOUNDARY = 0.995


@by_reference
class ElasticQP(NamedTuple):
    """The data of the program; n unknowns, m rows."""

    hessian: Floats  # (n, n) positive definite
    gradient: Floats  # (n,)
    rows: Floats  # (m, n)
    values: Floats  # (m,)
    price: Floats  # (m,) positive; infinite for a row that must hold
    radius: Floats  # (n,) positive
    work: Floats  # (9, m + 2 n), and what follows: scratch space
    factor: Floats  # (n, n)
    step: Floats  # (n,)


# The iterate and its step, one line each of the work space: rows first, then the box's two sides.
SLACK, GIVE, DUAL, LEFT, WEIGHT, SHIFT, D_SLACK, D_GIVE, D_DUAL = range(9)
# GIVE is t. LEFT is the price less the multiplier, kept by itself because the difference would lose its
# digits. Rows that do not give way, the box among them, have GIVE 0 and LEFT infinite, and every formula
# below holds for them too. WEIGHT is D = 1 / (slack / dual + give / left).


def new_elastic_qp(n: int, m: int) -> ElasticQP:
    """A zeroed program with room for n unknowns and m rows."""
    return ElasticQP(
        np.zeros((n, n)),
        np.zeros(n),
        np.zeros((m, n)),
        np.zeros(m),
        np.ones(m),
        np.ones(n),
        np.zeros((9, m + 2 * n)),
        np.zeros((n, n)),
        np.zeros(n),
    )


@part
def _row_dot(qp: ElasticQP, m: int, i: int, d: Floats) -> float:
    """a_i'd, the box's sides being rows m.. with unit vectors."""
    n = d.shape[0]
    if i < m:
        total = 0.0
        for j in range(n):
            total += qp.rows[i, j] * d[j]
        return total
    return -d[i - m] if i < m + n else d[i - m - n]


@inlined
def _add_rows(qp: ElasticQP, m: int, weights: Floats, out: Floats) -> None:
    """Add A' weights to ``out``."""
    n = out.shape[0]
    for i in range(m):
        for j in range(n):
            out[j] += weights[i] * qp.rows[i, j]
    for j in range(n):
        out[j] += weights[m + n + j] - weights[m + j]


@inlined
def _factor(qp: ElasticQP, m: int) -> None:
    """Factor H + A' D A."""
    n, w, M = qp.gradient.shape[0], qp.work, qp.factor
    for i in range(m + 2 * n):
        w[WEIGHT, i] = 1.0 / (w[SLACK, i] / w[DUAL, i] + w[GIVE, i] / w[LEFT, i])
    for a in range(n):
        for b in range(a + 1):
            total = qp.hessian[a, b]
            for i in range(m):
                total += w[WEIGHT, i] * qp.rows[i, a] * qp.rows[i, b]
            M[a, b] = total
        M[a, a] += w[WEIGHT, m + a] + w[WEIGHT, m + n + a]
    cholesky(M, n)


@part
def _direction(qp: ElasticQP, m: int, d: Floats, target: float, second: bool) -> None:
    """Newton direction towards complementarity ``target``; ``second`` adds the corrector's products."""
    n, w, step = d.shape[0], qp.work, qp.step
    for i in range(m + 2 * n):
        by_slack, by_give = target / w[DUAL, i], target / w[LEFT, i]
        if second:
            by_slack -= w[D_SLACK, i] * w[D_DUAL, i] / w[DUAL, i]
            by_give += w[D_GIVE, i] * w[D_DUAL, i] / w[LEFT, i]
        value = qp.values[i] if i < m else qp.radius[(i - m) % n]
        # what the row still misses once both complementarity conditions are solved for the slacks
        w[SHIFT, i] = value + _row_dot(qp, m, i, d) + by_give - by_slack
        # kept for the back-substitution
        w[D_SLACK, i], w[D_GIVE, i] = by_slack - w[SLACK, i], by_give - w[GIVE, i]
    for a in range(n):
        total = -qp.gradient[a]
        for b in range(n):
            total -= qp.hessian[a, b] * d[b]
        step[a] = total
    # A' (dual - D shift), through d_dual as scratch
    for i in range(m + 2 * n):
        w[D_DUAL, i] = w[DUAL, i] - w[WEIGHT, i] * w[SHIFT, i]
    _add_rows(qp, m, w[D_DUAL], step)
    cholesky_solve(qp.factor, n, step)
    for i in range(m + 2 * n):
        change = -w[WEIGHT, i] * (_row_dot(qp, m, i, step) + w[SHIFT, i])
        w[D_DUAL, i] = change
        w[D_SLACK, i] -= w[SLACK, i] / w[DUAL, i] * change
        w[D_GIVE, i] += w[GIVE, i] / w[LEFT, i] * change


@part
def _longest(w: Floats, size: int) -> float:
    """Longest step that keeps slacks and multipliers inside."""
    longest = 1e30
    for i in range(size):
        if w[D_SLACK, i] < 0.0:
            longest = min(longest, -w[SLACK, i] / w[D_SLACK, i])
        if w[D_DUAL, i] < 0.0:
            longest = min(longest, -w[DUAL, i] / w[D_DUAL, i])
        if w[D_GIVE, i] < 0.0:
            longest = min(longest, -w[GIVE, i] / w[D_GIVE, i])
        if w[D_DUAL, i] > 0.0:
            longest = min(longest, w[LEFT, i] / w[D_DUAL, i])
    return longest


@part
def _gap(w: Floats, size: int, step: float) -> float:
    """Mean complementarity after a step along the current direction."""
    total, count = 0.0, 0
    for i in range(size):
        dual = w[DUAL, i] + step * w[D_DUAL, i]
        total += (w[SLACK, i] + step * w[D_SLACK, i]) * dual
        count += 1
        if w[LEFT, i] < math.inf:
            total += (w[GIVE, i] + step * w[D_GIVE, i]) * (w[LEFT, i] - step * w[D_DUAL, i])
            count += 1
    return total / count


@part
def solve_elastic_qp(qp: ElasticQP, m: int, d: Floats, multipliers: Floats) -> int:
    """Solve the program.

    Parameters
    ----------
    qp : ElasticQP
        Data; the first ``m`` rows count.
    m : int
        Number of rows.
    d : (n,) float
        Receives the solution.
    multipliers : (m,) float
        Receives the rows' multipliers, between 0 and the price.

    Returns
    -------
    int
        Iterations; ``MAX_ITERATIONS`` when the tolerance was not reached.
    """
    n = d.shape[0]
    size, w, step = m + 2 * n, qp.work, qp.step
    first, second = np.bool_(False), np.bool_(True)
    for i in range(size):
        w[GIVE, i] = w[D_SLACK, i] = w[D_GIVE, i] = w[D_DUAL, i] = 0.0
    for j in range(n):
        d[j] = 0.0
    cost = 1.0
    for i in range(m):
        w[SLACK, i] = max(qp.values[i], 0.0) + 0.1
        if qp.price[i] < math.inf:
            cost = max(cost, -qp.price[i] * qp.values[i])
            w[GIVE, i] = max(-qp.values[i], 0.0) + 0.1
        w[DUAL, i] = min(0.5 * qp.price[i], 0.5)
        w[LEFT, i] = qp.price[i] - w[DUAL, i]
    for j in range(n):
        w[SLACK, m + j] = w[SLACK, m + n + j] = qp.radius[j]
        w[DUAL, m + j] = w[DUAL, m + n + j] = 0.05 / qp.radius[j]
        w[LEFT, m + j] = w[LEFT, m + n + j] = math.inf
    mu, iterations = _gap(w, size, 0.0), 0
    while iterations < MAX_ITERATIONS:
        iterations += 1
        _factor(qp, m)
        _direction(qp, m, d, 0.0, first)
        length = min(1.0, _longest(w, size))
        ratio = _gap(w, size, length) / mu
        _direction(qp, m, d, mu * ratio**3, second)
        length = min(1.0, FRACTION_TO_BOUNDARY * _longest(w, size))
        if not length > SHORTEST:  # rounding has the last word
            break
        for j in range(n):
            d[j] += length * step[j]
        for i in range(size):
            w[SLACK, i] += length * w[D_SLACK, i]
            w[GIVE, i] += length * w[D_GIVE, i]
            w[DUAL, i] += length * w[D_DUAL, i]
            w[LEFT, i] -= length * w[D_DUAL, i]
        mu = _gap(w, size, 0.0)
        if mu < TOLERANCE * cost:
            break
    for i in range(m):
        multipliers[i] = w[DUAL, i]
    return iterations
