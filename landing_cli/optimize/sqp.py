"""Trust-region SQP with an exact L1 penalty, in pieces that a caller's loop strings together.

    minimise  f(x)  subject to  c_i(x) = 0 (equality rows),  c_i(x) >= 0 (the others)

The merit function is f + price * (sum of violations), where rows of the pool count only by the worst of
them: rows that come and go along a path, such as local minima, leave the merit continuous. Each round the
caller fills a ``LocalModel``; ``propose`` solves the elastic quadratic program within the trust region, which
always has a solution, and tells how much it expects the merit to fall. Nothing expected and nothing
violated: a local optimum. Nothing expected at a high price, and still violated: a local least of the
violation. Everything else is not converged, and says nothing about feasibility.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import inlined, inner, part
from landing_cli.kernel_record import by_reference
from landing_cli.optimize.elastic_qp import ElasticQP, new_elastic_qp, solve_elastic_qp

Floats = NDArray[np.float64]

# Curvature is floored at this fraction of the largest, so that the quadratic program is strictly convex.
FLAT = 1e-8


@by_reference
class LocalModel(NamedTuple):
    """The problem at the current point; n unknowns, room for m rows."""

    gradient: Floats  # (n,) of f
    hessian: Floats  # (n, n) of the Lagrangian, or an estimate
    jacobian: Floats  # (m, n)
    values: Floats  # (m,)
    equality: NDArray[np.bool_]  # (m,)
    pooled: NDArray[np.bool_]  # (m,) no equality; their violation is that of the worst of them
    program: ElasticQP  # and what follows: scratch space
    step_and_pool: Floats  # (n + 1,)
    duals: Floats  # (2 m + 1,)
    after: Floats  # (m,)
    rotated: Floats  # (n, n)
    axes: Floats  # (n, n)


def new_local_model(n: int, m: int) -> LocalModel:
    """A zeroed model."""
    return LocalModel(
        np.zeros(n),
        np.zeros((n, n)),
        np.zeros((m, n)),
        np.zeros(m),
        np.zeros(m, dtype=np.bool_),
        np.zeros(m, dtype=np.bool_),
        new_elastic_qp(n + 1, 2 * m + 1),  # one more unknown for the pool, two rows for an equality
        np.zeros(n + 1),
        np.zeros(2 * m + 1),
        np.zeros(m),
        np.zeros((n, n)),
        np.zeros((n, n)),
    )


@part
def violation(values: Floats, equality: NDArray[np.bool_], pooled: NDArray[np.bool_], m: int) -> float:
    """Violation of the first ``m`` rows: the sum of the rows' own, and the worst of the pool."""
    total, worst = 0.0, 0.0
    for i in range(m):
        if equality[i]:
            total += abs(values[i])
        elif pooled[i]:
            worst = max(worst, -values[i])
        else:
            total += max(0.0, -values[i])
    return total + worst


@part
def convexify(model: LocalModel) -> None:
    """Turn negative curvature of the Hessian into positive curvature of the same size.

    Jacobi's rotations give the eigenvalues of the small symmetric matrix.
    """
    matrix, A, V = model.hessian, model.rotated, model.axes
    n, scale = matrix.shape[0], 0.0
    for a in range(n):
        for b in range(n):
            A[a, b], V[a, b] = matrix[a, b], 1.0 if a == b else 0.0
            scale = max(scale, abs(A[a, b]))
    for _ in range(12):
        off = 0.0
        for p in range(n):
            for q in range(p + 1, n):
                off = max(off, abs(A[p, q]))
                if abs(A[p, q]) > 1e-15 * scale:
                    _rotate(A, V, p, q)
        if off < 1e-13 * scale:
            break
    lowest = A[0, 0]
    for i in range(n):
        lowest = min(lowest, A[i, i])
    floor = FLAT * max(scale, 1e-12)
    if lowest >= floor:
        return
    for a in range(n):
        for b in range(n):
            total = 0.0
            for i in range(n):
                total += max(abs(A[i, i]), floor) * V[a, i] * V[b, i]
            matrix[a, b] = total


