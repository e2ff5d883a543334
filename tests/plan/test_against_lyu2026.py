"""The figures of Lyu 2026 at its published guide points and times, and where they come from.

The reference mesh is not shipped; without it these tests are skipped. What the paper prints stands beside
each figure.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planning_samples import PUBLISHED_GUIDE_POINTS_M, paper_case, paper_mesh

from landing_cli.body.mesh import Mesh
from landing_cli.flight.bezier_curve import first_control_points, last_control_points
from landing_cli.flight.legs import BezierLeg
from landing_cli.flight.peak_thrust import peak_acceleration
from landing_cli.plan.assess import Measured, measure
from landing_cli.plan.bezier import plan_bezier
from landing_cli.plan.guide_points import guide_plane
from landing_cli.plan.initial_states import even_longitudes, turned_cases
from landing_cli.plan.records import BezierOptions, PlanCase
from landing_cli.plan.shortest_time import plan_shortest_time, rule_time

OPTIONS = BezierOptions()


@pytest.fixture(scope="module")
def mesh(reference_shapes) -> Mesh:
    return paper_mesh(reference_shapes)


def published_curve(case: PlanCase) -> BezierLeg:
    """The printed r_ac, and r_f + 2590 n_f: the printed r_ao has x and z swapped and x off by 1 m."""
    start = (case.position_m, case.velocity_m_s, case.acceleration_m_s2)
    end = (case.site.position_m, case.landing_velocity_m_s, case.landing_acceleration_m_s2)
    first, last = first_control_points(7, case.tof_s, *start), last_control_points(7, case.tof_s, *end)
    r_ac, r_ao = PUBLISHED_GUIDE_POINTS_M[0], case.site.position_m + 2590.0 * case.site.normal
    return BezierLeg(case.tof_s, np.concatenate([first, [r_ac, r_ao], last]), case.asteroid.gravity)


def published_flight(case: PlanCase) -> tuple[Measured, float]:
    """The flight, and its peak thrust at stationary points (N)."""
    leg = published_curve(case)
    peak = peak_acceleration(leg, case.asteroid.rotation_rate_rad_s)[0]
    return measure(case, (leg,)), peak * case.spacecraft.mass_kg


def test_site_is_the_centroid_of_facet_2396(mesh):
    case = paper_case(mesh)
    assert np.linalg.norm(case.site.position_m - [-647.33, 6602.60, -1712.16]) < 0.01
    np.testing.assert_allclose(case.site.normal, [0.74141887, 0.65760627, -0.13361161], rtol=0, atol=1e-5)
    printed = np.array([0.74, 0.66, -0.13])
    angle = np.degrees(np.arccos(printed @ case.site.normal / np.linalg.norm(printed)))
    assert angle == pytest.approx(0.26, abs=0.01)


def test_published_guide_points_lie_in_our_guide_plane(mesh):
    """r_ao along n_f at 2590 m (two cm in y and z, one metre in x), r_ac in the plane to 2 cm."""
    case = paper_case(mesh)
    plane, (r_ac, r_ao) = guide_plane(case), PUBLISHED_GUIDE_POINTS_M
    off = r_ao - (case.site.position_m + 2590.0 * case.site.normal)
    assert np.abs(off[1:]).max() < 0.02 and abs(off[0]) == pytest.approx(1.0, abs=0.05)
    assert abs((r_ac - plane.origin_m) @ plane.e_y) < 0.02


def test_published_curve_in_point_mass_gravity(mesh):
    """The paper: 42.72 N, 26.56 kg, 334.54 m, 0.06 degrees."""
    flown, peak = published_flight(paper_case(mesh))
    assert peak == pytest.approx(42.74, abs=0.03)
    assert flown.fuel_kg == pytest.approx(27.76, abs=0.02)
    assert flown.clearance_vertices_m == pytest.approx(334.4, abs=0.5)
    assert flown.clearance_surface_m == pytest.approx(189.8, abs=0.5)
    assert flown.landing_angle_deg == pytest.approx(0.055, abs=0.003)


def test_published_curve_in_polyhedral_gravity(mesh):
    flown, peak = published_flight(paper_case(mesh, polyhedron=True))
    assert peak == pytest.approx(42.72, abs=0.03)
    assert flown.fuel_kg == pytest.approx(26.79, abs=0.05)


@pytest.mark.parametrize(("polyhedron", "fuel_kg"), [(False, 27.01), (True, 26.08)])
def test_published_curve_with_variable_mass(mesh, polyhedron, fuel_kg):
    flown, _ = published_flight(paper_case(mesh, polyhedron, mass_model="variable"))
    assert flown.fuel_kg == pytest.approx(fuel_kg, abs=0.01)


def test_published_curve_breaks_its_own_clearance(mesh):
    case = paper_case(mesh)
    assert published_flight(case)[0].clearance_surface_m < case.clearance_m


def test_least_fuel_under_the_exact_clearance(mesh):
    plan = plan_bezier(paper_case(mesh), OPTIONS)
    assert plan.status == "planned"
    assert plan.fuel_kg == pytest.approx(27.53, abs=0.02)
    assert plan.peak_thrust_n == pytest.approx(43.29, abs=0.05)
    assert 300.0 <= plan.clearance_surface_m < 320.0
    assert plan.parameters["line_of_sight"] == "blocked"


def test_least_fuel_under_the_vertex_metric_all_but_scrapes_the_ground(mesh):
    plan = plan_bezier(paper_case(mesh, clearance_metric="vertices"), OPTIONS)
    assert plan.status == "planned" and plan.clearance_metric == "vertices"
    assert plan.clearance_min_m == plan.clearance_vertices_m >= 300.0
    assert plan.clearance_surface_m < 10.0


def test_polyhedral_plan_is_within_its_constraints(mesh):
    plan = plan_bezier(paper_case(mesh, polyhedron=True), OPTIONS)
    assert plan.status == "planned"
    assert plan.fuel_kg == pytest.approx(26.68, abs=0.05)


@pytest.mark.parametrize(
    ("metric", "rule_s", "rule_tolerance_s"), [("surface", 1698.0, 3.0), ("vertices", 1690.0, 10.0)]
)
def test_shortest_time(mesh, metric, rule_s, rule_tolerance_s):
    """The paper: 1689.96 s at 60.00 N, by eq 39 and the vertex metric."""
    case = paper_case(mesh, clearance_metric=metric)
    rule = rule_time(case, OPTIONS)
    assert rule.converged and rule.peak_n == pytest.approx(60.0, rel=1e-5)
    assert rule.tof_s == pytest.approx(rule_s, abs=rule_tolerance_s)
    plan = plan_shortest_time(case, OPTIONS)
    assert plan.status == "planned" and plan.peak_thrust_n <= 60.0
    assert plan.tof_s == pytest.approx(rule_s, abs=rule_tolerance_s)
    assert plan.tof_s <= rule.tof_s


def test_published_times(mesh):
    """Thrust and fuel of section 3.1; the paper: 60.00 N, 31.47 kg; 52.83 N, 29.53 kg; 42.72 N, 26.56 kg.

    With the vertex metric, as in the paper. Its thrusts agree within 0.7 %, its fuel within 2 %, since it
    falls between our two gravity fields and mass models.
    """
    printed = {1689.96: (60.00, 31.47), 1800.0: (52.83, 29.53), 2000.0: (42.72, 26.56)}
    for tof_s, (thrust_n, fuel_kg) in printed.items():
        plan = plan_bezier(paper_case(mesh, tof_s=tof_s, clearance_metric="vertices"), OPTIONS)
        assert plan.status == "planned"
        assert plan.peak_thrust_n == pytest.approx(thrust_n, rel=7e-3)
        assert plan.fuel_kg == pytest.approx(fuel_kg, rel=2e-2)


def test_a_time_too_short_names_one_that_is_enough(mesh):
    plan = plan_bezier(paper_case(mesh, tof_s=1500.0), OPTIONS)
    assert plan.status == "infeasible"
    told = (
        "the gentlest curve found needs 76.69 N at 1500 s, the thruster gives 60 N; 1696.68 s needs 59.95 N"
    )
    assert plan.message == told


def test_nominal_start_lies_on_the_circle_of_the_sweep(mesh):
    """v = 3.497 (sin, -cos, 0) and a = -7.0e-4 r_hat, turned: the printed state to its rounding."""
    case = paper_case(mesh)
    longitude = np.degrees(np.arctan2(case.position_m[1], case.position_m[0]))
    assert longitude == pytest.approx(157.5, abs=0.01)
    away = case.position_m / np.linalg.norm(case.position_m)
    np.testing.assert_allclose(
        case.velocity_m_s, 3.497 * np.array([away[1], -away[0], 0.0]), rtol=0, atol=0.005
    )
    np.testing.assert_allclose(case.acceleration_m_s2, -7.0e-4 * away, rtol=0, atol=1e-5)


def test_success_over_longitudes(mesh):
    """A prototype reached 91 % geometrically and 80 % within 60 N over random longitudes."""
    plans = [plan_bezier(c, OPTIONS) for c in turned_cases(paper_case(mesh), even_longitudes(72))]
    refused = [p.parameters.get("refused_by") for p in plans]
    assert all((p.status == "planned") == (r is None) for p, r in zip(plans, refused, strict=True))
    planned, geometric = refused.count(None), refused.count(None) + refused.count("thrust")
    assert 0.76 < planned / 72 < 0.82 and 0.88 < geometric / 72 < 0.93
    failing = even_longitudes(72)[[r is not None for r in refused]]
    assert failing.min() >= 210.0 and failing.max() <= 295.0
    for plan, case in zip(plans, turned_cases(paper_case(mesh), even_longitudes(72)), strict=True):
        if plan.status == "planned":
            again = measure(replace(case), plan.control)
            assert again.clearance_surface_m >= 300.0 and again.peak_thrust_n <= 60.0 * (1 + 1e-9)
