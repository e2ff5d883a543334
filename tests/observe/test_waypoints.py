"""The Bezier curve's waypoints against de Casteljau, and what their timing costs in a uniform field."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from solver_samples import INNER_M, potato_case

from landing_cli.observe.records import SteeringOptions, WaypointTiming
from landing_cli.observe.waypoints import curve_points, equal_time_waypoints, waypoints_of

START, TOF = np.array([-60.0, 70.0]), 800.0
VELOCITY = np.array([0.05, -0.11])


def de_casteljau(points: np.ndarray, share: float) -> np.ndarray:
    while len(points) > 1:
        points = (1.0 - share) * points[:-1] + share * points[1:]
    return points[0]


def spline_energy(count: int, timing: WaypointTiming, velocity: np.ndarray = VELOCITY) -> float:
    """Integral of r''r'' of the clamped cubic spline: the optimum through the waypoints without gravity."""
    t, points = equal_time_waypoints(curve_points(INNER_M, START, velocity, TOF, timing), TOF, count)
    times = np.concatenate([[0.0], t, [TOF]])
    ends = ((1, velocity), (1, np.zeros(2)))
    spline = CubicSpline(times, np.vstack([START, points, np.zeros(2)]), bc_type=ends)
    a = spline(times, 2)
    squares = (a[:-1] ** 2 + a[:-1] * a[1:] + a[1:] ** 2).sum(axis=1) / 3.0
    return float(np.diff(times) @ squares)


@pytest.mark.parametrize("timing", ["paper", "velocity_matched"])
def test_waypoints_lie_on_the_curve_at_equal_times(timing: WaypointTiming) -> None:
    case = potato_case()
    found = waypoints_of(case, INNER_M, TOF, SteeringOptions(waypoints=3, timing=timing))
    np.testing.assert_allclose(found.t_s, [200.0, 400.0, 600.0], rtol=1e-15, atol=0)
    expected = [de_casteljau(found.curve_m, share) for share in (0.25, 0.5, 0.75)]
    np.testing.assert_allclose(found.position_m, expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.curve_m[0], START, rtol=0, atol=1e-10)
    np.testing.assert_array_equal(found.curve_m[-1], [0.0, 0.0])


def test_the_papers_curve_has_the_control_points_of_eq_10() -> None:
    curve = curve_points(INNER_M, START, VELOCITY, TOF, "paper")
    np.testing.assert_array_equal(curve, [START, *INNER_M, [0.0, 0.0]])


def test_the_matched_curve_has_the_velocities_of_the_ends() -> None:
    curve = curve_points(INNER_M, START, VELOCITY, TOF, "velocity_matched")
    h = 1e-4
    first = (de_casteljau(curve, h) - START) / (h * TOF)
    last = -de_casteljau(curve, 1.0 - h) / (h * TOF)
    np.testing.assert_allclose(first, VELOCITY, rtol=0, atol=1e-3)
    np.testing.assert_allclose(last, 0.0, rtol=0, atol=1e-3)


def test_nested_sets_share_their_waypoints() -> None:
    curve = curve_points(INNER_M, START, VELOCITY, TOF, "paper")
    few, many = (equal_time_waypoints(curve, TOF, m)[1] for m in (3, 7))
    np.testing.assert_allclose(many[1::2], few, rtol=0, atol=1e-13)


def test_no_waypoints_are_none() -> None:
    found = waypoints_of(potato_case(), INNER_M, TOF, SteeringOptions(waypoints=0))
    assert found.t_s.shape == (0,) and found.position_m.shape == (0, 2)


def test_the_papers_timing_costs_more_with_every_waypoint() -> None:
    """dJ/dm -> 2 sqrt(3) (|dv0|^2 + |dvf|^2) / t_f, reached to 1e-11 at m = 63."""
    curve = curve_points(INNER_M, START, VELOCITY, TOF, "paper")
    degree = len(curve) - 1
    clash = [degree * (curve[1] - curve[0]) / TOF - VELOCITY, degree * (curve[-1] - curve[-2]) / TOF]
    law = 2.0 * np.sqrt(3.0) * sum(dv @ dv for dv in clash) / TOF
    assert spline_energy(64, "paper") - spline_energy(63, "paper") == pytest.approx(law, rel=1e-9)


def test_matched_timing_costs_the_same_with_any_number() -> None:
    weight = (5e-3) ** 2 * TOF  # what hovering in a field of 5 mm/s2 adds
    costs = np.array([spline_energy(m, "velocity_matched", np.zeros(2)) + weight for m in range(5, 40)])
    assert np.ptp(costs) < 1e-4 * costs.min()
