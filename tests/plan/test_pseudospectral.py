"""The Gauss pseudospectral plan against IPOPT, an integrator and the free-control optimum."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from planning_samples import lumpy_case, paper_case, paper_mesh

from landing_cli.flight.replay import replay
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.optimize.collocation import gauss_span
from landing_cli.plan import gauss_program
from landing_cli.plan.convex import plan_convex
from landing_cli.plan.gauss_phases import Phase, fly_phase
from landing_cli.plan.gauss_problem import gauss_problem
from landing_cli.plan.gauss_program import build_program, start_point, velocity_increment_m_s
from landing_cli.plan.pseudospectral import phase_nodes, plan_pseudospectral, without_terrain
from landing_cli.plan.records import ConvexOptions, PlanCase, PseudospectralOptions

NODES = 24


@pytest.fixture(scope="module")
def lumpy() -> PlanCase:
    return lumpy_case()


@pytest.fixture(scope="module")
def paper(reference_shapes: Path) -> PlanCase:
    return paper_case(paper_mesh(reference_shapes))


def free_delta_v(case: PlanCase, nodes: int) -> float:
    solved = without_terrain(case, PseudospectralOptions(nodes=nodes))
    assert solved.solution.status == "converged"
    return velocity_increment_m_s(solved.problem, solved.solution.x)


def test_ipopt_finds_the_same_optimum_of_the_same_transcription(lumpy: PlanCase) -> None:
    oracles = pytest.importorskip("flight_oracles")
    expected = oracles.collocated_delta_v(lumpy, 16, gauss_program._BOUND_POINTS)
    np.testing.assert_allclose(free_delta_v(lumpy, 16), expected, rtol=1e-6, atol=0)


def test_more_nodes_come_down_to_the_optimum_that_multiple_shooting_finds(lumpy: PlanCase) -> None:
    oracles = pytest.importorskip("flight_oracles")
    bound = oracles.shooting_delta_v(lumpy, 200)
    over = [free_delta_v(lumpy, n) / bound - 1.0 for n in (10, 20, 40)]
    assert 0.0 < over[2] < 0.5 * over[1] < 0.5 * over[0]
    assert over[2] < 6e-3


def test_the_paper_s_case_without_terrain_reaches_12_91_kg(paper: PlanCase) -> None:
    """The bound is that of the nonlinear solver; a polynomial of 60 nodes stays a little above it."""
    oracles = pytest.importorskip("flight_oracles")
    to_kg = paper.spacecraft.mass_kg / paper.spacecraft.exhaust_velocity_m_s
    bound = to_kg * oracles.shooting_delta_v(paper, 200)
    assert bound == pytest.approx(12.91, abs=0.01)
    assert 0.0 < to_kg * free_delta_v(paper, 60) - bound < 0.03


@pytest.mark.parametrize("backwards", [False, True])
def test_a_phase_flies_as_the_integrator_does(lumpy: PlanCase, backwards: bool) -> None:
    problem = gauss_problem(lumpy, "fuel", "rest", 0, (20,))
    t = problem.node_times_s
    u = 0.02 * np.stack([np.cos(t / 300.0), np.sin(t / 500.0), 0.1 + 0 * t], axis=1)
    start = np.concatenate([lumpy.position_m, lumpy.velocity_m_s])
    flown = replay(
        lumpy.position_m,
        lumpy.velocity_m_s,
        lumpy.spacecraft.mass_kg,
        problem.legs((u / problem.scale_m_s2).ravel()),
        rotation_rate_rad_s=lumpy.asteroid.rotation_rate_rad_s,
        field=lumpy.asteroid.gravity,
        exhaust_velocity_m_s=lumpy.spacecraft.exhaust_velocity_m_s,
    )
    end = np.concatenate([flown.position_m[-1], flown.velocity_m_s[-1]])
    anchor, other = (end, start) if backwards else (start, end)
    flight = fly_phase(
        lumpy.asteroid.gravity,
        lumpy.asteroid.rotation_rate_rad_s,
        problem.phases[0],
        anchor,
        u,
        backwards=backwards,
    )
    np.testing.assert_allclose(flight.far[:3], other[:3], rtol=0, atol=2e-4)
    np.testing.assert_allclose(flight.far[3:], other[3:], rtol=0, atol=1e-6)


@pytest.mark.parametrize("backwards", [False, True])
def test_slopes_of_a_phase_are_those_of_finite_differences(lumpy: PlanCase, backwards: bool) -> None:
    phase = Phase(gauss_span(5), 100.0, 900.0)
    anchor = np.concatenate([0.4 * lumpy.position_m, lumpy.velocity_m_s])
    u = 0.01 * np.sin(1.0 + np.arange(15.0)).reshape(5, 3)

    def fly(control: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        flight = fly_phase(lumpy.asteroid.gravity, 3.3e-4, phase, anchor, control, backwards=backwards)
        return flight.position_m, flight.far

    flight = fly_phase(lumpy.asteroid.gravity, 3.3e-4, phase, anchor, u, backwards=backwards)
    for k in range(15):
        step = np.zeros(15)
        step[k] = 1e-5
        (r_up, far_up), (r_down, far_down) = fly(u + step.reshape(5, 3)), fly(u - step.reshape(5, 3))
        scale = np.abs(flight.far_slope).max(axis=1)
        assert np.all(np.abs((far_up - far_down) / 2e-5 - flight.far_slope[:, k]) < 1e-6 * scale)
        slope = flight.position_slope[:, :, k]
        assert np.abs((r_up - r_down) / 2e-5 - slope).max() < 1e-6 * np.abs(slope).max()


@pytest.mark.parametrize("mass_model", ["constant", "variable"])
def test_slopes_of_the_program_are_those_of_finite_differences(lumpy: PlanCase, mass_model: str) -> None:
    case = replace(lumpy, mass_model=mass_model)
    problem = gauss_problem(case, "fuel", "rest", 1880, (6, 4))
    share = (problem.node_times_s / case.tof_s)[:, None]
    path = (1 - share) * case.position_m + share * (case.site.position_m + 3000.0 * case.site.normal)
    x = start_point(problem, 0.02 * np.sin(np.arange(30.0)).reshape(10, 3), path)
    smooth = build_program(problem).smooth
    rows, rng = smooth(x), np.random.default_rng(3)
    for _ in range(3):
        d = rng.normal(size=len(x))
        h = 1e-6
        up, down = smooth(x + h * d), smooth(x - h * d)
        for name in ("equality", "inequality"):
            slope = getattr(rows, f"{name}_slope") @ d
            difference = (getattr(up, name) - getattr(down, name)) / (2 * h)
            np.testing.assert_allclose(difference, slope, rtol=0, atol=3e-6 * np.abs(slope).max())


@pytest.mark.parametrize("terminal", ["rest", "paper"])
@pytest.mark.parametrize("objective", ["fuel", "energy"])
def test_a_plan_keeps_every_constraint_when_flown(lumpy: PlanCase, objective: str, terminal: str) -> None:
    plan = plan_pseudospectral(lumpy, PseudospectralOptions(objective, terminal, NODES))
    assert plan.status == "planned", plan.message
    assert plan.peak_thrust_n <= lumpy.spacecraft.thrust_max_n * (1 + 2e-5)
    assert plan.clearance_surface_m >= lumpy.clearance_m - 1e-3
    if terminal == "paper":  # a(t_f) = 0: the last thrust carries the weight
        t = plan.trajectory
        total = np.gradient(t.velocity_m_s, t.t_s, axis=0)
        assert np.linalg.norm(total[-1]) < 0.1 * np.linalg.norm(total, axis=1).max()
        assert plan.landing_angle_deg < 5.0


@pytest.mark.slow
def test_the_full_case_is_above_free_control_by_what_the_polynomial_costs(paper: PlanCase) -> None:
    convex = plan_convex(paper, ConvexOptions())
    fuel = [plan_pseudospectral(paper, PseudospectralOptions(nodes=n)) for n in (24, 40)]
    assert convex.status == "planned"
    assert all(plan.status == "planned" for plan in fuel), [plan.message for plan in fuel]
    over = [plan.fuel_kg / convex.fuel_kg - 1.0 for plan in fuel]
    assert 0.0 < over[1] < over[0] < 0.025
    assert over[1] < 0.012


def test_energy_is_dearer_in_fuel_and_gentler(lumpy: PlanCase) -> None:
    fuel = plan_pseudospectral(lumpy, PseudospectralOptions("fuel", "rest", NODES))
    energy = plan_pseudospectral(lumpy, PseudospectralOptions("energy", "rest", NODES))
    assert energy.fuel_kg > 1.1 * fuel.fuel_kg
    assert energy.peak_thrust_n < fuel.peak_thrust_n


def test_too_weak_a_thruster_is_told_what_it_would_take(lumpy: PlanCase) -> None:
    plan = plan_pseudospectral(replace(lumpy, tof_s=800.0), PseudospectralOptions(nodes=NODES))
    assert plan.status == "infeasible"
    assert plan.trajectory is None
    assert "even without terrain it takes" in plan.message
    needed = float(plan.message.split("takes ")[1].split(" N")[0])
    stronger = Spacecraft(500.0, 1.02 * needed, 150.0)
    free = without_terrain(
        replace(lumpy, tof_s=800.0, spacecraft=stronger), PseudospectralOptions(nodes=NODES)
    )
    assert free.solution.status == "converged"


def test_too_little_propellant_is_no_plan(lumpy: PlanCase) -> None:
    plan = plan_pseudospectral(lumpy, PseudospectralOptions(nodes=NODES))
    short = replace(lumpy.spacecraft, propellant_kg=0.97 * plan.fuel_kg)
    starved = plan_pseudospectral(replace(lumpy, spacecraft=short), PseudospectralOptions(nodes=NODES))
    assert starved.status != "planned"


def test_nodes_are_shared() -> None:
    assert phase_nodes(40) == (30, 10)
    assert phase_nodes(4) == (1, 6)
