"""Interior-point steps for a descent with a bounded, piecewise-constant thrust.

The problem, linearised at the current point by the caller at every iteration (see ``Model``):

    minimise    f(F, y)
    subject to  c(F, y)  = 0                     n_equal rows
                c(F, y) >= 0                     the other rows, with slacks
                (y0, F_k) in Q                   thrust bound at node k = 0..N-1
                A_j y + b_j = s_j in Q           further cones on y alone, with their own slacks

F_k in R^3 is the thrust of interval k, y in R^7 the thrust level y0 = tau followed by the two ends
of the final stage's acceleration, and Q the second-order cone of R^4. Mehrotra's
predictor-corrector with Nesterov-Todd scaling: each node is eliminated by itself
(H_k = a I + 2/beta^2 w1 w1' inverts by Sherman-Morrison), which leaves one dense system in the
row multipliers and one of order 7 in y. Signs follow the Lagrangian

    L = f + lambda' c - sum_k z_k' (y0, F_k) - sum_j z_j' (A_j y + b_j) - lambda_in' s,

so that an inequality row has lambda = -eta with eta >= 0 complementary to its slack s.

Rows answer to the thrust by mixes of a few functionals up to a node each (a tangent plane at a node asks for
the position there, which the state at the end tells of with the intervals up to the node). So nodes meet the
few functionals only, in sums over the intervals, however many rows there are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import inlined, part
from landing_cli.kernel_lanes import add_at_rows, at_rows, choose
from landing_cli.optimize.conic_records import STATE, Y_SIZE, Model, Point, Step
from landing_cli.optimize.second_order_cone import (
    UNBOUNDED,
    apply_inverse_scaling_squared,
    complementarity_shift,
    longest_step,
    scaling_point,
)
from landing_cli.optimize.small_dense import cholesky, cholesky_solve, solve_lower, solve_upper

Floats = NDArray[np.float64]

FRACTION_TO_BOUNDARY = 0.98
# An equality in y alone has no Schur complement of its own; this bends it by a vanishing amount.
ROW_REGULARISATION = 1e-9


@part
def _sum_reaching(model: Model, weight: Floats, n_rows: int) -> None:
    """Fill ``model.sums``: row k + 1 holds the mixes of the rows that reach interval k, by their weights."""
    sums, mix, end = model.sums, model.row_mix, model.row_end
    n, basis = sums.shape[0] - 1, sums.shape[1]
    for k in range(n + 1):
        for b in range(basis):
            sums[k, b] = 0.0
    for r in range(STATE):
        sums[n, r] = weight[r]
    for r in range(STATE, n_rows):
        for b in range(basis):
            add_at_rows(sums, end[r], b, weight[r] * mix[r, b])
    for k in range(n - 1, 0, -1):
        for b in range(basis):
            sums[k, b] += sums[k + 1, b]


@part
def fill_row_pull(point: Point, model: Model, n_rows: int) -> None:
    """Fill ``model.row_pull`` from the rows and their multipliers."""
    basis, sums, pull = model.basis, model.sums, model.row_pull
    _sum_reaching(model, point.multiplier, n_rows)
    for k in range(basis.shape[0]):
        p0 = p1 = p2 = 0.0
        for b in range(basis.shape[1]):
            p0 += sums[k + 1, b] * basis[k, b, 0]
            p1 += sums[k + 1, b] * basis[k, b, 1]
            p2 += sums[k + 1, b] * basis[k, b, 2]
        pull[k, 0], pull[k, 1], pull[k, 2] = p0, p1, p2


@inlined
def residuals(
    point: Point, model: Model, step: Step, n_equal: int, n_rows: int, n_cones: int, tau_free: bool
) -> tuple[float, float, float]:
    """Fill the residuals of the optimality conditions.

    Returns
    -------
    primal : float
        Largest residual of rows and cones.
    dual : float
        Largest stationarity residual, per unit of time at the nodes.
    gap : float
        Sum of the complementarity products.
    """
    n_nodes = point.thrust.shape[0]
    tau = point.y[0]
    gap = primal = 0.0
    for a in range(Y_SIZE):
        total = model.y_gradient[a]
        for i in range(n_rows):
            total += model.row_y[i, a] * point.multiplier[i]
        step.y_residual[a] = total
    for j in range(n_cones):
        for i in range(4):
            total = model.cone_offset[j, i]
            for a in range(Y_SIZE):
                total += model.cone_map[j, i, a] * point.y[a]
                step.y_residual[a] -= model.cone_map[j, i, a] * point.cone_dual[j, i]
            step.cone_residual[j, i] = total - point.cone_slack[j, i]
            primal = max(primal, abs(step.cone_residual[j, i]))
            gap += point.cone_slack[j, i] * point.cone_dual[j, i]
    dual = 0.0
    for k in range(n_nodes):
        for i in range(3):
            residual = model.thrust_gradient[k, i] + model.row_pull[k, i] - point.node_dual[k, 1 + i]
            step.node_residual[k, i] = residual
            dual = max(dual, abs(residual) * n_nodes)
            gap += point.thrust[k, i] * point.node_dual[k, 1 + i]
        gap += tau * point.node_dual[k, 0]
        step.y_residual[0] -= point.node_dual[k, 0]
    if not tau_free:
        step.y_residual[0] = 0.0
    for a in range(Y_SIZE):
        dual = max(dual, abs(step.y_residual[a]))
    for r in range(n_rows):
        step.row_residual[r] = model.row_value[r]
        if r >= n_equal:
            step.row_residual[r] -= point.slack[r]
            gap -= point.slack[r] * point.multiplier[r]
        primal = max(primal, abs(step.row_residual[r]))
    return primal, dual, gap


@part
def _scale_cones(point: Point, model: Model, step: Step, n_cones: int) -> None:
    """Scale the cones on y and start the order-7 system with their Hessians."""
    reduced = step.reduced
    for a in range(Y_SIZE):
        for b in range(Y_SIZE):
            reduced[a, b] = model.y_hessian[a, b]
    for j in range(n_cones):
        s, z, w = point.cone_slack[j], point.cone_dual[j], step.cone_scaling[j]
        w[0], w[1], w[2], w[3], w[4] = scaling_point(s[0], s[1], s[2], s[3], z[0], z[1], z[2], z[3])
        for b in range(Y_SIZE):
            A = model.cone_map[j]
            g0, g1, g2, g3 = apply_inverse_scaling_squared(
                w[0], w[1], w[2], w[3], w[4], A[0, b], A[1, b], A[2, b], A[3, b]
            )
            for a in range(b, Y_SIZE):
                reduced[a, b] += A[0, a] * g0 + A[1, a] * g1 + A[2, a] * g2 + A[3, a] * g3


@part
def _eliminate_nodes(point: Point, model: Model, step: Step) -> None:
    """Scale every node's cone and sum up what the basis makes of its inverse Hessian."""
    products, basis = step.products, model.basis
    size = basis.shape[1]
    first = size * (size + 1) // 2
    tau = point.y[0]
    for e in range(products.shape[1]):
        products[0, e] = 0.0
    for k in range(point.thrust.shape[0]):
        F, z = point.thrust[k], point.node_dual[k]
        w0, w1, w2, w3, ib = scaling_point(tau, F[0], F[1], F[2], z[0], z[1], z[2], z[3])
        w = step.node_scaling[k]
        w[0], w[1], w[2], w[3], w[4] = w0, w1, w2, w3, ib
        # w0^2 - |w1|^2 = 1 is used throughout: differences of squares would cancel near a small gap
        stretch = w0 * w0 + w1 * w1 + w2 * w2 + w3 * w3
        curvature = model.thrust_curvature[k]
        inverse, stiff = 1.0 / (curvature + ib), 1.0 / (curvature + ib * stretch)
        f = 2.0 * ib * stiff
        # column of tau in the node's block: h = -2 w0 w1 / beta^2, and H^-1 h = g w1
        h = -2.0 * ib * w0
        g = h * stiff
        step.node_inverse[k, 0], step.node_inverse[k, 1], step.node_inverse[k, 2] = inverse, f, h
        step.reduced[0, 0] += ib * (curvature * stretch + ib) * stiff
        before, after, S, e = products[k], products[k + 1], basis[k], 0
        for i in range(size):
            a0, a1, a2 = S[i, 0], S[i, 1], S[i, 2]
            along = w1 * a0 + w2 * a1 + w3 * a2
            after[first + i] = before[first + i] - g * along
            t = f * along
            b0, b1, b2 = inverse * (a0 - t * w1), inverse * (a1 - t * w2), inverse * (a2 - t * w3)
            for j in range(i + 1):
                after[e] = before[e] + (b0 * S[j, 0] + b1 * S[j, 1] + b2 * S[j, 2])
                e += 1


