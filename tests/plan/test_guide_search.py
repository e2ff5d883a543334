"""The lazy two-level search against looking at every candidate, and its parts against brute force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from kernel_calls import from_python
from planning_samples import lumpy_case

from landing_cli.body.clearance import signed_distances
from landing_cli.body.gravity.dipole import dipole_field
from landing_cli.body.vertex_distance import vertex_distances
from landing_cli.plan.assess import measure
from landing_cli.plan.bezier import plan_bezier
from landing_cli.plan.curve_family import fill_costs
from landing_cli.plan.grid_search import best_kept, search_guide_points, two_level_search
from landing_cli.plan.guide_candidates import clearances, curve_of, prepare_search, price
from landing_cli.plan.path_check import (
    CUTS,
    KEPT,
    TOO_CLOSE,
    check_path as check_path_part,
    cone_entry as cone_entry_part,
    least_distance,
)
from landing_cli.plan.records import BezierOptions
from landing_cli.plan.shortest_time import RESOLUTION_S, plan_shortest_time, rule_time

check_path = from_python(check_path_part)
cone_entry = from_python(cone_entry_part)

OPTIONS = BezierOptions()
SMALL = BezierOptions(coarse_points=9, fine_points=7, samples=101)


def strong(case):
    return replace(case, spacecraft=replace(case.spacecraft, thrust_max_n=500.0))


def path_of(search, alpha, beta):
    family = search.dense
    return family[:, 0] + alpha * family[:, 1] + beta * family[:, 2]


def in_cone(case, path):
    """Samples in the cone, by angles; the touchdown counts."""
    offset = path - case.site.position_m
    along, length = offset @ case.site.normal, np.linalg.norm(offset, axis=1)
    with np.errstate(invalid="ignore"):
        angle = np.arccos(np.clip(along / length, -1, 1))
    return (length == 0.0) | (angle <= case.cone_half_angle_rad)


def verdict_by_brute_force(case, path):
    inside = in_cone(case, path)
    outside = np.flatnonzero(~inside)
    entry = outside[-1] + 1 if len(outside) else 0
    distance = signed_distances(case.surface, path)
    if (distance[entry:] < -0.01).any():
        return CUTS, entry
    before = distance[:entry]
    if case.clearance_metric == "vertices":
        before = np.where(before < 0, before, vertex_distances(case.surface, path[:entry]))
    return (TOO_CLOSE if (before < case.clearance_m).any() else KEPT), entry


@pytest.mark.parametrize("metric", ["surface", "vertices"])
def test_every_verdict_is_that_of_brute_force(metric):
    verdicts = []
    for longitude in (60.0, 195.0, 250.0):
        case = lumpy_case(longitude, clearance_metric=metric)
        search = prepare_search(case, SMALL)
        shares = np.linspace(0, 1, 7)
        for alpha, beta in zip(
            *(lambda c: (c.alpha_m, c.beta_m))(price(search, shares, shares)), strict=True
        ):
            path = path_of(search, alpha, beta)
            expected, entry = verdict_by_brute_force(case, path)
            half = case.cone_half_angle_rad
            assert cone_entry(path, case.site.position_m, case.site.normal, half) == entry
            by_vertices = metric == "vertices"
            found = check_path(case.surface, by_vertices, path, entry, case.clearance_m)[0]
            assert found == expected
            verdicts.append(found)
            least, where = least_distance(case.surface, by_vertices, path, 0, entry)
            every = signed_distances(case.surface, path[:entry])
            if by_vertices:
                every = np.where(every < 0, every, vertex_distances(case.surface, path[:entry]))
            assert least == every.min() and every[where] == least
    assert {KEPT, TOO_CLOSE} <= set(verdicts)


def test_check_measures_few_distances():
    case = lumpy_case(195.0)
    search = prepare_search(case, OPTIONS)
    found = search_guide_points(search)
    path = path_of(search, found.alpha_m, found.beta_m)
    entry = cone_entry(path, case.site.position_m, case.site.normal, case.cone_half_angle_rad)
    verdict, _, measured = check_path(case.surface, False, path, entry, case.clearance_m)
    assert verdict == KEPT and measured < 0.15 * len(path)


@pytest.mark.parametrize("mass_model", ["constant", "variable"])
@pytest.mark.parametrize("polyhedron", [False, True])
def test_prices_are_those_of_the_flown_curves(mass_model, polyhedron):
    """Delta-v and peak of candidates, against the yardstick that evaluates the curve in the field itself."""
    case = lumpy_case(195.0, polyhedron, mass_model=mass_model)
    search = prepare_search(case, OPTIONS)
    shares = np.array([0.02, 0.1, 0.2, 0.3])
    candidates = price(search, shares, shares)
    clear = np.flatnonzero(clearances(search, candidates) > 300.0)[::2]
    assert len(clear) >= 2
    for k in clear:
        flown = measure(case, (curve_of(search, candidates.alpha_m[k], candidates.beta_m[k]),))
        exact = 7e-4 if polyhedron else 2e-4
        assert candidates.delta_v_m_s[k] == pytest.approx(flown.delta_v_m_s, rel=exact)
        assert candidates.peak_m_s2[k] * 500.0 == pytest.approx(flown.peak_thrust_n, rel=5e-4)


def test_departure_of_the_polyhedron_is_small_where_it_is_interpolated():
    case = lumpy_case(195.0, polyhedron=True)
    search = prepare_search(case, replace(OPTIONS, samples=51))
    shares = np.linspace(0.0, 1.0, 6)
    candidates = price(search, shares, shares)
    clear = np.flatnonzero(clearances(search, candidates) > 300.0)
    alpha, beta = candidates.alpha_m[clear], candidates.beta_m[clear]
    exact, peak = np.zeros(clear.size), np.zeros(clear.size)
    field = case.asteroid.gravity
    none = np.zeros((0, 3, clear.size))
    fill_costs(field.kind, field.params, search.curves, none, alpha, beta, np.inf, exact, peak)
    np.testing.assert_allclose(candidates.delta_v_m_s[clear], exact, rtol=7e-4)
    np.testing.assert_allclose(candidates.peak_m_s2[clear], peak, rtol=1e-4)
    rough = price(search, shares, shares, departs=False)
    assert np.abs(rough.delta_v_m_s[clear] / exact - 1).max() > 4e-3


def test_any_gravity_model_is_priced():
    case = lumpy_case(195.0)
    field = dipole_field(case.asteroid.gm_m3_s2, 0.5, 12000.0)
    case = replace(case, asteroid=replace(case.asteroid, gravity=field))
    search = prepare_search(case, OPTIONS)
    found = search_guide_points(search)
    flown = measure(case, (curve_of(search, found.alpha_m, found.beta_m),))
    assert found.delta_v_m_s == pytest.approx(flown.delta_v_m_s, rel=2e-4)


@pytest.mark.parametrize("longitude", [30.0, 195.0, 330.0])
@pytest.mark.parametrize("metric", ["surface", "vertices"])
def test_lazy_search_finds_what_looking_at_every_candidate_finds(longitude, metric):
    case = strong(lumpy_case(longitude, clearance_metric=metric))
    search = prepare_search(case, SMALL)
    shares = np.linspace(0.0, 1.0, SMALL.coarse_points)
    candidates = price(search, shares, shares if search.plane.blocked else np.zeros(1))
    kept = [
        verdict_by_brute_force(case, path_of(search, a, b))[0] == KEPT
        for a, b in zip(candidates.alpha_m, candidates.beta_m, strict=True)
    ]
    best = best_kept(search, candidates, "fuel")
    cost = np.where(kept, candidates.delta_v_m_s, np.inf)
    assert best is not None and best[0] == int(np.argmin(cost))
    limit = float(np.median(candidates.peak_m_s2[np.array(kept)]))
    bounded = best_kept(search, candidates, "fuel", limit)
    cost[candidates.peak_m_s2 > limit] = np.inf
    assert bounded is not None and bounded[1].peak_m_s2 <= limit
    assert bounded[1].delta_v_m_s >= np.min(cost)
    gentle = best_kept(search, candidates, "peak")
    assert gentle[0] == int(np.argmin(np.where(kept, candidates.peak_m_s2, np.inf)))


def test_fine_grid_is_at_least_as_good_as_the_coarse_one():
    case = strong(lumpy_case(195.0))
    search = prepare_search(case, OPTIONS)
    shares = np.linspace(0.0, 1.0, OPTIONS.coarse_points)
    coarse = best_kept(search, price(search, shares, shares), "fuel")[1]
    fine = two_level_search(search, "fuel")
    assert fine.delta_v_m_s < coarse.delta_v_m_s
    gentle = two_level_search(search, "peak")
    assert gentle.peak_m_s2 <= fine.peak_m_s2


def test_a_plan_keeps_its_constraints_and_tells_its_choices():
    case = strong(lumpy_case(195.0))
    plan = plan_bezier(case, OPTIONS)
    assert plan.status == "planned", plan.message
    assert verdict_by_brute_force(case, plan.trajectory.position_m)[0] == KEPT
    assert plan.clearance_surface_m >= 300.0
    told = plan.parameters
    plane_height = told["alpha_min_m"] <= told["alpha_m"] <= told["alpha_max_m"]
    assert plane_height and told["beta_min_m"] <= told["beta_m"] <= told["beta_max_m"]
    np.testing.assert_allclose(
        plan.control[0].points_m[4], case.site.position_m + told["alpha_m"] * case.site.normal, rtol=1e-12
    )
    np.testing.assert_allclose(
        plan.control[0].points_m[3],
        np.array(told["tangent_point_m"]) + told["beta_m"] * np.array(told["frame"][2]),
        rtol=1e-12,
    )


def test_free_line_of_sight_puts_both_guide_points_together():
    case = strong(lumpy_case(60.0))
    plan = plan_bezier(case, OPTIONS)
    assert plan.parameters["line_of_sight"] == "free" and plan.status == "planned"
    np.testing.assert_array_equal(plan.control[0].points_m[3], plan.control[0].points_m[4])


def test_too_little_thrust_is_told_with_a_time_that_would_do():
    case = lumpy_case(195.0)
    weak = replace(case, spacecraft=replace(case.spacecraft, thrust_max_n=20.0))
    plan = plan_bezier(weak, OPTIONS)
    assert plan.status == "infeasible" and plan.parameters["refused_by"] == "thrust"
    assert f"needs {plan.peak_thrust_n:.4g} N at 2000 s, the thruster gives 20 N" in plan.message
    longer = float(plan.message.split("; ")[1].split(" s needs ")[0])
    again = plan_bezier(replace(weak, tof_s=longer), OPTIONS)
    assert again.status == "planned" and again.peak_thrust_n <= 20.0


def test_too_much_clearance_is_told_with_the_closest_call():
    case = strong(lumpy_case(195.0, clearance_m=20000.0))
    plan = plan_bezier(case, OPTIONS)
    assert plan.status == "infeasible" and plan.parameters["refused_by"] == "clearance"
    assert "20000 m asked" in plan.message and plan.trajectory is not None


def test_no_room_for_a_guide_point_is_told_with_its_bounds():
    plan = plan_bezier(strong(lumpy_case(195.0, clearance_m=40000.0)), OPTIONS)
    assert plan.status == "infeasible" and plan.parameters["refused_by"] == "bounds"
    assert "alpha has to be at least 40000 m (the clearance)" in plan.message


def test_shortest_time_is_bracketed():
    case = lumpy_case(195.0)
    options = replace(OPTIONS, coarse_points=13, fine_points=11)
    plan = plan_shortest_time(case, options)
    assert plan.status == "planned" and plan.peak_thrust_n <= 60.0
    assert plan.peak_thrust_n == pytest.approx(60.0, rel=1e-3)
    shorter = replace(case, tof_s=plan.parameters["too_short_s"])
    assert plan.tof_s - shorter.tof_s <= RESOLUTION_S
    refused = plan_bezier(shorter, options)
    assert refused.status == "infeasible" and refused.parameters["refused_by"] == "thrust"
    rule = rule_time(case, options)
    assert plan.tof_s <= rule.tof_s + 1.0
    assert plan.parameters["rule_tof_s"] == rule.tof_s


def test_no_time_is_long_enough_for_a_thruster_that_cannot_hover():
    case = lumpy_case(195.0)
    weak = replace(case, spacecraft=replace(case.spacecraft, thrust_max_n=0.5))
    plan = plan_shortest_time(weak, SMALL)
    assert plan.status == "infeasible" and plan.method == "shortest_time"
    assert "is long enough" in plan.message
