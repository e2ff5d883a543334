"""Whole plans with free thrust and with free guide points: the paper's case, and an independent solver."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import casadi
import numpy as np
import pytest
from numpy.testing import assert_allclose
from planning_samples import facet_site, paper_case, paper_mesh
from shape_helpers import fibonacci_ellipsoid

from landing_cli.body.clearance import signed_distances
from landing_cli.body.mesh import facet_centroids
from landing_cli.errors import InputRefused
from landing_cli.flight.legs import BezierLeg
from landing_cli.flight.replay import replay
from landing_cli.plan.bezier_free_guides import plan_bezier_free_guides
from landing_cli.plan.convex import plan_convex
from landing_cli.plan.records import ConvexOptions, FreeGuidesOptions, Plan, PlanCase
from landing_cli.plan.sampled_flight import sampled_flight

RADIUS_M = 8000.0


@pytest.fixture(scope="module")
def ball_case() -> PlanCase:
    """Round a ball, to a site behind its limb."""
    mesh = fibonacci_ellipsoid((RADIUS_M,) * 3, 3000)
    facet = int(np.argmax(facet_centroids(mesh) @ [0.2, 0.9, -0.1]))
    return paper_case(mesh, site=facet_site(mesh, facet), position_m=np.array([-20_000.0, -12_000.0, 3000.0]))


@pytest.fixture(scope="module")
def ball_plan(ball_case: PlanCase) -> Plan:
    return plan_convex(ball_case)


@pytest.fixture(scope="module")
def eros(reference_shapes: Path) -> PlanCase:
    return paper_case(paper_mesh(reference_shapes))


@pytest.fixture(scope="module")
def eros_plan(eros: PlanCase) -> Plan:
    return plan_convex(eros)


def by_ipopt(case: PlanCase, entry_s: float, arcs: int = 80) -> float:
    """Least fuel about a ball, kg: thrust constant over even arcs, RK4, the ball's own distance."""
    h, a_max = case.tof_s / arcs, case.spacecraft.thrust_max_n / case.spacecraft.mass_kg
    length, speed = RADIUS_M, RADIUS_M / case.tof_s
    w, gm = case.asteroid.rotation_rate_rad_s, case.asteroid.gm_m3_s2

    def rate(y: casadi.MX, u: casadi.MX) -> casadi.MX:
        r, v = y[:3] * length, y[3:] * speed
        g = -gm * r / casadi.norm_2(r) ** 3
        turning = casadi.vertcat(2 * w * v[1] + w * w * r[0], -2 * w * v[0] + w * w * r[1], 0)
        return casadi.vertcat(v / length, (g + turning + u * a_max) / speed)

    opti = casadi.Opti()
    y, u, bound = opti.variable(6, arcs + 1), opti.variable(3, arcs), opti.variable(1, arcs)
    site, normal = casadi.DM(case.site.position_m / length), casadi.DM(case.site.normal)
    opti.subject_to(y[:, 0] == casadi.DM([*case.position_m / length, *case.velocity_m_s / speed]))
    opti.subject_to(y[:, -1] == casadi.vertcat(site, casadi.DM.zeros(3)))
    for k in range(arcs):
        k1 = rate(y[:, k], u[:, k])
        k2 = rate(y[:, k] + h / 2 * k1, u[:, k])
        k3 = rate(y[:, k] + h / 2 * k2, u[:, k])
        k4 = rate(y[:, k] + h * k3, u[:, k])
        opti.subject_to(y[:, k + 1] == y[:, k] + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
        opti.subject_to(casadi.sumsqr(u[:, k]) <= bound[k] ** 2)
        if 0 < k * h < entry_s:
            opti.subject_to(casadi.sumsqr(y[:3, k]) >= (1.0 + case.clearance_m / RADIUS_M) ** 2)
        elif k * h >= entry_s:
            offset, angle = y[:3, k] - site, case.cone_half_angle_rad
            along = casadi.dot(offset, normal)
            opti.subject_to(casadi.sumsqr(offset) * np.cos(angle) ** 2 <= along**2)
            opti.subject_to(along >= 0)
    opti.subject_to(opti.bounded(1e-4, bound, 1.0))
    opti.minimize(casadi.sum2(bound) / arcs)
    share = np.linspace(0.0, 1.0, arcs + 1)
    aside = 12_000.0 * np.outer(np.sin(np.pi * share), [-0.7, 0.7, 0.0])
    path = case.position_m + np.outer(share, case.site.position_m - case.position_m) + aside
    opti.set_initial(y[:3, :], path.T / length)
    opti.set_initial(bound, 0.5)
    quiet = {"print_level": 0, "sb": "yes", "max_iter": 500, "tol": 1e-7}
    opti.solver("ipopt", {"print_time": False}, quiet)
    spent = float(opti.solve().value(casadi.sum2(bound))) * a_max * h
    return case.spacecraft.mass_kg * spent / case.spacecraft.exhaust_velocity_m_s


@pytest.mark.slow
def test_ipopt_finds_the_same_optimum_round_a_ball(ball_case: PlanCase, ball_plan: Plan) -> None:
    """The mesh lies up to 5 m inside the ball, and IPOPT's control is constant over even arcs."""
    assert ball_plan.status == "planned", ball_plan.message
    entry = float(ball_plan.parameters["cone_entry_bound_s"])  # type: ignore[arg-type]
    assert_allclose(ball_plan.fuel_kg, by_ipopt(ball_case, entry), rtol=5e-3)


def test_neighbouring_cone_entries_cost_more(ball_plan: Plan) -> None:
    costs = ball_plan.parameters["cone_entries_cost"]
    entries = ball_plan.parameters["cone_entries_tried_s"]
    assert entries[int(np.argmin(costs))] == ball_plan.parameters["cone_entry_bound_s"]  # type: ignore
    assert min(entries) < ball_plan.parameters["cone_entry_bound_s"] < max(entries)  # type: ignore


def test_dop853_lands_on_the_site(ball_case: PlanCase, ball_plan: Plan) -> None:
    craft = ball_case.spacecraft
    flown = replay(
        ball_case.position_m,
        ball_case.velocity_m_s,
        craft.mass_kg,
        ball_plan.control,
        rotation_rate_rad_s=ball_case.asteroid.rotation_rate_rad_s,
        field=ball_case.asteroid.gravity,
        exhaust_velocity_m_s=craft.exhaust_velocity_m_s,
    )
    scale = np.linalg.norm(ball_case.position_m - ball_case.site.position_m)
    assert np.linalg.norm(flown.position_m[-1] - ball_case.site.position_m) < 1e-7 * scale
    assert np.linalg.norm(flown.velocity_m_s[-1]) < 1e-7 * scale / ball_case.tof_s * 10


def test_nothing_hides_between_the_samples(ball_case: PlanCase, ball_plan: Plan) -> None:
    """At ten times as many samples the clearance is broken by less than the sagitta of the path."""
    trajectory, _ = sampled_flight(ball_case, ball_plan.control, 20_001)
    before = trajectory.position_m[trajectory.t_s < ball_plan.cone_entry_s]
    assert signed_distances(ball_case.surface, before).min() > ball_case.clearance_m - 0.05
    assert np.linalg.norm(trajectory.thrust_n, axis=1).max() <= 60.0 * (1 + 1e-6)


def test_the_papers_case_costs_half_of_its_fuel(eros: PlanCase, eros_plan: Plan) -> None:
    """Lyu 2026 prints 26.56 kg (Bezier) and 26.39 kg (pseudospectral)."""
    assert eros_plan.status == "planned", eros_plan.message
    assert eros_plan.fuel_kg < 14.36
    assert eros_plan.clearance_surface_m >= 300.0
    assert_allclose(eros_plan.parameters["fuel_without_terrain_kg"], 12.91, rtol=0, atol=0.01)


def test_equation_4_costs_next_to_nothing(eros: PlanCase, eros_plan: Plan) -> None:
    plan = plan_convex(eros, ConvexOptions(terminal="paper"))
    assert plan.status == "planned", plan.message
    assert eros_plan.fuel_kg - 0.01 < plan.fuel_kg < eros_plan.fuel_kg + 0.1
    assert plan.landing_angle_deg < 0.05
    assert_allclose(plan.trajectory.thrust_n[-1], weight(eros), atol=1e-4)  # type: ignore[union-attr]


def weight(case: PlanCase) -> np.ndarray:
    """Thrust that hovers at the site, N."""
    r, w = case.site.position_m, case.asteroid.rotation_rate_rad_s
    pull = -case.asteroid.gm_m3_s2 * r / np.linalg.norm(r) ** 3
    return -case.spacecraft.mass_kg * (pull + w * w * r * [1.0, 1.0, 0.0])


def test_too_short_a_flight_tells_the_thrust(eros: PlanCase) -> None:
    plan = plan_convex(replace(eros, tof_s=1000.0))
    assert plan.status == "infeasible"
    assert "even without terrain" in plan.message
    assert "it needs 65." in plan.message
    assert "at 1000 s; the thruster gives 60 N" in plan.message


@pytest.mark.parametrize(("degree", "most_kg"), [(7, 25.7), (9, 19.4)])
def test_free_guide_points(eros: PlanCase, degree: int, most_kg: float) -> None:
    plan = plan_bezier_free_guides(eros, FreeGuidesOptions(degree=degree))
    assert plan.status == "planned", plan.message
    assert plan.fuel_kg < most_kg
    assert plan.clearance_surface_m >= 300.0
    (leg,) = plan.control
    assert isinstance(leg, BezierLeg)
    assert leg.points_m.shape == (degree + 1, 3)
    assert_allclose(leg.points_m[3:-3], plan.parameters["guide_points_m"], rtol=1e-12)


def test_a_curve_that_needs_full_thrust_keeps_it_between_the_samples(eros: PlanCase) -> None:
    plan = plan_bezier_free_guides(eros, FreeGuidesOptions(degree=14, samples=101))
    assert plan.status == "planned", plan.message
    assert 59.9 < plan.peak_thrust_n <= 60.0
    assert plan.fuel_kg < 15.6


@pytest.mark.parametrize("degree", [5, 15])
def test_degrees_without_use_are_refused(eros: PlanCase, degree: int) -> None:
    with pytest.raises(InputRefused, match=f"degree {degree}"):
        plan_bezier_free_guides(eros, FreeGuidesOptions(degree=degree))
