"""The elastic quadratic program against Clarabel, and its multipliers against the optimality conditions."""

from __future__ import annotations

import clarabel
import numpy as np
import pytest
from kernel_calls import from_python, used
from numpy.testing import assert_allclose
from scipy import sparse

from landing_cli.optimize.elastic_qp import (
    ElasticQP,
    new_elastic_qp,
    solve_elastic_qp as solve_elastic_qp_part,
)

solve_elastic_qp = from_python(solve_elastic_qp_part)

N, M = 7, 12


def random_program(seed: int) -> ElasticQP:
    rng = np.random.default_rng(seed)
    qp = new_elastic_qp(N, M)
    root = rng.normal(size=(N, N))
    qp.hessian[:] = root @ root.T * 10 ** rng.uniform(-3, 1) + 1e-6 * np.eye(N)
    qp.gradient[:] = rng.normal(size=N)
    qp.rows[:] = rng.normal(size=(M, N))
    qp.values[:] = rng.normal(size=M) - rng.choice([0, 3])
    qp.price[:] = 10 ** rng.uniform(-1, 2, size=M)
    qp.radius[:] = 10 ** rng.uniform(-2, 1)
    return qp


def by_clarabel(qp: ElasticQP) -> np.ndarray:
    """The same program with the violations as unknowns."""
    P = sparse.csc_matrix(sparse.triu(sparse.block_diag([qp.hessian, sparse.csc_matrix((M, M))])))
    one, none = np.eye(M), np.zeros((M, N))
    rows = np.vstack([np.hstack([-qp.rows, -one]), np.hstack([none, -one])])
    box = np.hstack([np.vstack([np.eye(N), -np.eye(N)]), np.zeros((2 * N, M))])
    limits = np.concatenate([qp.values, np.zeros(M), qp.radius, qp.radius])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    A = sparse.csc_matrix(np.vstack([rows, box]))
    cones = [clarabel.NonnegativeConeT(len(limits))]
    gradient = np.concatenate([qp.gradient, qp.price])
    return np.array(clarabel.DefaultSolver(P, gradient, A, limits, cones, settings).solve().x)[:N]


@pytest.mark.parametrize("seed", range(25))
def test_the_solution_is_clarabels(seed: int) -> None:
    qp = random_program(seed)
    d, multipliers = np.zeros(N), np.zeros(M)
    iterations = solve_elastic_qp(qp, M, d, multipliers)
    assert iterations <= 16
    assert_allclose(d / qp.radius, by_clarabel(qp) / qp.radius, rtol=0, atol=1e-5)


@pytest.mark.parametrize("seed", range(25))
def test_multipliers_lie_between_zero_and_the_price_and_make_the_point_stationary(seed: int) -> None:
    qp = random_program(seed)
    d, multipliers = np.zeros(N), np.zeros(M)
    solve_elastic_qp(qp, M, d, multipliers)
    slack = qp.values + qp.rows @ d
    scale = qp.price.max()
    assert np.all(multipliers >= 0.0)
    assert np.all(multipliers <= qp.price)
    assert_allclose(multipliers[slack > 1e-3], 0.0, rtol=0, atol=1e-5 * scale)
    assert_allclose(multipliers[slack < -1e-3], qp.price[slack < -1e-3], rtol=1e-4)
    inside = np.abs(d) < 0.999 * qp.radius
    residual = qp.gradient + qp.hessian @ d - qp.rows.T @ multipliers
    assert_allclose(residual[inside], 0.0, rtol=0, atol=1e-6 * scale)


def test_a_row_of_infinite_price_holds() -> None:
    qp = random_program(3)
    qp.radius[:] = 10.0
    qp.price[0] = np.inf
    qp.values[0] = -1.0
    qp.gradient[:] = 5.0 * qp.rows[0]  # everything pulls against the row
    d, multipliers = np.zeros(N), np.zeros(M)
    solve_elastic_qp(qp, M, d, multipliers)
    assert_allclose(qp.values[0] + qp.rows[0] @ d, 0.0, rtol=0, atol=1e-6)
    assert multipliers[0] > 0.0


def test_hopeless_rows_at_a_high_price_still_give_a_finite_answer() -> None:
    qp = random_program(5)
    qp.values[:] = -3.0
    qp.price[:] = 1e4
    qp.radius[:] = 1e-3
    d, multipliers = np.zeros(N), np.zeros(M)
    solve_elastic_qp(qp, M, d, multipliers)
    assert np.all(np.isfinite(d)) and np.all(np.isfinite(multipliers))
    assert_allclose(multipliers, qp.price, rtol=1e-6)
    assert_allclose(d, qp.radius * np.sign(qp.rows.T @ qp.price), rtol=1e-6)


def test_nothing_is_left_over_from_the_program_before() -> None:
    data = "hessian", "gradient", "rows", "values", "price", "radius"
    answers = []
    for qp in (random_program(3), used(random_program(3), *data)):
        d, multipliers = np.zeros(N), np.zeros(M)
        solve_elastic_qp(qp, M, d, multipliers)
        answers.append((d, multipliers))
    assert all(map(np.array_equal, *answers))