@inlined
def _rotate(A: Floats, V: Floats, p: int, q: int) -> None:
    """Turn the plane of axes p and q so that A[p, q] vanishes; V collects the rotations."""
    theta = 0.5 * (A[q, q] - A[p, p]) / A[p, q]
    t = 1.0 / (abs(theta) + math.sqrt(theta * theta + 1.0))
    if theta < 0.0:
        t = -t
    c = 1.0 / math.sqrt(t * t + 1.0)
    s = t * c
    for k in range(A.shape[0]):
        x, y = A[k, p], A[k, q]
        A[k, p], A[k, q] = c * x - s * y, s * x + c * y
    for k in range(A.shape[0]):
        x, y = A[p, k], A[q, k]
        A[p, k], A[q, k] = c * x - s * y, s * x + c * y
        x, y = V[k, p], V[k, q]
        V[k, p], V[k, q] = c * x - s * y, s * x + c * y


@inner
def propose(
    model: LocalModel, m: int, price: float, radius: Floats, step: Floats, multipliers: Floats
) -> float:
    """Minimise the model of the merit function in the box.

    Parameters
    ----------
    model : LocalModel
        With a positive definite Hessian (see ``convexify``).
    m : int
        Number of rows.
    price : float
        Price of violation.
    radius : (n,) float
        Half-sides of the trust region.
    step : (n,) float
        Receives the step.
    multipliers : (m or more,) float
        Receives the rows' multipliers.

    Returns
    -------
    float
        How much the model expects the merit to fall.
    """
    n = step.shape[0]
    qp, duals, step_and_pool, after = model.program, model.duals, model.step_and_pool, model.after
    for a in range(n):
        qp.gradient[a], qp.radius[a], qp.rows[0, a] = model.gradient[a], radius[a], 0.0
        for b in range(n):
            qp.hessian[a, b] = model.hessian[a, b]
    qp.hessian[n, n], qp.gradient[n] = FLAT, price
    # the pool's violation is one more unknown: at least 0, and at least what each of its rows lacks
    qp.rows[0, n], qp.values[0], qp.price[0] = 1.0, 0.0, math.inf
    rows, worst = np.int64(1), 0.0
    for i in range(m):
        for side in range(2 if model.equality[i] else 1):
            sign = 1.0 - 2.0 * side
            qp.values[rows] = sign * model.values[i]
            for j in range(n):
                qp.rows[rows, j] = sign * model.jacobian[i, j]
            qp.rows[rows, n] = 1.0 if model.pooled[i] else 0.0
            qp.price[rows] = math.inf if model.pooled[i] else price
            rows += 1
        if model.pooled[i]:
            worst = max(worst, -model.values[i])
    qp.radius[n] = 1.0 + 2.0 * worst
    solve_elastic_qp(qp, rows, step_and_pool, duals)
    for a in range(n):
        step[a] = step_and_pool[a]
    row = 1
    for i in range(m):
        after[i] = model.values[i]
        for j in range(n):
            after[i] += model.jacobian[i, j] * step[j]
        multipliers[i] = duals[row] - (duals[row + 1] if model.equality[i] else 0.0)
        row += 2 if model.equality[i] else 1
    expected = violation(model.values, model.equality, model.pooled, m)
    expected = price * (expected - violation(after, model.equality, model.pooled, m))
    for a in range(n):
        expected -= model.gradient[a] * step[a]
        for b in range(n):
            expected -= 0.5 * step[a] * model.hessian[a, b] * step[b]
    return expected


@part
def add_secant(change: Floats, step: Floats, estimate: Floats) -> None:
    """Symmetric rank-one update, so that ``estimate`` maps ``step`` to ``change``, which is overwritten."""
    n, miss = step.shape[0], change
    along, miss2, step2 = 0.0, 0.0, 0.0
    for a in range(n):
        for b in range(n):
            miss[a] -= estimate[a, b] * step[b]
        along += miss[a] * step[a]
        miss2 += miss[a] * miss[a]
        step2 += step[a] * step[a]
    if along * along > 1e-12 * miss2 * step2:
        for a in range(n):
            for b in range(n):
                estimate[a, b] += miss[a] * miss[b] / along