@part
def _join_rows(model: Model, step: Step, n_rows: int) -> None:
    """Fill the rows' Schur complement and coupling to tau from the sums over the intervals."""
    products, mix, mixed, end = step.products, model.row_mix, step.mixed, model.row_end
    size, schur = mix.shape[1], step.schur
    first, whole = size * (size + 1) // 2, products[products.shape[0] - 1]
    e = 0
    for r in range(STATE):
        step.coupling[r, 0] = model.row_y[r, 0] + whole[first + r]
        for q in range(r + 1):
            schur[r, q] = whole[e]
            e += 1
    for r in range(STATE, n_rows):
        tau, e = model.row_y[r, 0], 0
        for i in range(size):
            mixed[r, i] = 0.0
        for i in range(size):
            tau += mix[r, i] * at_rows(products, end[r], first + i)
            for j in range(i):
                product = at_rows(products, end[r], e)
                mixed[r, i] += product * mix[r, j]
                mixed[r, j] += product * mix[r, i]
                e += 1
            mixed[r, i] += at_rows(products, end[r], e) * mix[r, i]
            e += 1
        step.coupling[r, 0] = tau
        for q in range(STATE):
            schur[r, q] = mixed[r, q]
        for q in range(STATE, r + 1):
            by_r = by_q = 0.0
            for i in range(size):
                by_r += mixed[r, i] * mix[q, i]
                by_q += mixed[q, i] * mix[r, i]
            schur[r, q] = choose(end[r] <= end[q], by_r, by_q)


