"""The successive convexification against closed forms, an independent solver and its own variants."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import casadi
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import sparse

from landing_cli.optimize.cone_program import (
    ConeBlock,
    ConeOptions,
    ConeProgram,
    ConeSolution,
    SmoothRows,
    solve_cone_program,
)

TIGHT = ConeOptions(progress_tol=1e-9)
NO_ROWS = sparse.csr_array((0, 2))


def rows(
    equality: list[float], slope: list[list[float]], inequality: list[float], fall: list[list[float]]
) -> SmoothRows:
    return SmoothRows(
        np.array(equality, dtype=float),
        sparse.csr_array(np.array(slope, dtype=float).reshape(-1, 2)),
        np.array(inequality, dtype=float),
        sparse.csr_array(np.array(fall, dtype=float).reshape(-1, 2)),
    )


def in_disc(radius: float) -> ConeBlock:
    return ConeBlock(
        "second_order", sparse.csr_array([[0.0, 0], [1, 0], [0, 1]]), np.array([radius, 0, 0]), 3
    )


def program(
    smooth: Callable[[np.ndarray], SmoothRows], cost: tuple[float, float] = (1.0, 1.0), **changes: object
) -> ConeProgram:
    return replace(ConeProgram(np.array(cost), (in_disc(2.0),), smooth, np.full(2, 0.5)), **changes)


def nothing(_: np.ndarray) -> SmoothRows:
    return rows([], [], [], [])


def test_a_linear_cost_in_a_disc_ends_opposite_to_it() -> None:
    cost = np.array([0.6, -0.8])
    free = program(nothing, (0.6, -0.8), reach=np.full(2, np.inf))
    solution = solve_cone_program(free, np.zeros(2), TIGHT)
    assert solution.status == "converged"
    assert_allclose(solution.x, -2.0 * cost, rtol=1e-7)
    assert_allclose(solution.value, -2.0, rtol=1e-8)


def test_a_quadratic_cost_is_minimised_exactly() -> None:
    """Least |x - (3, 0)|^2 / 2 in the disc of radius 2 is at (2, 0)."""
    curved = program(nothing, (-3.0, 0.0), quadratic=sparse.csr_array(np.eye(2)))
    solution = solve_cone_program(curved, np.array([-1.0, 1.0]), TIGHT)
    assert_allclose(solution.x, [2.0, 0.0], atol=1e-4)
    assert_allclose(solution.value, 2.0 - 6.0, rtol=1e-8)


def on_circle(x: np.ndarray) -> SmoothRows:
    """|x|^2 = 1, and x away from the disc of radius 1/2 about (-0.8, -0.6)."""
    gap = x - np.array([-0.8, -0.6])
    return rows([x @ x - 1.0], [2.0 * x], [gap @ gap - 0.25], [2.0 * gap])


def by_ipopt(start: tuple[float, float]) -> np.ndarray:
    opti = casadi.Opti()
    x = opti.variable(2)
    opti.minimize(x[0] + x[1])
    opti.subject_to(casadi.dot(x, x) == 1)
    opti.subject_to(casadi.dot(x - casadi.DM([-0.8, -0.6]), x - casadi.DM([-0.8, -0.6])) >= 0.25)
    opti.set_initial(x, casadi.DM(start))
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "tol": 1e-12})
    return np.array(opti.solve().value(x))


@pytest.mark.parametrize("start", [(0.2, -0.9), (-0.3, 0.8)])
@pytest.mark.parametrize("elastic", [True, False])
def test_a_nonconvex_program_ends_where_ipopt_does(start: tuple[float, float], elastic: bool) -> None:
    solution = solve_cone_program(program(on_circle, elastic_equalities=elastic), np.array(start), TIGHT)
    assert solution.status == "converged"
    assert_allclose(solution.x, by_ipopt(start), rtol=0, atol=1e-7)
    assert solution.rows.violation < 1e-8


def test_rows_that_cannot_bind_may_be_left_out() -> None:
    def with_fall(x: np.ndarray) -> SmoothRows:
        return replace(on_circle(x), fall=np.array([4.0]))

    start = np.array([0.2, -0.9])
    all_rows, few = (solve_cone_program(program(f), start, TIGHT) for f in (on_circle, with_fall))
    assert_allclose(few.x, all_rows.x, rtol=0, atol=1e-8)


def test_the_multiplier_is_the_price_of_room() -> None:
    """Least x + y for x >= 1 + e, y >= -1: the cost rises by one per e."""

    def room(x: np.ndarray) -> SmoothRows:
        return rows([], [], [x[0] - 1.0, x[1] + 1.0], [[1.0, 0.0], [0.0, 1.0]])

    solution = solve_cone_program(program(room), np.zeros(2), TIGHT)
    assert_allclose(solution.inequality_multipliers, [1.0, 1.0], rtol=1e-5)


def valley(x: np.ndarray) -> SmoothRows:
    """y >= the higher of two walls: the row tells of one of them only, as a closest facet does."""
    left, right = x[1] - x[0], x[1] + 2.0 * x[0]
    if left < right:
        return rows([], [], [left], [[-1.0, 1.0]])
    return rows([], [], [right], [[2.0, 1.0]])


def test_a_refused_step_tells_of_the_other_wall() -> None:
    """Least y in a valley of two walls, of which every point sees one: at its bottom, the origin."""
    solution = solve_cone_program(program(valley, (0.05, 1.0)), np.array([0.9, 1.5]), TIGHT)
    assert solution.status == "converged"
    assert_allclose(solution.x, [0.0, 0.0], atol=1e-6)
    assert solution.rounds < 20


def test_least_violation_is_told_as_infeasible() -> None:
    """|x|^2 = -1 has no solution; its violation is least, 1, at the origin."""

    def impossible(x: np.ndarray) -> SmoothRows:
        return rows([x @ x + 1.0], [2.0 * x], [], [])

    solution = solve_cone_program(program(impossible), np.array([0.7, 0.4]))
    assert solution.status == "infeasible"
    assert_allclose(solution.x, 0.0, atol=1e-3)
    assert_allclose(solution.rows.violation, 1.0, rtol=1e-5)
    assert "1 remains" in solution.message


def test_cones_without_a_common_point_are_infeasible() -> None:
    far = ConeBlock("nonnegative", sparse.csr_array([[1.0, 0.0]]), np.array([-3.0]))
    solution = solve_cone_program(program(nothing, blocks=(in_disc(2.0), far)), np.zeros(2))
    assert solution.status == "infeasible"
    assert "no point in common" in solution.message


def test_too_few_rounds_say_nothing_about_feasibility() -> None:
    solution: ConeSolution = solve_cone_program(
        program(on_circle), np.array([0.2, -0.9]), replace(TIGHT, max_rounds=2)
    )
    assert solution.status == "unresolved"
    assert "2 rounds" in solution.message
