"""The pieces of the SQP, and a loop of them on problems with known answers."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import from_python, used
from numpy.testing import assert_allclose

from landing_cli.optimize.sqp import (
    LocalModel,
    add_secant as add_secant_part,
    convexify as convexify_part,
    new_local_model,
    propose as propose_part,
    violation as violation_part,
)

violation = from_python(violation_part)

add_secant = from_python(add_secant_part)
convexify = from_python(convexify_part)
propose = from_python(propose_part)


def test_violation_counts_equalities_by_size_and_the_pool_by_its_worst() -> None:
    values = np.array([-0.5, 0.5, -0.3, -2.0, -1.0, 4.0])
    equality = np.array([True, True, False, False, False, False])
    pooled = np.array([False, False, False, True, True, True])
    assert violation(values, equality, pooled, 6) == pytest.approx(0.5 + 0.5 + 0.3 + 2.0)
    assert violation(values, equality, pooled, 3) == pytest.approx(1.3)


def test_convexify_keeps_eigenvectors_and_sizes_and_turns_signs() -> None:
    rng = np.random.default_rng(1)
    vectors = np.linalg.qr(rng.normal(size=(7, 7)))[0]
    eigenvalues = np.array([-3.0, -1e-3, 0.2, 1.0, 5.0, 40.0, 0.0])
    matrix = (vectors * eigenvalues) @ vectors.T
    model = new_local_model(7, 0)
    model.hessian[:] = matrix
    convexify(model)
    expected = np.maximum(np.abs(eigenvalues), 1e-8 * 40.0)
    found = (vectors.T @ model.hessian @ vectors).diagonal()
    assert_allclose(found[:6], expected[:6], rtol=1e-9)
    assert np.linalg.eigvalsh(model.hessian)[0] > 0.0


def test_convexify_leaves_a_positive_matrix_alone() -> None:
    root = np.random.default_rng(2).normal(size=(7, 7))
    matrix = root @ root.T + np.eye(7)
    model = new_local_model(7, 0)
    model.hessian[:] = matrix
    convexify(model)
    assert np.array_equal(model.hessian, matrix)


def test_the_secant_update_is_exact_along_its_step_and_recovers_a_constant_matrix() -> None:
    rng = np.random.default_rng(3)
    truth = rng.normal(size=(5, 5))
    truth += truth.T
    estimate = np.zeros((5, 5))
    for _ in range(5):
        step = rng.normal(size=5)
        add_secant(truth @ step, step, estimate)
        assert_allclose(estimate @ step, truth @ step, rtol=1e-10)
    assert_allclose(estimate, truth, rtol=0, atol=1e-8)


def sphere_model(x: np.ndarray, multipliers: np.ndarray, model: LocalModel) -> float:
    """Minimise -x0 x1 x2 on the sphere |x|^2 = 3, with x0 >= 1.2: the best is (1.2, a, a)."""
    model.gradient[:] = [-x[1] * x[2], -x[0] * x[2], -x[0] * x[1]]
    model.hessian[:] = [[0, -x[2], -x[1]], [-x[2], 0, -x[0]], [-x[1], -x[0], 0]]
    model.values[:] = [x @ x - 3.0, x[0] - 1.2]
    model.jacobian[:] = [2.0 * x, [1.0, 0.0, 0.0]]
    model.hessian[:] -= multipliers[0] * 2.0 * np.eye(3)
    model.equality[:] = [True, False]
    return float(-x.prod())


def test_a_loop_of_proposals_finds_the_constrained_optimum() -> None:
    model = new_local_model(3, 2)
    x, multipliers, step = np.array([1.5, 0.4, 0.9]), np.zeros(2), np.zeros(3)
    for _ in range(12):
        sphere_model(x, multipliers, model)
        convexify(model)
        expected = propose(model, 2, 10.0, np.full(3, 0.3), step, multipliers)
        assert expected > -1e-9
        x += step
    a = np.sqrt((3.0 - 1.44) / 2.0)
    assert_allclose(x, [1.2, a, a], rtol=0, atol=1e-7)
    assert expected < 1e-9
    assert_allclose(model.gradient, model.jacobian.T @ multipliers, rtol=0, atol=1e-6)


def test_rows_that_contradict_each_other_leave_nothing_to_expect_and_a_violation() -> None:
    """x >= 1 and -x >= 0: at the price, every point between is equally bad."""
    model = new_local_model(1, 2)
    model.hessian[0, 0] = 1.0
    model.gradient[0] = 0.5
    model.values[:] = [-0.5, -0.5]
    model.jacobian[:] = [[1.0], [-1.0]]
    step, multipliers = np.zeros(1), np.zeros(2)
    expected = propose(model, 2, 1e4, np.full(1, 1e-6), step, multipliers)
    assert expected < 1e-5
    assert violation(model.values, model.equality, model.pooled, 2) == pytest.approx(1.0)


def test_a_deep_pool_counts_by_its_worst_row_however_deep() -> None:
    model = new_local_model(1, 3)
    model.hessian[0, 0] = 1.0
    model.values[:] = [-50.0, -20.0, 1.0]
    model.jacobian[:, 0] = [1.0, -1.0, 0.0]
    model.pooled[:] = True
    step, multipliers = np.zeros(1), np.zeros(3)
    expected = propose(model, 3, 10.0, np.full(1, 2.0), step, multipliers)
    assert_allclose(step, 2.0, rtol=1e-6)
    assert_allclose(expected, 10.0 * 2.0 - 0.5 * 4.0, rtol=1e-6)
    assert_allclose(multipliers, [10.0, 0.0, 0.0], rtol=0, atol=1e-4)


def test_a_model_that_was_used_before_proposes_as_a_new_one() -> None:
    data = "gradient", "hessian", "jacobian", "values"
    steps = []
    for model in (new_local_model(3, 2), used(new_local_model(3, 2), *data)):
        sphere_model(np.array([1.5, 0.4, 0.9]), np.zeros(2), model)
        convexify(model)
        steps.append(np.zeros(3))
        propose(model, 2, 10.0, np.full(3, 0.3), steps[-1], np.zeros(2))
    assert np.array_equal(*steps)
