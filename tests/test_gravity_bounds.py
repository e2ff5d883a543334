"""The bounds hold over dense samples outside, are tight, and refuse what they cannot bound."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from gravity_helpers import FIELDS, POTATO

from landing_cli.body.gravity.bounds import (
    TOLERANCE,
    _centres,
    _fill_ceilings,
    _sphere_triangles,
    _split,
    largest_acceleration_on_ellipsoid,
    largest_acceleration_outside,
)
from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.field_values import accelerations
from landing_cli.errors import InputRefused

MODELS = [name for name in FIELDS if name != "polyhedron"]
SEMI_AXES = np.array([420.0, 260.0, 200.0])


def directions_around(center: np.ndarray, spread: float, count: int) -> np.ndarray:
    directions = center + spread * np.random.default_rng(2).normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def largest_on(
    field: GravityField, surface: Callable[[np.ndarray], np.ndarray], count: int = 20_000
) -> float:
    """Largest |g| by random search on the surface, closing in on the best direction."""
    directions = directions_around(np.zeros(3), 1.0, count)
    for spread in (0.1, 0.01, 0.001):
        best = directions[np.argmax(sizes(field, surface(directions)))]
        directions = np.vstack([best, directions_around(best, spread, count // 10)])
    return float(sizes(field, surface(directions)).max())


def sizes(field: GravityField, points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(accelerations(field, points), axis=1)


@pytest.mark.parametrize("name", MODELS)
def test_bound_outside_a_sphere_holds_and_is_tight(name: str) -> None:
    radii = np.array([330.0, 500.0, 2000.0])
    bounds = largest_acceleration_outside(FIELDS[name], radii)
    for radius, bound in zip(radii, bounds, strict=True):
        largest = largest_on(FIELDS[name], lambda u, radius=radius: radius * u)
        assert largest <= bound <= largest * (1.0 + TOLERANCE + 1e-5)


@pytest.mark.parametrize("name", MODELS)
def test_bound_outside_an_ellipsoid_holds_and_is_tight(name: str) -> None:
    bound = largest_acceleration_on_ellipsoid(FIELDS[name], SEMI_AXES)
    largest = largest_on(FIELDS[name], lambda u: SEMI_AXES * u)
    assert largest <= bound <= largest * (1.0 + TOLERANCE + 1e-5)


@pytest.mark.parametrize("name", MODELS)
def test_bound_outside_sphere_and_ellipsoid_holds_and_is_tight(name: str) -> None:
    radii = np.array([100.0, 230.0, 300.0, 400.0, 450.0])
    bounds = largest_acceleration_outside(FIELDS[name], radii, SEMI_AXES)
    assert (np.diff(bounds) <= 2.0 * TOLERANCE * bounds[1:]).all()
    for radius, bound in zip(radii, bounds, strict=True):

        def edge_of_region(u: np.ndarray, radius: float = radius) -> np.ndarray:
            ellipsoid = 1.0 / np.linalg.norm(u / SEMI_AXES, axis=1)
            return u * np.maximum(radius, ellipsoid)[:, None]

        largest = largest_on(FIELDS[name], edge_of_region)
        assert largest <= bound <= largest * (1.0 + TOLERANCE + 5e-4)
        assert largest_on(FIELDS[name], lambda u, edge=edge_of_region: 1.01 * edge(u)) < bound


def test_bound_holds_for_the_polyhedron_inside_its_least_ellipsoid() -> None:
    semi_axes = np.array([300.0, 220.0, 180.0])
    bound = largest_acceleration_on_ellipsoid(FIELDS["polyhedron"], semi_axes)
    largest = largest_on(FIELDS["polyhedron"], lambda u: semi_axes * u, 5000)
    assert largest <= bound <= 1.01 * largest


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("semi_axes", [SEMI_AXES, np.full(3, 330.0)], ids=["ellipsoid", "sphere"])
def test_no_point_of_a_patch_exceeds_its_ceiling(name: str, semi_axes: np.ndarray) -> None:
    # small patches too, where the slope decides and the second derivative hardly helps
    coarse = _sphere_triangles()
    field, triangles = FIELDS[name], np.vstack([coarse, _split(_split(_split(coarse[::23])))])
    centres, angles = _centres(triangles)
    at_centre, ceilings, reaches = np.zeros((3, len(triangles)))
    _fill_ceilings(field.kind, field.params, centres, semi_axes, angles, at_centre, ceilings, reaches)
    weights = np.vstack([np.eye(3), np.random.default_rng(4).dirichlet([0.5] * 3, 30)])
    for patch, centre, ceiling, reach in zip(triangles, centres, ceilings, reaches, strict=True):
        directions = weights @ patch
        points = semi_axes * directions / np.linalg.norm(directions, axis=1, keepdims=True)
        assert sizes(field, points).max() <= ceiling
        assert np.linalg.norm(points - semi_axes * centre, axis=1).max() <= reach


def test_point_mass_is_bounded_by_its_closed_form() -> None:
    bounds = largest_acceleration_outside(FIELDS["point_mass"], [100.0, 200.0])
    np.testing.assert_allclose(bounds, 5.0 / np.array([100.0, 200.0]) ** 2, rtol=TOLERANCE * 1.0001, atol=0)


def test_surfaces_that_leave_masses_outside_are_refused() -> None:
    reach = float(np.linalg.norm(POTATO.vertices, axis=1).max())
    for name, radius in (("dipole", 250.0), ("polyhedron", 0.9 * reach)):
        with pytest.raises(InputRefused, match="not enclosed"):
            largest_acceleration_outside(FIELDS[name], [radius])
        with pytest.raises(InputRefused, match="not enclosed"):
            largest_acceleration_on_ellipsoid(FIELDS[name], [150.0, 150.0, 150.0])
    with pytest.raises(InputRefused, match="radius"):
        largest_acceleration_outside(FIELDS["point_mass"], [0.0])
    with pytest.raises(InputRefused, match="semi-axis"):
        largest_acceleration_on_ellipsoid(FIELDS["point_mass"], [1.0, 1.0, -1.0])
