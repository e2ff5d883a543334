"""Rows and cost of an extremal landing: closed forms, finite differences, and the path itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from kernel_calls import from_python, used
from landing_samples import landing_case
from numpy.testing import assert_allclose

from landing_cli.flight.extremal import scaled_start
from landing_cli.flight.legs import FinalArcLeg
from landing_cli.flight.replay import replay
from landing_cli.reach.costate_dynamics import (
    fly_extremal as fly_extremal_part,
    new_extremal,
    new_tangents,
    tangents as tangents_part,
)
from landing_cli.reach.ellipsoid_dips import (
    LEVEL,
    dip_row as dip_row_part,
    find_dips as find_dips_part,
    new_dips,
)
from landing_cli.reach.extremal_terms import (
    MAX_ROWS,
    N_ARC,
    ROW_GLIDE,
    ROW_HANDOVER,
    ROW_MASS,
    ROW_PROPELLANT,
    ExtremalProblem,
    extremal_problem,
    final_energy as final_energy_part,
    handover_hessian as handover_hessian_part,
    handover_rows as handover_rows_part,
    new_arc_work,
)

dip_row = from_python(dip_row_part)
final_energy = from_python(final_energy_part)
find_dips = from_python(find_dips_part)
fly_extremal = from_python(fly_extremal_part)
handover_hessian = from_python(handover_hessian_part)
handover_rows = from_python(handover_rows_part)
tangents = from_python(tangents_part)

TARGET_M, NORMAL = np.array([120.0, 60.0, 210.0]), np.array([0.36, 0.48, 0.8])
HANDOVER = (np.array([170.0, 110.0, 300.0]), np.array([-0.4, -0.2, -0.9]), 0.998)


def problem_of(**changes: Any) -> ExtremalProblem:
    return extremal_problem(landing_case(**changes))


def handover_state(problem: ExtremalProblem) -> np.ndarray:
    r, v, m = HANDOVER
    scale = problem.field.scale
    return np.concatenate([r / scale.length_m, v * scale.time_s / scale.length_m, [m]])


def rows_at(problem: ExtremalProblem, x: np.ndarray, guard: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    values, jacobian = np.zeros(MAX_ROWS), np.zeros((ROW_MASS, 7))
    target = TARGET_M / problem.field.scale.length_m
    handover_rows(problem, guard, target, NORMAL, x, values, jacobian, used(new_arc_work()))
    return values[:ROW_MASS], jacobian


def differences(f: Any, x: np.ndarray, h: float = 1e-5) -> np.ndarray:
    steps = np.eye(len(x)) * h
    return np.stack([(f(x + s) - f(x - s)) / (2.0 * h) for s in steps], axis=-1)


@pytest.mark.parametrize("reading", ["compensated", "paper"])
def test_derivatives_of_the_handover_rows_agree_with_differences(reading: str) -> None:
    problem = problem_of(final_stage_thrust=reading)
    x = handover_state(problem)
    _, jacobian = rows_at(problem, x)
    assert_allclose(jacobian, differences(lambda y: rows_at(problem, y)[0], x), rtol=1e-6, atol=1e-7)


def test_the_thrust_rows_are_the_thrust_that_is_flown() -> None:
    case = landing_case()
    problem = extremal_problem(case)
    r, v, m = HANDOVER
    leg = FinalArcLeg(case.final_stage_s, r, v, TARGET_M, case.asteroid.gravity)
    flown = replay(
        r,
        v,
        m * case.spacecraft.mass_kg,
        [leg],
        rotation_rate_rad_s=case.asteroid.rotation_rate_rad_s,
        field=case.asteroid.gravity,
        exhaust_velocity_m_s=case.spacecraft.exhaust_velocity_m_s,
        integrator="gauss",
    )
    ratio = np.linalg.norm(flown.thrust_n, axis=1) / case.spacecraft.thrust_max_n
    values, _ = rows_at(problem, handover_state(problem))
    stride = (len(ratio) - 1) // (N_ARC - 1)
    assert_allclose(values[:N_ARC], 0.5 * (1.0 - ratio[::-stride] ** 2), rtol=0, atol=3e-6)
    left = flown.mass_kg[-1] / case.spacecraft.mass_kg
    assert_allclose(values[ROW_PROPELLANT], problem.propellant - 1.0 + left, rtol=0, atol=3e-6)


def test_in_the_papers_reading_the_bound_is_on_the_total_acceleration_alone() -> None:
    problem = problem_of(final_stage_thrust="paper")
    r, v, m = HANDOVER
    at_handover = -(6.0 * (r - TARGET_M) + 4.0 * 200.0 * v) / 200.0**2  # eq 14 at t = 0
    ratio = m * np.linalg.norm(at_handover) / problem.field.scale.acceleration_m_s2
    values, _ = rows_at(problem, handover_state(problem))
    assert_allclose(values[N_ARC - 1], 0.5 * (1.0 - ratio**2), rtol=1e-12)


def test_the_guard_is_kept_from_the_thrust_rows_alone() -> None:
    problem = problem_of()
    x = handover_state(problem)
    change = rows_at(problem, x, 1e-3)[0] - rows_at(problem, x)[0]
    assert_allclose(change[:N_ARC], -1e-3, rtol=1e-9)
    assert np.all(change[N_ARC:] == 0.0)


def test_glide_rows_are_positive_exactly_when_the_whole_arc_lies_in_the_cone() -> None:
    problem = problem_of()
    rng = np.random.default_rng(0)
    seen = set()
    for _ in range(200):
        x = handover_state(problem) + rng.normal(size=7) * [0.05, 0.05, 0.05, 0.3, 0.3, 0.3, 0.0]
        values, _ = rows_at(problem, x)
        d, v, T = x[:3] - TARGET_M / problem.field.scale.length_m, x[3:6], problem.final_time
        A, B = (3.0 * d + v * T) / T**2, -(2.0 * d + v * T) / T**3
        arc = A + np.linspace(1e-9, T, 400)[:, None] * B  # r - r_c over s^2
        inside = np.all(arc @ NORMAL >= problem.cos_half_angle * np.linalg.norm(arc, axis=1) - 1e-9)
        assert inside == np.all(values[ROW_GLIDE : ROW_GLIDE + 2] >= -1e-9)
        seen.add(bool(inside))
    assert seen == {True, False}


def test_the_final_energy_is_half_the_integral_of_the_total_acceleration() -> None:
    problem = problem_of()
    x, target = handover_state(problem), TARGET_M / problem.field.scale.length_m
    gradient = np.zeros(7)
    energy = final_energy(problem, target, x, gradient)
    d, v, T = x[:3] - target, x[3:6], problem.final_time
    s = np.linspace(0.0, T, 2001)[:, None]
    star = 2.0 * (3.0 * d + v * T) / T**2 - 6.0 * s * (2.0 * d + v * T) / T**3
    assert_allclose(energy, 0.5 * np.trapezoid((star**2).sum(axis=1), s[:, 0]), rtol=1e-6)
    by_differences = differences(lambda y: final_energy(problem, target, y, np.zeros(7)), x)
    assert_allclose(gradient, by_differences, rtol=0, atol=1e-6)


def test_the_handovers_hessian_is_the_derivative_of_its_gradient_without_gravity_and_mass() -> None:
    """Gravity's bend along the arc and the mass are left out of the Hessian on purpose."""
    problem = problem_of(final_stage_thrust="paper")
    problem = problem._replace(field=problem.field._replace(scale=problem.field.scale._replace(flow=0.0)))
    x, target = handover_state(problem), TARGET_M / problem.field.scale.length_m
    multipliers = np.zeros(MAX_ROWS)
    multipliers[:ROW_PROPELLANT] = np.linspace(0.1, 0.7, ROW_PROPELLANT)

    def gradient(y: np.ndarray) -> np.ndarray:
        of_final = np.zeros(7)
        final_energy(problem, target, y, of_final)
        return (of_final - multipliers[:ROW_MASS] @ rows_at(problem, y)[1])[:6]

    K = np.zeros((7, 7))
    handover_hessian(problem, target, x, multipliers, K, used(new_arc_work()))
    expected = differences(gradient, x)[:, :6]
    assert_allclose(K[:6, :6], expected, rtol=0, atol=1e-6 * np.abs(expected).max())


