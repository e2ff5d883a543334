"""Collocation on Legendre-Gauss nodes: exact on polynomials, and equal to scipy where scipy has it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.interpolate import BarycentricInterpolator
from scipy.special import roots_legendre

from landing_cli.optimize.collocation import (
    barycentric_weights,
    differentiation_matrix,
    gauss_span,
    interpolation_matrix,
    legendre_gauss,
)

SIZES = (1, 2, 5, 16, 40)


def polynomial(degree: int) -> Polynomial:
    """A polynomial whose coefficients are fixed but not round."""
    return Polynomial(np.cos(1.0 + np.arange(degree + 1)))


@pytest.mark.parametrize("n", [*SIZES, 120])
def test_nodes_and_weights_are_scipys(n: int) -> None:
    nodes, weights = legendre_gauss(n)
    expected_nodes, expected_weights = roots_legendre(n)
    np.testing.assert_allclose(nodes, expected_nodes, rtol=0, atol=4e-16)
    np.testing.assert_allclose(weights, expected_weights, rtol=2e-11, atol=0)


@pytest.mark.parametrize("n", SIZES)
def test_quadrature_is_exact_to_degree_2n_minus_1_and_not_beyond(n: int) -> None:
    nodes, weights = legendre_gauss(n)
    p = polynomial(2 * n - 1)
    exact = p.integ()(1.0) - p.integ()(-1.0)
    np.testing.assert_allclose(weights @ p(nodes), exact, rtol=2e-14, atol=0)
    if n <= 5:
        beyond = 2.0 / (2 * n + 1)  # of x^(2n)
        assert abs(weights @ nodes ** (2 * n) - beyond) > 1e-3 * beyond


@pytest.mark.parametrize("n", SIZES)
def test_interpolation_reproduces_polynomials_and_nodes(n: int) -> None:
    span, p = gauss_span(n), polynomial(n)
    points = np.concatenate([np.linspace(-1.0, 1.0, 57), span.support])
    np.testing.assert_allclose(span.state_at(points) @ p(span.support), p(points), rtol=2e-13, atol=2e-13)
    assert np.array_equal(interpolation_matrix(span.nodes, span.nodes), np.eye(n))
    q = polynomial(n - 1)
    np.testing.assert_allclose(span.control_at(points) @ q(span.nodes), q(points), rtol=2e-13, atol=2e-13)


@pytest.mark.parametrize("n", [5, 16, 40])
def test_interpolation_is_scipys(n: int) -> None:
    nodes = np.concatenate([[-1.0], legendre_gauss(n)[0]])
    values, points = np.sin(9.0 * nodes), np.linspace(-0.999, 0.999, 83)
    expected = BarycentricInterpolator(nodes, values)(points)
    np.testing.assert_allclose(interpolation_matrix(nodes, points) @ values, expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize("n", SIZES)
def test_derivative_is_exact_on_polynomials(n: int) -> None:
    span, p = gauss_span(n), polynomial(n)
    exact = p.deriv()(span.nodes)
    scale = np.abs(exact).max()
    np.testing.assert_allclose(span.derivative @ p(span.support), exact, rtol=0, atol=2e-13 * n * scale)


def test_derivative_of_a_constant_vanishes() -> None:
    span = gauss_span(60)
    assert np.abs(span.derivative.sum(axis=1)).max() < 1e-11 * np.abs(span.derivative).max()


def test_derivative_converges_spectrally() -> None:
    errors = []
    for n in (8, 16, 32):
        span = gauss_span(n)
        errors.append(
            np.abs(
                span.derivative @ np.exp(np.sin(4.0 * span.support))
                - 4.0 * np.cos(4.0 * span.nodes) * np.exp(np.sin(4.0 * span.nodes))
            ).max()
        )
    assert errors[1] < 0.2 * errors[0]
    assert errors[2] < 2e-3 * errors[1]


@pytest.mark.parametrize("n", [3, 20])
def test_the_end_by_quadrature_is_the_end_of_the_polynomial(n: int) -> None:
    """Benson's terminal condition and extrapolation of the state polynomial are the same number."""
    span = gauss_span(n)
    values = np.cos(3.0 * span.support)
    by_quadrature = values[0] + span.weights @ (span.derivative @ values)
    np.testing.assert_allclose(by_quadrature, (span.state_at([1.0]) @ values)[0], rtol=1e-12, atol=0)


def test_differentiation_on_any_nodes() -> None:
    nodes, p = np.array([-1.0, -0.2, 0.1, 0.7, 2.0]), polynomial(4)
    np.testing.assert_allclose(
        differentiation_matrix(nodes) @ p(nodes), p.deriv()(nodes), rtol=1e-13, atol=1e-13
    )


def test_weights_of_equal_spacing_are_binomial() -> None:
    weights = barycentric_weights(np.arange(6.0))
    np.testing.assert_allclose(weights / weights[0], [1, -5, 10, -10, 5, -1], rtol=1e-13, atol=0)


@pytest.mark.parametrize("n", SIZES)
def test_integral_is_exact_to_degree_n_minus_1(n: int) -> None:
    span, p = gauss_span(n), polynomial(n - 1)
    exact = p.integ()(span.nodes) - p.integ()(-1.0)
    np.testing.assert_allclose(span.integral @ p(span.nodes), exact, rtol=0, atol=1e-13 * np.abs(exact).max())