@inlined
def factorise(
    point: Point, model: Model, step: Step, n_equal: int, n_rows: int, n_cones: int, tau_free: bool
) -> None:
    """Scale all cones, eliminate the nodes, and factor the two dense systems."""
    schur, coupling, solved = step.schur, step.coupling, step.solved_coupling
    _scale_cones(point, model, step, n_cones)
    for i in range(n_rows):
        for a in range(1, Y_SIZE):
            coupling[i, a] = model.row_y[i, a]
    _eliminate_nodes(point, model, step)
    _join_rows(model, step, n_rows)
    for r in range(n_rows):
        if r >= n_equal:
            # a row that is not there has a complement of 1, to itself alone
            schur[r, r] += 1.0 - model.row_live[r] - point.slack[r] / point.multiplier[r]
        else:
            schur[r, r] += choose(model.row_end[r] > 0.0, 0.0, ROW_REGULARISATION)
    if not tau_free:
        for a in range(1, Y_SIZE):
            step.reduced[a, 0] = 0.0
        step.reduced[0, 0] = 1.0
        for i in range(n_rows):
            coupling[i, 0] = 0.0
    cholesky(schur, n_rows)
    for i in range(n_rows):
        inverse = 1.0 / schur[i, i]
        for a in range(Y_SIZE):
            total = coupling[i, a]
            for k in range(i):
                total -= schur[i, k] * solved[k, a]
            solved[i, a] = total * inverse
    for a in range(Y_SIZE):
        for b in range(a + 1):
            total = step.reduced[a, b]
            for i in range(n_rows):
                total += solved[i, a] * solved[i, b]
            step.reduced[a, b] = total
    cholesky(step.reduced, step.d_y.shape[0])


