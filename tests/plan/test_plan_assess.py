"""The yardstick: every constraint, broken one at a time, is found and told in words."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from planning_samples import lumpy_case
from test_acceleration_control import bezier_leg

from landing_cli.body.clearance import signed_distances
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.plan.assess import broken_constraints, measure, no_plan, plan_of
from landing_cli.plan.bezier import plan_bezier
from landing_cli.plan.records import BezierOptions, Plan, PlanCase

CASE = lumpy_case()


@pytest.fixture(scope="module")
def plan() -> Plan:
    found = plan_bezier(CASE, BezierOptions(coarse_points=9, fine_points=5))
    assert found.status == "planned"
    return found


def told(plan: Plan, **changes: Any) -> list[str]:
    case = replace(CASE, **changes)
    return broken_constraints(case, measure(case, plan.control))


def test_a_sound_plan_breaks_nothing(plan: Plan) -> None:
    assert told(plan) == []
    assert plan.cone_entry_s > 0.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"spacecraft": Spacecraft(500.0, 20.0, 150.0)}, "N at 2000 s; the thruster gives 20 N"),
        ({"clearance_m": 9000.0}, "of the surface before the cone"),
        ({"clearance_m": 9000.0, "clearance_metric": "vertices"}, "of the nearest vertex before the cone"),
        ({"landing_velocity_m_s": np.array([0.0, -0.01, 0.0])}, "it touches down 0.01 m/s off"),
        ({"spacecraft": Spacecraft(500.0, 60.0, 150.0, 5.0)}, "kg of the 5 kg on board"),
    ],
)
def test_a_broken_constraint_is_told(plan: Plan, changes: dict[str, Any], words: str) -> None:
    found = told(plan, **changes)
    assert len(found) == 1 and words in found[0]


def test_a_path_that_ends_elsewhere_is_told(plan: Plan) -> None:
    away = replace(CASE.site, position_m=CASE.site.position_m + 1.0 * CASE.site.normal)
    assert "it ends 1 m from the site" in told(plan, site=away)


def test_a_path_through_the_rock_inside_the_cone_is_told() -> None:
    """From below the horizon with the cone's axis turned along the ground: the body stands in the cone."""
    case = lumpy_case(start_longitude_deg=270.0)
    turned = replace(case, site=replace(case.site, normal=-case.site.normal))
    found = broken_constraints(turned, measure(turned, (bezier_leg(case),)))
    assert any("into the surface inside the cone" in words or "before the cone" in words for words in found)


def test_the_least_distance_is_that_of_all_samples_before_the_entry(plan: Plan) -> None:
    measured = measure(CASE, plan.control)
    distance = signed_distances(CASE.surface, measured.trajectory.position_m)
    assert measured.clearance_surface_m == pytest.approx(distance[: measured.entry].min(), abs=1e-9)
    assert measured.depth_in_cone_m == pytest.approx(-distance[measured.entry :].min(), abs=1e-9)


def test_the_entry_is_where_the_cone_is_not_left_again(plan: Plan) -> None:
    measured = measure(CASE, plan.control)
    limit = CASE.cone_half_angle_rad
    assert (measured.cone_angle_rad[measured.entry :] <= limit + 1e-4).all()
    assert measured.cone_angle_rad[measured.entry - 1] > limit


def test_mass_models_agree_with_the_rocket_equation(plan: Plan) -> None:
    """Constant mass: m0 dv / ve; variable: m0 (1 - exp(-dv / ve)), and the thrust follows the mass."""
    ve = CASE.spacecraft.exhaust_velocity_m_s
    constant, variable = (
        measure(replace(CASE, mass_model=model), plan.control) for model in ("constant", "variable")
    )
    assert constant.delta_v_m_s == variable.delta_v_m_s
    assert constant.fuel_kg == pytest.approx(500.0 * constant.delta_v_m_s / ve, rel=1e-12)
    assert variable.fuel_kg == pytest.approx(500.0 * -np.expm1(-variable.delta_v_m_s / ve), rel=1e-12)
    assert constant.trajectory.mass_kg[-1] == 500.0
    assert variable.trajectory.mass_kg[-1] == pytest.approx(500.0 - variable.fuel_kg, rel=1e-9)
    assert variable.peak_thrust_n < constant.peak_thrust_n


def test_a_method_without_a_path_says_why() -> None:
    plan = no_plan(CASE, "convex", "unresolved", "it did not converge in 30 rounds")
    assert plan.trajectory is None and plan.control == () and np.isnan(plan.fuel_kg)
    assert plan.clearance_metric == CASE.clearance_metric


def test_the_answer_of_a_broken_path_carries_the_reason(plan: Plan) -> None:
    weak: PlanCase = replace(CASE, spacecraft=Spacecraft(500.0, 20.0, 150.0))
    answer = plan_of(
        weak, "bezier", plan.control, iterations=1, parameters={}, otherwise="infeasible", because="too weak"
    )
    assert answer.status == "infeasible"
    assert answer.message.startswith("too weak; it needs ")
    assert answer.trajectory is not None