FLYBY_M_S = np.array([-2.0, -0.4, -1.0])
PUSHES = np.array([-0.4, -1.8, 1.2, -0.3, -0.6, 0.8, 0.4])


def fly_by(problem: ExtremalProblem, costates: np.ndarray, n_steps: int = 30) -> tuple[Any, int, Any, int]:
    case = landing_case(velocity_m_s=FLYBY_M_S)
    extremal, dips = new_extremal(n_steps), used(new_dips())
    extremal.state[0, :14] = scaled_start(problem.field.scale, case.position_m, case.velocity_m_s, costates)
    k = fly_extremal(problem.field, extremal)
    return extremal, k, dips, find_dips(problem.field.inverse_axes, extremal, k, dips)


def test_a_dip_is_the_least_distance_from_the_ellipsoid_and_its_derivative_agrees_with_differences() -> None:
    problem = problem_of()
    extremal, k, dips, count = fly_by(problem, PUSHES)
    assert count == 1
    fine, steps, _, _ = fly_by(problem, PUSHES, 3000)
    levels = np.linalg.norm(fine.state[: steps + 1, :3] * problem.field.inverse_axes, axis=1)
    assert 5 < np.argmin(levels) < steps - 5
    assert_allclose(dips.places[0, LEVEL], levels.min(), rtol=0, atol=1e-5)
    of, row, hessian = new_tangents(30), np.zeros(7), np.zeros((7, 7))
    tangents(problem.field, extremal, k, of)
    dip_row(problem.field.inverse_axes, extremal, of.nodes, dips, 0, row, 1.0, hessian)
    by_differences = differences(lambda c: fly_by(problem, c)[2].places[0, LEVEL], PUSHES, 1e-5)
    assert_allclose(row, by_differences, rtol=0, atol=1e-6)
    assert_allclose(hessian, hessian.T, rtol=0, atol=1e-9)