@part
def _right_hand_side(
    point: Point,
    model: Model,
    step: Step,
    n_equal: int,
    n_rows: int,
    n_cones: int,
    target: float,
    corrector: bool,
    tau_free: bool,
) -> None:
    """Fill the right-hand sides; d_thrust holds H^-1 q of each node on return.

    The predictor has target 0 and no second-order term, so that its shift is -z.
    """
    for a in range(Y_SIZE):
        step.rhs_y[a] = -step.y_residual[a]
    for i in range(n_rows):
        step.rhs_rows[i] = -step.row_residual[i]
    for j in range(n_cones):
        w, o, A = step.cone_scaling[j], step.cone_shift[j], model.cone_map[j]
        z = point.cone_dual[j]
        if corrector:
            o[0], o[1], o[2], o[3] = complementarity_shift(
                w, w[4], z, step.d_cone_slack[j], step.d_cone_dual[j], target
            )
        else:
            o[0], o[1], o[2], o[3] = -z[0], -z[1], -z[2], -z[3]
        e = step.cone_residual[j]
        g0, g1, g2, g3 = apply_inverse_scaling_squared(w[0], w[1], w[2], w[3], w[4], e[0], e[1], e[2], e[3])
        g0, g1, g2, g3 = o[0] - g0, o[1] - g1, o[2] - g2, o[3] - g3
        for a in range(Y_SIZE):
            step.rhs_y[a] += A[0, a] * g0 + A[1, a] * g1 + A[2, a] * g2 + A[3, a] * g3
    for r in range(n_equal, n_rows):
        eta = -point.multiplier[r]
        product = target * model.row_live[r] - point.slack[r] * eta
        if corrector:
            product += step.d_slack[r] * step.d_multiplier[r]
        step.row_shift[r] = product / eta
        step.rhs_rows[r] += step.row_shift[r]
    d_tau, basis, sums = step.d_y[0], model.basis, model.sums
    for b in range(basis.shape[1]):
        sums[0, b] = 0.0
    for k in range(point.thrust.shape[0]):
        w, o, d = step.node_scaling[k], step.node_shift[k], step.d_thrust[k]
        z = point.node_dual[k]
        if corrector:
            ball = step.d_ball
            ball[0], ball[1], ball[2], ball[3] = d_tau, d[0], d[1], d[2]
            o[0], o[1], o[2], o[3] = complementarity_shift(w, w[4], z, ball, step.d_node_dual[k], target)
        else:
            o[0], o[1], o[2], o[3] = -z[0], -z[1], -z[2], -z[3]
        inverse, f, h = step.node_inverse[k, 0], step.node_inverse[k, 1], step.node_inverse[k, 2]
        q0 = o[1] - step.node_residual[k, 0]
        q1 = o[2] - step.node_residual[k, 1]
        q2 = o[3] - step.node_residual[k, 2]
        t = f * (w[1] * q0 + w[2] * q1 + w[3] * q2)
        d[0], d[1], d[2] = inverse * (q0 - t * w[1]), inverse * (q1 - t * w[2]), inverse * (q2 - t * w[3])
        step.rhs_y[0] += o[0] - h * (w[1] * d[0] + w[2] * d[1] + w[3] * d[2])
        for b in range(basis.shape[1]):
            sums[k + 1, b] = sums[k, b] + (
                basis[k, b, 0] * d[0] + basis[k, b, 1] * d[1] + basis[k, b, 2] * d[2]
            )
    for r in range(STATE):
        step.rhs_rows[r] -= sums[sums.shape[0] - 1, r]
    for r in range(STATE, n_rows):
        total = 0.0
        for b in range(basis.shape[1]):
            total += model.row_mix[r, b] * at_rows(sums, model.row_end[r], b)
        step.rhs_rows[r] -= total
    if not tau_free:
        step.rhs_y[0] = 0.0


@part
def _solve_dense(step: Step, n_rows: int) -> None:
    """Solve B dy - M dlambda = rhs_rows and H dy + B' dlambda = rhs_y."""
    solved = step.solved_coupling
    solve_lower(step.schur, n_rows, step.rhs_rows)
    for a in range(Y_SIZE):
        total = step.rhs_y[a]
        for i in range(n_rows):
            total += solved[i, a] * step.rhs_rows[i]
        step.d_y[a] = total
    cholesky_solve(step.reduced, step.d_y.shape[0], step.d_y)
    for i in range(n_rows):
        total = -step.rhs_rows[i]
        for a in range(Y_SIZE):
            total += solved[i, a] * step.d_y[a]
        step.d_multiplier[i] = total
    solve_upper(step.schur, n_rows, step.d_multiplier)


@part
def _recover_cones(point: Point, model: Model, step: Step, n_equal: int, n_rows: int, n_cones: int) -> float:
    """Directions of the cones on y and of the inequality rows; the longest step they allow."""
    longest = UNBOUNDED
    for j in range(n_cones):
        w, o, A = step.cone_scaling[j], step.cone_shift[j], model.cone_map[j]
        ds, dz = step.d_cone_slack[j], step.d_cone_dual[j]
        for i in range(4):
            total = step.cone_residual[j, i]
            for a in range(Y_SIZE):
                total += A[i, a] * step.d_y[a]
            ds[i] = total
        g0, g1, g2, g3 = apply_inverse_scaling_squared(
            w[0], w[1], w[2], w[3], w[4], ds[0], ds[1], ds[2], ds[3]
        )
        dz[0], dz[1], dz[2], dz[3] = o[0] - g0, o[1] - g1, o[2] - g2, o[3] - g3
        s, z = point.cone_slack[j], point.cone_dual[j]
        longest = min(longest, longest_step(s[0], s[1], s[2], s[3], ds[0], ds[1], ds[2], ds[3]))
        longest = min(longest, longest_step(z[0], z[1], z[2], z[3], dz[0], dz[1], dz[2], dz[3]))
    for r in range(n_equal, n_rows):
        s, eta, d_eta = point.slack[r], -point.multiplier[r], -step.d_multiplier[r]
        step.d_slack[r] = step.row_shift[r] - s / eta * d_eta
        longest = min(longest, choose(d_eta < 0.0, -eta / d_eta, UNBOUNDED))
        longest = min(longest, choose(step.d_slack[r] < 0.0, -s / step.d_slack[r], UNBOUNDED))
    return longest


