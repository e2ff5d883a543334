"""Information and covariance against the measurement equations, complex steps and closed forms."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import filter_oracles as oracle
import numpy as np
import pytest
from information_samples import sensor, small_case
from numpy.testing import assert_allclose

from landing_cli.observe.covariance import mean_sigma_with_slopes, position_sigmas, state_transitions
from landing_cli.observe.measurements import (
    hard_sight,
    information_along,
    information_slopes,
    soft_sight,
)
from landing_cli.observe.records import ObserveCase, Prior

TIMES = np.array([0.0, 10.0, 20.0, 30.0, 40.0, 47.0])
SENSORS = [
    sensor(),
    sensor(kind="camera"),
    sensor(boresight="site"),
    sensor(kind="camera", boresight="site", half_field_of_view_rad=np.radians(30.0)),
]


def path(case: ObserveCase) -> np.ndarray:
    """Six positions between the start and the site."""
    share = np.linspace(0.0, 0.9, len(TIMES))[:, None]
    straight = case.position_m + share * (case.frame.origin_m - case.position_m)
    return straight + np.random.default_rng(1).normal(size=(len(TIMES), 3))


def opened(case: ObserveCase) -> np.ndarray:
    return np.random.default_rng(2).random((len(TIMES), len(case.landmarks.name))) < 0.8


@pytest.mark.parametrize("kind", ["lidar", "camera"])
def test_information_is_that_of_the_measurement_equations(kind: Any) -> None:
    case = small_case(sensor=sensor(kind=kind))
    positions, counted = path(case), opened(small_case())
    found = information_along(hard_sight(case, counted), positions)
    for t in range(len(TIMES)):
        expected = np.zeros((3, 3))
        for j in np.flatnonzero(counted[t]):
            H = oracle.partials(case, positions[t], j)
            noise = np.array([case.sensor.range_sigma_m, *2 * [case.sensor.angle_sigma_rad]])
            rows = H / noise[:, None] if kind == "lidar" else H[1:] / noise[1:, None]
            expected += rows.T @ rows
        assert_allclose(found[t], expected, rtol=1e-11, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("eye", SENSORS, ids=lambda eye: f"{eye.kind}-{eye.boresight}")
def test_slopes_of_the_mean_sigma_are_those_of_complex_steps(eye: Any) -> None:
    case, softness = small_case(sensor=eye), 0.2
    positions, seen = path(case), opened(small_case())
    transitions = state_transitions(case.asteroid, TIMES, positions, TIMES)

    def objective(points: Any) -> Any:
        told = [
            oracle.information(case, p, row * oracle.weights(case, p, softness))
            for p, row in zip(points, seen, strict=True)
        ]
        return oracle.mean_sigma(case, TIMES, transitions, told)

    sight = soft_sight(case, seen, softness)
    mean, by_information = mean_sigma_with_slopes(
        case.prior, TIMES, transitions, information_along(sight, positions)
    )
    slopes = information_slopes(sight, positions, by_information)
    assert_allclose(mean, objective(positions).real, rtol=1e-9)
    expected = np.zeros_like(slopes)
    for t, a in np.ndindex(slopes.shape):
        moved = positions.astype(complex)
        moved[t, a] += 1e-30j
        expected[t, a] = objective(moved).imag / 1e-30
    assert_allclose(slopes, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


def test_weights_harden_into_the_limits() -> None:
    case = small_case()
    positions = path(case)
    everything = np.ones((len(TIMES), len(case.landmarks.name)), dtype=bool)
    offset = case.landmarks.position_m - positions[:, None]
    rho = np.linalg.norm(offset, axis=2)
    u = offset / rho[..., None]
    eye = case.sensor
    seen = (rho > eye.range_min_m) & (rho < eye.range_max_m)
    seen &= u @ -case.frame.axes[2] > np.cos(eye.half_field_of_view_rad)
    seen &= -(u * case.landmarks.normal).sum(axis=2) > np.cos(eye.emission_max_rad)
    assert seen.any() and not seen.all()
    hard = information_along(hard_sight(case, seen), positions)
    soft = information_along(soft_sight(case, everything, 1e-7), positions)
    assert_allclose(soft, hard, rtol=1e-12, atol=1e-12 * np.abs(hard).max())


def test_without_landmarks_the_prior_flows_with_the_dynamics() -> None:
    case = small_case(prior=Prior(3.0, 0.1))
    positions = path(case)
    transitions = state_transitions(case.asteroid, TIMES, positions, TIMES)
    nothing = np.zeros((len(TIMES), 3, 3))
    sigmas = position_sigmas(case.prior, TIMES, transitions, nothing)
    phi = np.eye(6)
    prior = np.diag([9.0] * 3 + [0.01] * 3)
    for t in range(len(TIMES)):
        phi = transitions[t - 1] @ phi if t else phi
        assert_allclose(sigmas[t] ** 2, np.trace((phi @ prior @ phi.T)[:3, :3]), rtol=1e-13)


def test_transitions_are_the_differential_flow() -> None:
    """Against neighbouring flights of an independent integrator, without thrust."""
    from scipy.integrate import solve_ivp

    case = small_case()
    gm, w, h = case.asteroid.gm_m3_s2, case.asteroid.rotation_rate_rad_s, 10.0

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        r, v = y[:3], y[3:]
        a = -gm * r / np.linalg.norm(r) ** 3
        return np.concatenate([v, a + np.array([w * (2 * v[1] + w * r[0]), w * (-2 * v[0] + w * r[1]), 0.0])])

    start = np.concatenate([case.position_m, [0.02, -0.01, 0.03]])
    flown = solve_ivp(rates, (0, h), start, rtol=1e-13, atol=1e-10, dense_output=True)
    nodes = np.linspace(0.0, h, 5)
    phi = state_transitions(case.asteroid, nodes, flown.sol(nodes)[:3].T, np.array([0.0, h]))[0]
    for column, step in enumerate([1.0] * 3 + [0.1] * 3):
        ends = [
            solve_ivp(rates, (0, h), start + sign * step * np.eye(6)[column], rtol=1e-13, atol=1e-10).y[:, -1]
            for sign in (1, -1)
        ]
        slope = (ends[0] - ends[1]) / (2.0 * step)
        assert_allclose(phi[:, column], slope, rtol=0.0, atol=2e-8 * np.abs(slope).max())


def test_one_range_and_direction_in_closed_form() -> None:
    """One landmark, one time: the prior's and the measurement's variances add as inverses."""
    case = small_case(prior=Prior(4.0, 0.1))
    marks = case.landmarks
    single = replace(
        case,
        landmarks=replace(
            marks,
            position_m=marks.position_m[:1],
            normal=marks.normal[:1],
            diameter_m=marks.diameter_m[:1],
            name=marks.name[:1],
            facet=marks.facet[:1],
        ),
    )
    position = case.position_m[None]
    rho = np.linalg.norm(single.landmarks.position_m[0] - position[0])
    told = information_along(hard_sight(single, np.ones((1, 1), dtype=bool)), position)
    sigma = position_sigmas(single.prior, np.zeros(1), np.zeros((0, 6, 6)), told)
    along = 1.0 / (1.0 / 16.0 + 1.0 / 0.25)
    across = 1.0 / (1.0 / 16.0 + 1.0 / (rho * 2e-3) ** 2)
    assert_allclose(sigma**2, along + 2.0 * across, rtol=1e-12)
