"""Bezier curves against scipy's, finite differences and their boundary conditions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BPoly

from landing_cli.flight.bezier_curve import (
    bernstein,
    bezier_basis,
    curve_jerks,
    curve_states,
    first_control_points,
    last_control_points,
)

TAU = np.linspace(0.0, 1.0, 41)


@pytest.mark.parametrize("degree", [5, 7, 9, 14])
def test_curve_and_derivatives_are_those_of_scipy(degree):
    points = np.random.default_rng(degree).normal(size=(degree + 1, 3)) * 1e4
    t_f = 2000.0
    oracle = BPoly(points[:, None, :], [0.0, t_f])
    states = (*curve_states(points, t_f, TAU), curve_jerks(points, t_f, TAU))
    for order, found in enumerate(states):
        expected = oracle.derivative(order)(TAU * t_f) if order else oracle(TAU * t_f)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_bernstein_polynomials_are_a_partition_of_one_and_integrate_evenly():
    tau, weights = np.polynomial.legendre.leggauss(8)
    for degree in range(2, 15):
        basis = bernstein(degree, 0.5 * (tau + 1.0))
        np.testing.assert_allclose(basis.sum(axis=1), 1.0, rtol=1e-14)
        np.testing.assert_allclose(0.5 * weights @ basis, 1.0 / (degree + 1), rtol=1e-13)


def test_derivative_basis_annihilates_lower_polynomials():
    """Control points even along a line give a constant velocity (linear precision)."""
    line = np.linspace(0.0, 1.0, 8)[:, None] * [3.0, -2.0, 5.0]
    np.testing.assert_allclose(bezier_basis(7, TAU, 1) @ line, np.tile([3.0, -2.0, 5.0], (41, 1)), rtol=1e-13)
    assert np.abs(bezier_basis(7, TAU, 2) @ line).max() < 1e-12


@pytest.mark.parametrize("degree", [5, 7, 12])
def test_boundary_conditions_hold(degree):
    rng = np.random.default_rng(2)
    start, end = rng.normal(size=(2, 3, 3)) * [[1e4], [3.0], [1e-3]]
    first = first_control_points(degree, 1800.0, *start)
    last = last_control_points(degree, 1800.0, *end)
    middle = rng.normal(size=(degree - 5, 3)) * 1e4
    r, v, a = curve_states(np.concatenate([first, middle, last]), 1800.0, [0.0, 1.0])
    for found, expected in zip((r, v, a), np.swapaxes([start, end], 0, 1), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-11)