def test_a_dips_hessian_is_exact_where_the_path_is_linear_in_the_costates() -> None:
    """Throttled, without gravity and mass flow the path is linear; what bends is |xi| and the dip's time."""
    problem = problem_of()
    weightless = 1e-12 * problem.field.params
    weightless.setflags(write=False)
    scale = problem.field.scale._replace(flow=0.0)
    problem = problem._replace(field=problem.field._replace(params=weightless, scale=scale))
    costates = 0.6 * PUSHES

    def row_at(c: np.ndarray, hessian: np.ndarray) -> np.ndarray:
        extremal, k, dips, count = fly_by(problem, c)
        assert count == 1 and not extremal.saturated[:k].any()
        of, row = new_tangents(30), np.zeros(7)
        tangents(problem.field, extremal, k, of)
        dip_row(problem.field.inverse_axes, extremal, of.nodes, dips, 0, row, 1.0, hessian)
        return row

    hessian = np.zeros((7, 7))
    row_at(costates, hessian)
    expected = differences(lambda c: row_at(c, np.zeros((7, 7))), costates, 1e-4)
    # the bend over time is a difference over one step
    assert_allclose(hessian, expected, rtol=0, atol=0.02 * np.abs(expected).max())


def test_a_path_that_stays_away_has_no_dip_and_the_end_is_the_handovers() -> None:
    problem = problem_of()
    assert fly_by(problem, -PUSHES)[3] == 0
    x = handover_state(problem)
    level = np.linalg.norm(x[:3] * problem.field.inverse_axes)
    assert_allclose(rows_at(problem, x)[0][ROW_HANDOVER], level - 1.0, rtol=1e-12)
