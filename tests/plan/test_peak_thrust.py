"""Peak thrust at its stationary points against finite differences and dense samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from kernel_calls import from_python
from planning_samples import lumpy_case

from landing_cli.flight.acceleration_control import thrust_accelerations
from landing_cli.flight.bezier_curve import curve_states
from landing_cli.flight.legs import BezierLeg
from landing_cli.flight.peak_thrust import (
    bezier_point as bezier_point_part,
    flown_curve,
    peak_acceleration,
    thrust_slope as thrust_slope_part,
)
from landing_cli.plan.guide_candidates import curve_of, prepare_search
from landing_cli.plan.records import BezierOptions

bezier_point = from_python(bezier_point_part)
thrust_slope = from_python(thrust_slope_part)

W = 3.3117e-4


def legs() -> list[BezierLeg]:
    rng = np.random.default_rng(4)
    found = []
    for polyhedron in (False, True):
        search = prepare_search(lumpy_case(195.0, polyhedron), BezierOptions(samples=21))
        found += [curve_of(search, *rng.uniform(2000, 15000, 2)) for _ in range(2 if polyhedron else 8)]
    return found


LEGS = legs()


def test_point_is_that_of_the_basis():
    points = np.random.default_rng(0).normal(size=(8, 3))
    tau = np.array([0.0, 1e-9, 0.3, 0.5, 0.5000001, 0.9, 1.0])
    found = np.array([bezier_point(points, 7, t) for t in tau])
    np.testing.assert_allclose(found, curve_states(points, 1.0, tau)[0], rtol=0, atol=1e-14)


@pytest.mark.parametrize("ve", [np.inf, 1471.0])
def test_slope_has_the_sign_and_size_of_a_finite_difference(ve):
    for leg in LEGS:
        curve = flown_curve(leg, W, ve)
        for tau in (0.1, 0.37, 0.62, 0.95):
            size, slope = thrust_slope(curve, tau)
            h = 1e-5
            u = thrust_accelerations(leg, (tau + np.array([-h, 0.0, h])) * leg.duration_s, W)
            level = np.linalg.norm(u, axis=1)
            assert size == pytest.approx(level[1], rel=1e-11)
            rate = (level[2] - level[0]) / (2 * h * leg.duration_s)
            expected = level[1] * rate - level[1] ** 3 / ve
            scale = level[1] * max(abs(rate), level[1] / leg.duration_s)
            assert slope == pytest.approx(expected, abs=2e-5 * scale)


@pytest.mark.parametrize("ve", [np.inf, 1471.0, 150.0])
def test_peak_is_that_of_dense_samples(ve):
    for leg in LEGS:
        t = np.linspace(0.0, leg.duration_s, 4001 if leg is LEGS[-1] or leg is LEGS[-2] else 40001)
        u = np.linalg.norm(thrust_accelerations(leg, t, W), axis=1)
        spent = np.concatenate([[0.0], np.cumsum(0.5 * (u[1:] + u[:-1]))]) * (t[1] - t[0])
        level = u * np.exp(-spent / ve)
        peak, when = peak_acceleration(leg, W, ve)
        assert peak == pytest.approx(level.max(), rel=4e-6)
        assert peak >= level.max() * (1 - 2e-6 if ve < np.inf else 1 - 1e-13)
        at = np.linalg.norm(thrust_accelerations(leg, np.array([when]), W))
        assert at * np.exp(-np.interp(when, t, spent) / ve) == pytest.approx(peak, rel=4e-6)


def test_a_peak_between_samples_is_found():
    """A stationary top of a constant-mass curve is at least as high as a million samples, to rounding."""
    leg = LEGS[0]
    t = np.linspace(0.0, leg.duration_s, 1_000_001)
    level = np.linalg.norm(thrust_accelerations(leg, t, W), axis=1).max()
    peak, _ = peak_acceleration(leg, W)
    assert level <= peak * (1 + 1e-14) and peak == pytest.approx(level, rel=1e-10)
    slower = replace(leg, duration_s=1.1 * leg.duration_s)
    assert peak_acceleration(slower, W)[0] < peak
