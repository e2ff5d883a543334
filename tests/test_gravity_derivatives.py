"""Every derivative of every model against finite differences of the function below it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from gravity_helpers import FIELDS, points_around
from kernel_calls import from_python

from landing_cli.body.gravity import kernels
from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.field_values import accelerations, gradients, potentials

acceleration_and_gradient = from_python(kernels.acceleration_and_gradient)
curvature = from_python(kernels.curvature)
gradient = from_python(kernels.gradient)

POINTS = points_around(450.0, 12)
DIRECTION = np.array([0.3, -1.2, 0.7])


def slope(
    values: Callable[[np.ndarray], np.ndarray], points: np.ndarray, direction: np.ndarray
) -> np.ndarray:
    """Central differences of sixth order, step 1 m."""
    h = 1.0
    weights = {1: 3.0 / 4.0, 2: -3.0 / 20.0, 3: 1.0 / 60.0}
    terms = [
        w * (values(points + k * h * direction) - values(points - k * h * direction))
        for k, w in weights.items()
    ]
    return sum(terms) / h


def tensor(six: tuple[float, ...]) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def relative(value: np.ndarray, expected: np.ndarray) -> float:
    return float(np.abs(value - expected).max() / np.abs(expected).max())


@pytest.fixture(params=FIELDS.values(), ids=FIELDS.keys())
def field(request: pytest.FixtureRequest) -> GravityField:
    return request.param


def test_acceleration_is_the_gradient_of_the_potential(field: GravityField) -> None:
    numerical = np.stack([slope(lambda p: potentials(field, p), POINTS, e) for e in np.eye(3)], axis=1)
    assert relative(accelerations(field, POINTS), numerical) < 5e-12


def test_gradient_is_the_slope_of_the_acceleration(field: GravityField) -> None:
    numerical = np.stack([slope(lambda p: accelerations(field, p), POINTS, e) for e in np.eye(3)], axis=2)
    assert relative(gradients(field, POINTS), numerical) < 4e-12


def test_curvature_is_the_slope_of_the_gradient(field: GravityField) -> None:
    kind, params = field.kind, field.params
    analytic = np.array([tensor(curvature(kind, params, *p, *DIRECTION)) for p in POINTS])
    numerical = slope(lambda p: gradients(field, p), POINTS, DIRECTION)
    assert relative(analytic, numerical) < 5e-11


def test_curvature_is_linear_in_the_direction(field: GravityField) -> None:
    args = (field.kind, field.params, *POINTS[0])
    by_axis = [np.array(curvature(*args, *axis)) for axis in np.eye(3)]
    along = np.array(curvature(*args, *DIRECTION))
    assert relative(along, DIRECTION @ np.array(by_axis)) < 1e-13


def test_joint_evaluation_equals_the_separate_ones(field: GravityField) -> None:
    for p in POINTS:
        args = (field.kind, field.params, *p)
        joint = np.array(acceleration_and_gradient(*args))
        assert relative(joint[:3], np.array(kernels.acceleration(*args))) < 1e-14
        np.testing.assert_array_equal(joint[3:], gradient(*args))


def test_potential_is_harmonic_outside(field: GravityField) -> None:
    for p in POINTS:
        args = (field.kind, field.params, *p)
        hessian, third = np.array(gradient(*args)), np.array(curvature(*args, *DIRECTION))
        assert abs(hessian[:3].sum()) < 3e-14 * np.abs(hessian).max()
        assert abs(third[:3].sum()) < 2e-14 * np.abs(third).max()


def test_every_model_tends_to_a_point_mass(field: GravityField) -> None:
    gm = 18.0 if "DIPOLE" in field.kind.name else 5.0
    far = points_around(1e6, 5)
    np.testing.assert_allclose(potentials(field, far), gm / 1e6, rtol=1e-7, atol=0)
    np.testing.assert_allclose(accelerations(field, far), -gm * far / 1e18, rtol=1e-3, atol=3e-7 * gm / 1e12)
