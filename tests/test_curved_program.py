"""Curved objectives around cones against closed forms, another solver, and their own variants."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import sparse
from scipy.optimize import minimize

from landing_cli.optimize.cone_program import ConeOptions
from landing_cli.optimize.cone_records import ConeBlock, SmoothRows
from landing_cli.optimize.curved_program import CurvedProgram, CurvedValue, solve_curved_program

TIGHT = ConeOptions(progress_tol=1e-13, max_rounds=200)


def in_ball(radius: float, n: int = 2) -> ConeBlock:
    matrix = np.concatenate([np.zeros((1, n)), np.eye(n)])
    offset = np.append(radius, np.zeros(n))
    return ConeBlock("second_order", sparse.csr_array(matrix), offset, n + 1)


def no_rows(x: np.ndarray) -> SmoothRows:
    empty = sparse.csr_array((0, len(x)))
    return SmoothRows(np.zeros(0), empty, np.zeros(0), empty)


def inequality(value: Callable, slope: Callable) -> Callable[[np.ndarray], SmoothRows]:
    def smooth(x: np.ndarray) -> SmoothRows:
        rows = sparse.csr_array(np.atleast_2d(slope(x)))
        return SmoothRows(np.zeros(0), sparse.csr_array((0, len(x))), np.atleast_1d(value(x)), rows)

    return smooth


def banana(x: np.ndarray) -> CurvedValue:
    """Rosenbrock's valley, nothing known of its curvature."""
    a, b = 1.0 - x[0], x[1] - x[0] ** 2
    slope = np.array([-2.0 * a - 40.0 * x[0] * b, 20.0 * b])
    return CurvedValue(a * a + 10.0 * b * b, slope, np.zeros((2, 2)))


def test_a_quadratic_with_known_curvature_takes_one_step() -> None:
    H, c = np.array([[3.0, 1.0], [1.0, 2.0]]), np.array([1.0, -2.0])
    program = CurvedProgram(
        lambda x: CurvedValue(float(c @ x + 0.5 * x @ H @ x), c + H @ x, H), (), no_rows, np.full(2, 10.0)
    )
    solution = solve_curved_program(program, np.ones(2), TIGHT)
    assert solution.status == "converged"
    assert solution.rounds <= 3
    assert_allclose(solution.x, -np.linalg.solve(H, c), rtol=1e-7)


def test_the_valley_s_floor_is_found_from_the_slope_alone() -> None:
    program = CurvedProgram(banana, (), no_rows, np.full(2, 0.5))
    solution = solve_curved_program(program, np.array([-1.2, 1.0]), TIGHT)
    assert solution.status == "converged"
    assert_allclose(solution.x, 1.0, rtol=1e-5)


def test_the_unknown_part_of_the_curvature_is_learnt() -> None:
    """Steps with the known part alone fall short twelvefold: a hundred rounds and more."""
    known, rest, c = 6.0 * np.eye(2), np.array([[-5.5, 0.2], [0.2, -5.0]]), np.array([0.1, -0.1])
    H = known + rest
    program = CurvedProgram(
        lambda x: CurvedValue(float(c @ x + 0.5 * x @ H @ x), c + H @ x, known), (), no_rows, np.full(2, 10.0)
    )
    solution = solve_curved_program(program, np.zeros(2), TIGHT)
    assert solution.rounds <= 8
    assert_allclose(solution.x, -np.linalg.solve(H, c), rtol=1e-5)


@pytest.mark.parametrize("start", [(-0.5, 0.3), (3.0, -2.0)])
def test_a_ball_and_a_curved_wall_against_another_solver(start: tuple[float, float]) -> None:
    """The second start lies outside of both."""

    def room(x: np.ndarray) -> float:
        return 0.2 + x[1] ** 2 - 0.5 * x[0]

    def slope(x: np.ndarray) -> np.ndarray:
        return np.array([-0.5, 2.0 * x[1]])

    program = CurvedProgram(banana, (in_ball(0.7),), inequality(room, slope), np.full(2, 0.3))
    solution = solve_curved_program(program, np.array(start), TIGHT)
    other = minimize(
        lambda x: banana(x).value,
        [0.1, 0.1],
        jac=lambda x: banana(x).slope,
        method="SLSQP",
        tol=1e-14,
        constraints=[
            {"type": "ineq", "fun": lambda x: 0.49 - x @ x, "jac": lambda x: -2.0 * x},
            {"type": "ineq", "fun": room, "jac": slope},
        ],
    )
    assert solution.status == "converged" and solution.violation < 1e-8
    assert_allclose(solution.x, other.x, rtol=1e-5)
    assert_allclose(solution.value, other.fun, rtol=1e-8)


def test_walls_without_room_between_them_are_infeasible() -> None:
    program = CurvedProgram(
        banana,
        (),
        inequality(lambda x: np.array([x[0] - 1.0, -x[0]]), lambda x: np.array([[1.0, 0.0], [-1.0, 0.0]])),
        np.full(2, 0.5),
    )
    solution = solve_curved_program(program, np.zeros(2), ConeOptions(price_max=1e3))
    assert solution.status == "infeasible"
    assert solution.violation >= 0.5 - 1e-6


def test_too_few_rounds_say_nothing() -> None:
    program = CurvedProgram(banana, (), no_rows, np.full(2, 0.1))
    solution = solve_curved_program(program, np.array([-1.2, 1.0]), ConeOptions(max_rounds=3))
    assert solution.status == "unresolved" and "3 rounds" in solution.message