@part
def _recover_nodes(point: Point, model: Model, step: Step, n_rows: int) -> float:
    """Directions of the thrust nodes and their duals; the longest step they allow."""
    longest = UNBOUNDED
    tau, d_tau, basis, sums = point.y[0], step.d_y[0], model.basis, model.sums
    _sum_reaching(model, step.d_multiplier, n_rows)
    for k in range(point.thrust.shape[0]):
        w, o, d, dz = step.node_scaling[k], step.node_shift[k], step.d_thrust[k], step.d_node_dual[k]
        inverse, f, h = step.node_inverse[k, 0], step.node_inverse[k, 1], step.node_inverse[k, 2]
        v0, v1, v2 = h * d_tau * w[1], h * d_tau * w[2], h * d_tau * w[3]
        for b in range(basis.shape[1]):
            v0 += sums[k + 1, b] * basis[k, b, 0]
            v1 += sums[k + 1, b] * basis[k, b, 1]
            v2 += sums[k + 1, b] * basis[k, b, 2]
        t = f * (w[1] * v0 + w[2] * v1 + w[3] * v2)
        d[0] -= inverse * (v0 - t * w[1])
        d[1] -= inverse * (v1 - t * w[2])
        d[2] -= inverse * (v2 - t * w[3])
        g0, g1, g2, g3 = apply_inverse_scaling_squared(w[0], w[1], w[2], w[3], w[4], d_tau, d[0], d[1], d[2])
        dz[0], dz[1], dz[2], dz[3] = o[0] - g0, o[1] - g1, o[2] - g2, o[3] - g3
        F, z = point.thrust[k], point.node_dual[k]
        longest = min(longest, longest_step(tau, F[0], F[1], F[2], d_tau, d[0], d[1], d[2]))
        longest = min(longest, longest_step(z[0], z[1], z[2], z[3], dz[0], dz[1], dz[2], dz[3]))
    return longest


@inlined
def advance(
    point: Point,
    model: Model,
    step: Step,
    n_equal: int,
    n_rows: int,
    n_cones: int,
    gap: float,
    smallest_target: float,
    tau_free: bool,
) -> float:
    """One predictor-corrector step, in place, from the residuals of :func:`residuals`.

    Returns
    -------
    length : float
        Step length taken.
    """
    degree = 1.0 * (point.thrust.shape[0] + n_cones)
    for r in range(n_equal, n_rows):
        degree += model.row_live[r]
    factorise(point, model, step, n_equal, n_rows, n_cones, tau_free)
    target = longest = choose(gap > 0.0, 0.0, 0.0)
    for corrected in (False, True):
        _right_hand_side(point, model, step, n_equal, n_rows, n_cones, target, corrected, tau_free)
        _solve_dense(step, n_rows)
        longest = min(
            _recover_cones(point, model, step, n_equal, n_rows, n_cones),
            _recover_nodes(point, model, step, n_rows),
        )
        if not corrected:
            short = 1.0 - min(1.0, longest)
            target = max(short * short * short * gap / degree, smallest_target)
    length = min(1.0, FRACTION_TO_BOUNDARY * longest)
    for a in range(Y_SIZE):
        point.y[a] += length * step.d_y[a]
    for j in range(n_cones):
        for i in range(4):
            point.cone_slack[j, i] += length * step.d_cone_slack[j, i]
            point.cone_dual[j, i] += length * step.d_cone_dual[j, i]
    for r in range(n_rows):
        point.multiplier[r] += length * step.d_multiplier[r]
        if r >= n_equal:
            point.slack[r] += length * step.d_slack[r]
    for k in range(point.thrust.shape[0]):
        for i in range(3):
            point.thrust[k, i] += length * step.d_thrust[k, i]
        for i in range(4):
            point.node_dual[k, i] += length * step.d_node_dual[k, i]
    return length
