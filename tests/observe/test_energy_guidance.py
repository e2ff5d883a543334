"""The energy-optimal law against closed forms, quadrature and an integrator that knows no cubic."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad_vec, solve_ivp
from solver_samples import miss_m, potato_case

from landing_cli.flight.dynamics import natural_acceleration
from landing_cli.flight.energy_guidance import (
    cost_to_go,
    flown_cost,
    fly_closed_loop,
    fly_for,
    guided_acceleration,
    least_cost_duration,
    time_to_go,
    times_to_go,
)
from landing_cli.flight.field_along import field_along
from landing_cli.observe.nominal import nominal_path

DOWN = np.array([0.0, 0.0, -5e-3])


def test_time_to_go_from_rest_has_a_closed_form() -> None:
    rng = np.random.default_rng(3)
    for d, g in zip(rng.normal(size=(50, 3)) * 300.0, rng.normal(size=(50, 3)) * 1e-3, strict=True):
        expected = np.sqrt(6.0 * np.linalg.norm(d) / np.linalg.norm(g))
        assert time_to_go(d, np.zeros(3), g) == pytest.approx(expected, rel=1e-12, abs=0)


def test_the_cost_is_stationary_at_every_root() -> None:
    rng, counts = np.random.default_rng(5), set()
    for _ in range(200):
        d, v = rng.normal(size=3) * 100.0, rng.normal(size=3) * 1.5
        roots = times_to_go(d, v, DOWN)
        counts.add(len(roots))
        terms = [4.0 * v @ v / roots**2, 24.0 * v @ d / roots**3, 36.0 * d @ d / roots**4]
        scale = sum(np.abs(term) for term in terms) + DOWN @ DOWN
        assert (np.abs(DOWN @ DOWN - sum(terms)) <= 1e-11 * scale).all()
    assert counts == {1, 3}


def test_of_three_roots_the_cheapest_is_taken() -> None:
    # a direct approach faster than sqrt(6 r g)
    d, v = np.array([0.0, 0.0, 200.0]), np.array([0.0, 0.0, -2.5])
    assert np.linalg.norm(v) > np.sqrt(6.0 * 200.0 * 5e-3)
    roots = times_to_go(d, v, DOWN)
    assert len(roots) == 3
    costs = cost_to_go(roots, d, v, DOWN)
    assert costs[1] == costs.max()
    assert time_to_go(d, v, DOWN) == roots[np.argmin(costs)]
    everywhere = cost_to_go(np.linspace(20.0, 3000.0, 20_000), d, v, DOWN)
    assert costs.min() <= everywhere.min() * (1 + 1e-12)


def test_on_the_target_at_rest_no_time_is_left() -> None:
    assert time_to_go(np.zeros(3), np.zeros(3), DOWN) == 0.0


def test_the_cost_is_the_integral_of_the_law() -> None:
    d, v, tof = np.array([-60.0, 70.0, 65.0]), np.array([0.1, -0.2, 0.05]), 400.0
    flight = fly_for(d, v, np.zeros(3), tof)

    def square(t: float) -> float:
        r, w, _ = flight.states(np.array([t]))
        return float((guided_acceleration(r[0], w[0], DOWN, tof - t) ** 2).sum())

    integral = quad_vec(square, 0.0, tof * (1 - 1e-9), epsrel=1e-10)[0]
    assert cost_to_go([tof], d, v, DOWN)[0] == pytest.approx(integral, rel=1e-7)


def test_the_law_flies_the_cubic_whatever_the_field() -> None:
    case = potato_case()
    field, w, site, tof = case.asteroid.gravity, case.asteroid.rotation_rate_rad_s, case.frame.origin_m, 500.0
    v0 = np.array([0.05, -0.02, 0.03])

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        natural = np.array(natural_acceleration(field.kind, field.params, w, *y))
        return np.append(y[3:], natural + guided_acceleration(y[:3] - site, y[3:], natural, tof - t))

    times = np.linspace(0.0, tof - 20.0, 25)
    start = np.concatenate([case.position_m, v0])
    flown = solve_ivp(rates, times[[0, -1]], start, t_eval=times, rtol=1e-11, atol=1e-10).y.T
    r, v, _ = fly_for(case.position_m, v0, site, tof).states(times)
    np.testing.assert_allclose(r, flown[:, :3], rtol=0, atol=1e-6)
    np.testing.assert_allclose(v, flown[:, 3:], rtol=0, atol=1e-8)


def test_the_searched_time_of_flight_costs_least() -> None:
    case = potato_case()
    field, w, state = case.asteroid.gravity, case.asteroid.rotation_rate_rad_s, (case.position_m, np.zeros(3))
    found = least_cost_duration(field, w, *state, case.frame.origin_m, (150.0, 1500.0))

    def cost(duration: float) -> float:
        return flown_cost(field, w, fly_for(*state, case.frame.origin_m, duration))

    assert cost(found) <= min(cost(t) for t in np.linspace(150.0, 1500.0, 400))
    assert (cost(found * 1.001) - cost(found)) > 0.0 < (cost(found / 1.001) - cost(found))


def test_the_closed_loop_arrives_about_when_it_said_it_would() -> None:
    case = potato_case()
    flight = fly_closed_loop(
        case.asteroid.gravity, 1e-3, case.position_m, np.zeros(3), case.frame.origin_m, cycle_s=2.0
    )
    assert flight.arrived
    assert flight.duration_s == pytest.approx(flight.to_go_s[0], rel=0.1)
    r, v, _ = flight.states(np.array([flight.duration_s]))
    np.testing.assert_allclose(r[0], case.frame.origin_m, rtol=0, atol=1e-9)
    np.testing.assert_allclose(v[0], 0.0, rtol=0, atol=1e-12)
    # no jump where the time to go is solved for anew
    ends = flight.start_s[1:]
    before, after = flight.states(ends - 1e-9), flight.states(ends)
    np.testing.assert_allclose(before[0], after[0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(before[1], after[1], rtol=0, atol=1e-10)


@pytest.mark.parametrize("choice", ["fixed", "t_go", "search"])
def test_the_nominal_lands_open_loop(choice: str) -> None:
    case = replace(potato_case(), time_of_flight=choice)
    path = nominal_path(case)
    assert path.status == "planned", path.message
    assert miss_m(case, path) < 1e-6
    if choice == "fixed":
        flight = fly_for(case.position_m, case.velocity_m_s, case.frame.origin_m, case.tof_s)
        exact = flown_cost(case.asteroid.gravity, case.asteroid.rotation_rate_rad_s, flight)
        assert path.performance_index_m2_s3 == pytest.approx(exact, rel=1e-9)


def test_the_field_along_a_path_is_that_at_its_points() -> None:
    from landing_cli.body.gravity.field_values import accelerations, gradients

    case = potato_case()
    flight = fly_for(case.position_m, case.velocity_m_s, case.frame.origin_m, 800.0)
    times = np.linspace(0.0, 795.0, 157)
    g, G = field_along(case.asteroid.gravity, lambda t: flight.states(t)[0], np.array([0.0, 800.0]), times)
    points = flight.states(times)[0]
    exact = accelerations(case.asteroid.gravity, points)
    np.testing.assert_allclose(g, exact, rtol=0, atol=1e-11 * np.abs(exact).max())
    slopes = gradients(case.asteroid.gravity, points)
    np.testing.assert_allclose(G, slopes, rtol=0, atol=1e-7 * np.abs(slopes).max())
