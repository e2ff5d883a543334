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
from numba import njit
from numpy.typing import NDArray

from landing_cli.optimize.small_dense import cholesky, cholesky_solve

Floats = NDArray[np.float64]

MAX_ITERATIONS = 40
TOLERANCE = 1e-11  # of the mean complementarity
FRACTION_TO_BOUNDARY = 0.995


class ElasticQP(NamedTuple):
    """The data of the program; n unknowns, m rows."""

    hessian: Floats  # (n, n) positive definite
    gradient: Floats  # (n,)
    rows: Floats  # (m, n)
    values: Floats  # (m,)
    price: Floats  # (m,) positive; infinite for a row that must hold
    radius: Floats  # (n,) positive


class _Work(NamedTuple):
    """The iterate and its steps: rows first, then the two sides of the box, (m + 2 n,) each."""

    slack: Floats
    give: Floats  # t; zero for rows that do not give way, the box among them
    dual: Floats
    weight: Floats  # D = 1 / (slack / dual + give / (price - dual))
    shift: Floats
    d_slack: Floats
    d_give: Floats
    d_dual: Floats
    matrix: Floats  # (n, n)
    step: Floats  # (n,)


@njit(cache=True, nogil=True, error_model="numpy")
def new_elastic_qp(n: int, m: int) -> ElasticQP:
    """A zeroed program with room for n unknowns and m rows."""
    return ElasticQP(np.zeros((n, n)), np.zeros(n), np.zeros((m, n)), np.zeros(m), np.ones(m), np.ones(n))


@njit(cache=True, nogil=True, error_model="numpy")
def _gives(qp: ElasticQP, m: int, i: int) -> bool:
    """Whether a row may give way."""
    return i < m and qp.price[i] < math.inf


@njit(cache=True, nogil=True, error_model="numpy")
def _row_dot(qp: ElasticQP, m: int, i: int, d: Floats) -> float:
    """a_i'd, the box's sides being rows m.. with unit vectors."""
    n = d.shape[0]
    if i < m:
        total = 0.0
        for j in range(n):
            total += qp.rows[i, j] * d[j]
        return total
    return -d[i - m] if i < m + n else d[i - m - n]


@njit(cache=True, nogil=True, error_model="numpy")
def _add_rows(qp: ElasticQP, m: int, weights: Floats, out: Floats) -> None:
    """Add A' weights to ``out``."""
    n = out.shape[0]
    for i in range(m):
        for j in range(n):
            out[j] += weights[i] * qp.rows[i, j]
    for j in range(n):
        out[j] += weights[m + n + j] - weights[m + j]


@njit(cache=True, nogil=True, error_model="numpy")
def _factor(qp: ElasticQP, m: int, work: _Work) -> None:
    """Factor H + A' D A."""
    n = qp.gradient.shape[0]
    M, D = work.matrix, work.weight
    for i in range(m + 2 * n):
        soft = work.give[i] / (qp.price[i] - work.dual[i]) if _gives(qp, m, i) else 0.0
        D[i] = 1.0 / (work.slack[i] / work.dual[i] + soft)
    for a in range(n):
        for b in range(a + 1):
            total = qp.hessian[a, b]
            for i in range(m):
                total += D[i] * qp.rows[i, a] * qp.rows[i, b]
            M[a, b] = total
        M[a, a] += D[m + a] + D[m + n + a]
    cholesky(M, n)


