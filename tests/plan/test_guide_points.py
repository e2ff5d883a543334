"""The guide plane and the bounds of the guide points against the paper's formulas and brute force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planning_samples import facet_site, lumpy_case, paper_case, paper_mesh

from landing_cli.body.clearance import contains
from landing_cli.body.mesh import facet_centroids
from landing_cli.plan.guide_points import (
    above_guide_point,
    alpha_bounds,
    beta_bounds,
    guide_plane,
    height_at_radius,
    height_on_ray,
)

LONGITUDES = np.arange(0.0, 360.0, 15.0)


def line_is_free(case, count=4001):
    """Whether no point of the line from just above the site to the start lies in the body: brute force."""
    share = np.linspace(1e-6, 1.0, count)[:, None]
    line = case.site.position_m + share * (case.position_m - case.site.position_m)
    return not contains(case.surface, line).any()


@pytest.mark.parametrize("longitude", LONGITUDES)
def test_frame_is_right_handed_and_points_out_of_the_body(longitude):
    case = lumpy_case(longitude)
    plane = guide_plane(case)
    frame = np.stack([plane.e_x, plane.e_y, plane.e_z])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), rtol=0, atol=1e-14)
    assert np.linalg.det(frame) == pytest.approx(1.0, rel=1e-13)
    assert plane.e_z @ case.site.normal > 0.0
    assert abs(plane.e_y @ case.site.normal) < 1e-14
    np.testing.assert_allclose(
        case.site.position_m + plane.distance_m * plane.e_x, case.position_m, rtol=1e-13, atol=1e-9
    )


def test_line_of_sight_is_that_of_brute_force():
    seen = []
    for longitude in LONGITUDES:
        case = lumpy_case(longitude)
        seen.append(not guide_plane(case).blocked)
        assert seen[-1] == line_is_free(case), longitude
    assert 3 < sum(seen) < len(seen) - 3


def test_nothing_of_the_outline_between_site_and_start_rises_above_the_tangents():
    from landing_cli.body.plane_section import plane_section

    for longitude in LONGITUDES:
        case = lumpy_case(longitude)
        plane = guide_plane(case)
        offset = plane_section(case.asteroid.mesh, plane.origin_m, plane.e_y).reshape(-1, 3) - plane.origin_m
        x, z = offset @ plane.e_x, offset @ plane.e_z
        between = (x > 0.0) & (x < plane.distance_m)
        top = float((plane.tangent_point_m - plane.origin_m) @ plane.e_z)
        assert (z[between] <= top + 1e-9).all()
        angles = np.arctan2(z[between], plane.distance_m - x[between])
        assert (angles <= plane.tangent_angle_rad + 1e-12).all()


def test_ray_height_is_both_branches_of_equation_16():
    for longitude in LONGITUDES:
        case = lumpy_case(longitude)
        plane, n_f = guide_plane(case), case.site.normal
        v_p = case.velocity_m_s - (case.velocity_m_s @ plane.e_y) * plane.e_y
        offset = case.position_m - case.site.position_m
        first = (v_p @ v_p * (offset @ n_f) - (v_p @ n_f) * (offset @ v_p)) / (v_p @ v_p - (v_p @ n_f) ** 2)
        found = height_on_ray(plane, plane.velocity_m_s, plane.origin_m, n_f)
        if not np.isnan(found):
            assert found == pytest.approx(first, rel=1e-9)
            meeting = plane.origin_m + found * n_f - case.position_m
            assert meeting @ v_p == pytest.approx(np.linalg.norm(meeting) * np.linalg.norm(v_p), rel=1e-9)
        gamma_s = 0.05
        grazing = np.array([-np.cos(gamma_s), np.sin(gamma_s)])
        found = height_on_ray(plane, grazing, plane.origin_m, n_f)
        below = np.arccos(-n_f @ plane.e_x) - gamma_s
        if below > 0.0:
            second = plane.distance_m * np.sin(gamma_s) / np.sin(below)
            assert found == pytest.approx(second, rel=1e-9)
        else:
            assert np.isnan(found)


def test_height_at_the_starts_radius_is_there():
    case = lumpy_case()
    height = height_at_radius(case.site.position_m, case.site.normal, 35000.0)
    assert np.linalg.norm(case.site.position_m + height * case.site.normal) == pytest.approx(35000.0)
    assert np.isnan(height_at_radius(np.array([0.0, 10.0, 0.0]), np.array([1.0, 0.0, 0.0]), 5.0))


def test_velocity_towards_the_body_lifts_alpha_above_the_grazing_line():
    case = lumpy_case(210.0, clearance_m=1.0)
    plane = guide_plane(case)
    assert plane.tangent_angle_rad > 0.0
    towards = replace(case, velocity_m_s=-3.0 * plane.e_x)
    plane = guide_plane(towards)
    assert plane.velocity_angle_rad < plane.tangent_angle_rad
    bounds = alpha_bounds(towards, plane, case.site.position_m)
    grazing = np.array([-np.cos(plane.tangent_angle_rad), np.sin(plane.tangent_angle_rad)])
    lift = height_on_ray(plane, grazing, plane.origin_m, case.site.normal)
    assert bounds.least == pytest.approx(np.fmax(lift, case.clearance_m))
    beta = beta_bounds(towards, plane)
    assert beta.least_by == "tangent" and beta.greatest_by == "start_radius"


def test_velocity_above_the_body_caps_alpha_where_it_leads():
    case = lumpy_case(120.0)
    plane = guide_plane(case)
    aim = case.site.position_m + 8000.0 * case.site.normal - case.position_m
    aimed = replace(case, velocity_m_s=3.0 * aim / np.linalg.norm(aim))
    bounds = alpha_bounds(aimed, guide_plane(aimed), plane.origin_m)
    assert bounds.greatest == pytest.approx(8000.0, rel=1e-9) and bounds.greatest_by == "velocity"


def test_last_control_point_is_a_floor():
    case = lumpy_case()
    high = case.site.position_m + 1234.0 * case.site.normal
    bounds = alpha_bounds(case, guide_plane(case), high)
    assert bounds.least == pytest.approx(1234.0) and bounds.least_by == "last_control_point"


def test_guide_point_floor_puts_one_above_the_other():
    case = lumpy_case()
    plane = guide_plane(case)
    alpha = np.array([500.0, 2500.0])
    beta = above_guide_point(case, plane, alpha)
    r_ac = plane.tangent_point_m + beta[:, None] * plane.e_z
    r_ao = plane.origin_m + alpha[:, None] * case.site.normal
    np.testing.assert_allclose((r_ac - r_ao) @ plane.e_z, 0.0, atol=1e-9)


def test_start_straight_above_and_at_rest_still_has_a_plane():
    case = lumpy_case()
    above = case.site.position_m + 20000.0 * case.site.normal
    for velocity in (np.zeros(3), 2.0 * case.site.normal, np.array([1.0, 2.0, 3.0])):
        plane = guide_plane(replace(case, position_m=above, velocity_m_s=velocity))
        frame = np.stack([plane.e_x, plane.e_y, plane.e_z])
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), rtol=0, atol=1e-12)
        assert not plane.blocked
    assert np.isnan(guide_plane(replace(case, position_m=above, velocity_m_s=np.zeros(3))).velocity_angle_rad)


def test_site_beyond_the_starts_radius_is_bounded_by_distance():
    case = lumpy_case()
    facet = int(np.argmax(facet_centroids(case.asteroid.mesh)[:, 0]))
    case = replace(case, site=facet_site(case.asteroid.mesh, facet), position_m=np.array([0.0, 9000.0, 0.0]))
    plane = guide_plane(case)
    bounds = alpha_bounds(case, plane, case.site.position_m)
    assert bounds.greatest_by == "start_distance" and bounds.greatest == plane.distance_m


def test_paper_case_has_the_angles_of_its_geometry(reference_shapes):
    """gamma 79.5 and gamma_s 2.15 degrees; the printed eq 16 would give -68 km or, projected, -73 km."""
    case = paper_case(paper_mesh(reference_shapes))
    plane = guide_plane(case)
    assert plane.blocked
    assert np.degrees(plane.velocity_angle_rad) == pytest.approx(79.48, abs=0.01)
    assert np.degrees(plane.tangent_angle_rad) == pytest.approx(2.151, abs=0.001)
    bounds = alpha_bounds(case, plane, case.site.position_m)
    assert bounds.least_by == "clearance" and bounds.greatest_by == "start_radius"
    assert bounds.greatest == pytest.approx(30475.0, abs=1.0)
