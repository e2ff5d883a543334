"""The interpolated field against the polyhedron that it stands for."""

from __future__ import annotations

import numpy as np
import pytest
from gravity_helpers import POTATO, points_around

from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.field_values import (
    accelerations,
    accelerations_and_gradients,
    gradients,
    potentials,
)
from landing_cli.body.gravity.interpolated import (
    FARTHEST,
    Cube,
    InterpolatedField,
    interpolated_field,
    is_sound,
    polyhedron_of,
)
from landing_cli.body.gravity.kernels import curvature
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.body.mesh import facet_centroids, facet_normals
from landing_cli.errors import InputRefused

EXACT = polyhedron_field(POTATO.vertices, POTATO.faces, 5.0)
RADIUS = float(np.linalg.norm(POTATO.vertices, axis=1).max())
CENTROIDS, NORMALS = facet_centroids(POTATO), facet_normals(POTATO)


@pytest.fixture(scope="module")
def fitted() -> InterpolatedField:
    return interpolated_field(EXACT, most_near=60)


def points_everywhere(count: int, seed: int = 1) -> np.ndarray:
    """Inside, along the surface on both sides, and out to three radii."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    free = directions * RADIUS * 3.0 * rng.random((count, 1))
    facets = rng.integers(len(CENTROIDS), size=count)
    beside = CENTROIDS[facets] + NORMALS[facets] * rng.uniform(-20.0, 20.0, (count, 1))
    return np.concatenate([free, beside])


def wrong(values: np.ndarray, exact: np.ndarray) -> float:
    """Largest error, of the value's size at its largest."""
    axes = tuple(range(1, values.ndim))
    return float(np.sqrt(((values - exact) ** 2).sum(axis=axes)).max() / np.abs(exact).max())


def test_the_field_is_the_polyhedrons_within_the_measured_error(fitted: InterpolatedField) -> None:
    assert fitted.field.kind is GravityKind.INTERPOLATED
    assert 0.0 < fitted.error < 3e-4 and 0.0 < fitted.gradient_error < 1e-2
    assert fitted.pieces > 100 and fitted.near < 60
    points = points_everywhere(1500)
    g, G = accelerations_and_gradients(fitted.field, points)
    exact_g, exact_G = accelerations_and_gradients(EXACT, points)
    assert wrong(g, exact_g) < 2.0 * fitted.error
    assert wrong(G, exact_G) < 2.0 * fitted.gradient_error
    assert (g != exact_g).any(axis=1).mean() > 0.9  # and it is the fit that answers, not the polyhedron
    np.testing.assert_array_equal(G, G.transpose(0, 2, 1))


def test_a_farther_reach_gives_a_smaller_error() -> None:
    cube = Cube(CENTROIDS[7], 60.0)
    coarse, fine = (interpolated_field(EXACT, cube, reach, 40) for reach in (1.0, 4.0))
    assert coarse.error > 100.0 * fine.error > 0.0
    assert fine.error < 1e-6


def test_on_a_facet_the_near_ones_are_exact(fitted: InterpolatedField) -> None:
    """The polyhedron's gradient jumps at the surface; the fit jumps with it."""
    step = 1e-6
    for points in (CENTROIDS - step * NORMALS, CENTROIDS + step * NORMALS):
        found, exact = gradients(fitted.field, points), gradients(EXACT, points)
        assert wrong(found, exact) < 2.0 * fitted.gradient_error


def test_outside_the_cube_the_polyhedron_answers(fitted: InterpolatedField) -> None:
    points = points_around(1.8 * FARTHEST * RADIUS, 20)
    np.testing.assert_array_equal(accelerations(fitted.field, points), accelerations(EXACT, points))
    np.testing.assert_array_equal(gradients(fitted.field, points), gradients(EXACT, points))


def test_the_potential_is_the_polyhedrons(fitted: InterpolatedField) -> None:
    points = points_everywhere(20)
    np.testing.assert_array_equal(potentials(fitted.field, points), potentials(EXACT, points))
    np.testing.assert_array_equal(polyhedron_of(fitted.field).params, EXACT.params)


def test_the_gradient_is_the_slope_of_the_acceleration(fitted: InterpolatedField) -> None:
    """By central differences within one piece: the far part is no gradient by itself, their sum nearly is."""
    place, h = 1.4 * CENTROIDS[11] + np.array([0.31, -0.22, 0.07]), 1e-2
    G = gradients(fitted.field, [place])[0]
    for axis in range(3):
        e = h * np.eye(3)[axis]
        slope = (accelerations(fitted.field, [place + e]) - accelerations(fitted.field, [place - e]))[0] / (
            2 * h
        )
        np.testing.assert_allclose(
            slope[: axis + 1], G[: axis + 1, axis], rtol=0, atol=1e-8 * np.abs(G).max()
        )


def test_third_derivatives_are_the_slope_of_the_gradient(fitted: InterpolatedField) -> None:
    field, along = fitted.field, np.array([0.3, -0.2, 0.9])
    for place in (1.5 * CENTROIDS[11], CENTROIDS[40] + 15.0 * NORMALS[40], 0.5 * CENTROIDS[3]):
        found = np.array(curvature(field.kind, field.params.copy(), *place, *along))
        ahead, behind = gradients(field, [place + 1e-3 * along, place - 1e-3 * along])
        slope = (ahead - behind)[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]] / 2e-3
        np.testing.assert_allclose(found, slope, rtol=0, atol=1e-5 * np.abs(found).max())


def test_its_mass_can_be_scaled_by_its_coefficients(fitted: InterpolatedField) -> None:
    """What lies between the two places that begin the parameters is proportional to GM."""
    params = fitted.field.params.copy()
    polyhedron, coefficients = int(params[0]), int(params[1])
    params[coefficients:polyhedron] *= 1.5
    params[polyhedron + 2] *= 1.5
    points = points_everywhere(20)
    scaled = GravityField(GravityKind.INTERPOLATED, params)
    np.testing.assert_allclose(
        accelerations(scaled, points), 1.5 * accelerations(fitted.field, points), rtol=1e-12, atol=0
    )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: interpolated_field(point_mass_field(5.0)), "point_mass field is not worth"),
        (lambda: interpolated_field(EXACT, Cube(np.zeros(3), 0.0)), "half side of the cube is 0"),
        (lambda: interpolated_field(EXACT, reach=0.0), "reach is 0"),
    ],
)
def test_what_cannot_be_interpolated_is_refused(make, message: str) -> None:
    with pytest.raises(InputRefused, match=message):
        make()


def test_parameters_that_lead_astray_are_noticed(fitted: InterpolatedField) -> None:
    params = fitted.field.params
    assert is_sound(params)
    root, coefficients = 6, int(params[1])
    leaf = root + int(np.flatnonzero(params[root : root + 200] < 0.0)[0])
    piece = -int(params[leaf])
    for place, value in (
        (0, 0.0),
        (1, 1e9),
        (root, 0.5),
        (root + int(params[root]), 1.0),  # back up the tree
        (leaf, -float(len(params))),
        (piece, 0.0),
        (piece + 1, 1e6),
        (piece + 1, -1.0),
    ):
        broken = params.copy()
        broken[place] = value
        assert not is_sound(broken), (place, value)
    with_near = -params[root : root + 2000][params[root : root + 2000] < 0.0].astype(int)
    crowded = next(p for p in with_near if p < coefficients and params[p + 1] > 0)
    broken = params.copy()
    broken[crowded + 2] = coefficients
    assert not is_sound(broken)
