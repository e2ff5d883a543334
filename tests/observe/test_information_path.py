"""Whole information-driven landings: what is gained, what is kept, what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from information_samples import sensor, small_case
from numpy.testing import assert_allclose, assert_array_equal

from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.observe.covariance import sigma_along
from landing_cli.observe.information import most_informative_path
from landing_cli.observe.observed import Path
from landing_cli.observe.pareto import front_about
from landing_cli.observe.records import InformationOptions, ObserveCase
from landing_cli.observe.transcription import least_energy_path
from landing_cli.observe.visibility import seen_along

NARROW = sensor(half_field_of_view_rad=np.radians(30.0))


def least(case: ObserveCase) -> Path:
    return least_energy_path(case, 600.0, None, 120)


def cost(case: ObserveCase, path: Path, unit: Path, weight: float) -> float:
    sigma = sigma_along(case, path, seen_along(case, path)).mean_m
    return path.performance_index_m2_s3 / unit.performance_index_m2_s3 + weight * np.log(sigma)


@pytest.fixture(scope="module")
def narrow() -> tuple[ObserveCase, Path]:
    case = small_case(sensor=NARROW)
    return case, least(case)


def test_the_objective_falls_below_that_of_the_least_energy_path(narrow: Any) -> None:
    case, start = narrow
    path = most_informative_path(case, start, InformationOptions(0.1, 4))
    assert path.status == "planned", path.message
    assert cost(case, path, start, 0.1) < cost(case, start, start, 0.1) - 0.05
    assert path.performance_index_m2_s3 > start.performance_index_m2_s3
    assert_array_equal(path.t_s, start.t_s)
    assert_allclose(path.position_m[[0, -1]], start.position_m[[0, -1]], rtol=0, atol=1e-9)


def test_the_answer_is_a_minimum_under_the_true_limits(narrow: Any) -> None:
    """Of the splines nearby, hardly any has less J/J0 + lambda log(sigma), and none much less."""
    from landing_cli.observe.information import best_spline, hard_mean_sigma
    from landing_cli.observe.information_program import (
        energy,
        knots_of,
        spline_flight,
        thrust_with_slopes,
    )

    case, start = narrow
    flight = spline_flight(case, 600.0, 4)
    best, _ = best_spline(flight, [knots_of(flight, start)], start, 0.1)

    def value(knots: np.ndarray) -> float:
        J, _, _ = energy(flight, thrust_with_slopes(flight, knots))
        return J / start.performance_index_m2_s3 + 0.1 * np.log(hard_mean_sigma(flight, knots))

    here = value(best.knots_m)
    assert_allclose(here, best.cost(0.1, start.performance_index_m2_s3), rtol=1e-12)
    rng = np.random.default_rng(7)
    others = [value(best.knots_m + s * rng.normal(size=(4, 3))) for s in (0.1, 1.0, 5.0) for _ in range(10)]
    assert min(others) > here - 2e-3
    assert np.mean(others) > here


def test_no_weight_is_the_least_energy(narrow: Any) -> None:
    case, start = narrow
    path = most_informative_path(case, start, InformationOptions(0.0, 6))
    excess = path.performance_index_m2_s3 / start.performance_index_m2_s3 - 1.0
    assert -1e-9 < excess < 1e-5
    assert np.abs(path.position_m - start.position_m).max() < 0.2


def test_another_start_never_makes_it_worse(narrow: Any) -> None:
    case, start = narrow
    alone = most_informative_path(case, start, InformationOptions(0.5, 4))
    bent = replace(start, position_m=start.position_m + 0.0)
    bump = np.sin(np.pi * start.t_s / start.tof_s)[:, None] * (25.0 * case.frame.axes[0])
    bent = replace(bent, position_m=start.position_m + bump)
    both = most_informative_path(case, start, InformationOptions(0.5, 4), [bent])
    assert cost(case, both, start, 0.5) <= cost(case, alone, start, 0.5) + 1e-6


def test_the_same_case_gives_the_same_bytes(narrow: Any) -> None:
    case, start = narrow
    paths = [most_informative_path(case, start, InformationOptions(0.1, 3)) for _ in range(2)]
    assert paths[0].acceleration_m_s2.tobytes() == paths[1].acceleration_m_s2.tobytes()


def test_more_weight_buys_less_sigma_for_more_energy(narrow: Any) -> None:
    case, start = narrow
    found = [most_informative_path(case, start, InformationOptions(w, 4)) for w in (0.02, 0.1, 0.4)]
    sigmas = [sigma_along(case, path, seen_along(case, path)).mean_m for path in found]
    assert all(np.diff(sigmas) < 0.0)
    assert all(np.diff([path.performance_index_m2_s3 for path in found]) > 0.0)


def test_thrust_and_clearance_are_kept() -> None:
    free_case = small_case(sensor=NARROW)
    start = least(free_case)
    free = most_informative_path(free_case, start, InformationOptions(0.1, 4))
    bound = small_case(
        sensor=NARROW,
        spacecraft=Spacecraft(500.0, 0.97 * free.peak_thrust_n, 300.0),
        clearance_m=free.clearance_min_m + 1.0,
        clearance_free_m=20.0,
    )
    path = most_informative_path(bound, start, InformationOptions(0.1, 4))
    assert path.status == "planned", path.message
    assert path.peak_thrust_n <= 0.97 * free.peak_thrust_n * (1.0 + 1e-9)
    assert path.clearance_min_m >= free.clearance_min_m + 1.0 - 0.01
    assert cost(bound, path, start, 0.1) > cost(bound, free, start, 0.1)


def test_the_glide_slope_is_kept() -> None:
    free_case = small_case(sensor=NARROW)
    start = least(free_case)
    free = most_informative_path(free_case, start, InformationOptions(0.01, 4))
    offset = free_case.frame.to_site(free_case.position_m)
    first = np.arccos(offset[2] / np.linalg.norm(offset))
    half_angle = 0.5 * (first + free.glide_slope_max_rad)
    assert half_angle > first + np.radians(1.0)
    bound = small_case(sensor=NARROW, glide_slope_half_angle_rad=half_angle)
    path = most_informative_path(bound, start, InformationOptions(0.01, 4))
    assert path.status == "planned", path.message
    assert path.glide_slope_max_rad <= half_angle + 1e-5
    assert path.glide_slope_max_rad > half_angle - np.radians(0.1)


def test_too_little_thrust_is_infeasible() -> None:
    case = small_case(sensor=NARROW)
    start = least(case)
    weak = replace(case, spacecraft=Spacecraft(500.0, 0.5 * start.peak_thrust_n, 300.0))
    path = most_informative_path(weak, start, InformationOptions(0.1, 4))
    assert path.status == "infeasible"
    assert "violation" in path.message


def test_the_front_keeps_within_each_energy(narrow: Any) -> None:
    case, start = narrow
    J0 = start.performance_index_m2_s3
    bounds = [1.08 * J0, 1.001 * J0, 0.9 * J0]
    front = front_about(case, start, bounds, 3)
    (rich, weight), (poor, less), (none, zero) = (front.within(bound) for bound in bounds)
    assert 1.001 * J0 < rich.performance_index_m2_s3 <= 1.08 * J0
    assert J0 < poor.performance_index_m2_s3 <= 1.001 * J0
    assert weight > less > 0.0
    assert none is start and zero == 0.0
    rich_sigma, poor_sigma, start_sigma = (
        sigma_along(case, path, seen_along(case, path)).mean_m for path in (rich, poor, start)
    )
    assert rich_sigma < poor_sigma < start_sigma
    assert front.energy_for(rich_sigma * 1.0001) <= rich.performance_index_m2_s3 * (1.0 + 1e-6)
    assert front.energy_for(0.0) == np.inf