@njit(cache=True, nogil=True, error_model="numpy")
def _direction(qp: ElasticQP, m: int, d: Floats, target: float, second: bool, work: _Work) -> None:
    """Newton direction towards complementarity ``target``; ``second`` adds the corrector's products."""
    n = d.shape[0]
    w = work
    for i in range(m + 2 * n):
        by_slack, by_give, give = target / w.dual[i], 0.0, 0.0
        if second:
            by_slack -= w.d_slack[i] * w.d_dual[i] / w.dual[i]
        if _gives(qp, m, i):
            left = qp.price[i] - w.dual[i]
            by_give, give = target / left, w.give[i]
            if second:
                by_give += w.d_give[i] * w.d_dual[i] / left
        value = qp.values[i] if i < m else qp.radius[(i - m) % n]
        residual = value + _row_dot(qp, m, i, d) + give - w.slack[i]
        # what the row still misses once both complementarity conditions are solved for the slacks
        w.shift[i] = residual + by_give - give - by_slack + w.slack[i]
        # kept for the back-substitution
        w.d_slack[i], w.d_give[i] = by_slack - w.slack[i], by_give - give
    for a in range(n):
        total = -qp.gradient[a]
        for b in range(n):
            total -= qp.hessian[a, b] * d[b]
        w.step[a] = total
    # A' (dual - D shift), through d_dual as scratch
    for i in range(m + 2 * n):
        w.d_dual[i] = w.dual[i] - w.weight[i] * w.shift[i]
    _add_rows(qp, m, w.d_dual, w.step)
    cholesky_solve(w.matrix, n, w.step)
    for i in range(m + 2 * n):
        change = -w.weight[i] * (_row_dot(qp, m, i, w.step) + w.shift[i])
        w.d_dual[i] = change
        w.d_slack[i] -= w.slack[i] / w.dual[i] * change
        if _gives(qp, m, i):
            w.d_give[i] += w.give[i] / (qp.price[i] - w.dual[i]) * change


@njit(cache=True, nogil=True, error_model="numpy")
def _longest(qp: ElasticQP, m: int, n: int, work: _Work) -> float:
    """Longest step that keeps slacks and multipliers inside."""
    longest = 1e30
    w = work
    for i in range(m + 2 * n):
        if w.d_slack[i] < 0.0:
            longest = min(longest, -w.slack[i] / w.d_slack[i])
        if w.d_dual[i] < 0.0:
            longest = min(longest, -w.dual[i] / w.d_dual[i])
        if _gives(qp, m, i):
            if w.d_give[i] < 0.0:
                longest = min(longest, -w.give[i] / w.d_give[i])
            if w.d_dual[i] > 0.0:
                longest = min(longest, (qp.price[i] - w.dual[i]) / w.d_dual[i])
    return longest


@njit(cache=True, nogil=True, error_model="numpy")
def _gap(qp: ElasticQP, m: int, n: int, work: _Work, step: float) -> float:
    """Mean complementarity after a step along the current direction."""
    total, count = 0.0, 0
    w = work
    for i in range(m + 2 * n):
        dual = w.dual[i] + step * w.d_dual[i]
        total += (w.slack[i] + step * w.d_slack[i]) * dual
        count += 1
        if _gives(qp, m, i):
            total += (w.give[i] + step * w.d_give[i]) * (qp.price[i] - dual)
            count += 1
    return total / count


@njit(cache=True, nogil=True, error_model="numpy")
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
    size = m + 2 * n
    w = _Work(
        np.ones(size),
        np.zeros(size),
        np.ones(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros(size),
        np.zeros((n, n)),
        np.zeros(n),
    )
    d[:] = 0.0
    for i in range(m):
        w.slack[i] = max(qp.values[i], 0.0) + 0.1
        if _gives(qp, m, i):
            w.give[i] = max(-qp.values[i], 0.0) + 0.1
        w.dual[i] = min(0.5 * qp.price[i], 0.5)
    for j in range(n):
        w.slack[m + j] = w.slack[m + n + j] = qp.radius[j]
        w.dual[m + j] = w.dual[m + n + j] = 0.05 / qp.radius[j]
    mu, iteration = _gap(qp, m, n, w, 0.0), 0
    for iteration in range(MAX_ITERATIONS):
        _factor(qp, m, w)
        _direction(qp, m, d, 0.0, False, w)
        step = min(1.0, _longest(qp, m, n, w))
        ratio = _gap(qp, m, n, w, step) / mu
        _direction(qp, m, d, mu * ratio**3, True, w)
        step = min(1.0, FRACTION_TO_BOUNDARY * _longest(qp, m, n, w))
        for j in range(n):
            d[j] += step * w.step[j]
        for i in range(size):
            w.slack[i] += step * w.d_slack[i]
            w.give[i] += step * w.d_give[i]
            w.dual[i] += step * w.d_dual[i]
            w.d_slack[i] = w.d_give[i] = w.d_dual[i] = 0.0
        mu = _gap(qp, m, n, w, 0.0)
        if mu < TOLERANCE and step > 0.9:
            break
    for i in range(m):
        multipliers[i] = w.dual[i]
    return iteration + 1
