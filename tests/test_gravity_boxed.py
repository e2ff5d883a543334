"""The interpolated field against the polyhedron that it stands for."""

from __future__ import annotations

import numpy as np
import pytest
from gravity_helpers import POTATO, points_around
from kernel_calls import from_python

from landing_cli.body.gravity.boxed import Box, BoxedField, boxed_field
from landing_cli.body.gravity.field import GravityKind
from landing_cli.body.gravity.field_values import (
    accelerations,
    accelerations_and_gradients,
    gradients,
    potentials,
)
from landing_cli.body.gravity.kernels import curvature as curvature_part
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.body.gravity.triangle_boxes import triangles_in_box
from landing_cli.body.mesh import facet_centroids, facet_normals
from landing_cli.errors import InputRefused

curvature = from_python(curvature_part)

EXACT = polyhedron_field(POTATO.vertices, POTATO.faces, 5.0)
FACET = int(np.argmax(facet_centroids(POTATO) @ np.array([0.3, 0.5, 0.8])))
SITE, UP = facet_centroids(POTATO)[FACET], facet_normals(POTATO)[FACET]
TOLERANCE = 1e-7


def box(lower=(-60.0, -40.0, 0.0), upper=(50.0, 70.0, 90.0)) -> Box:
    """Above a facet, its floor in the facet's plane: about two edges wide."""
    across = np.cross(UP, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    return Box(SITE, np.stack([across, np.cross(UP, across), UP]), np.array(lower), np.array(upper))


@pytest.fixture(scope="module")
def fitted() -> BoxedField:
    return boxed_field(EXACT, box(), TOLERANCE)


def points_in_box(count: int, seed: int = 1) -> np.ndarray:
    place = box()
    share = np.random.default_rng(seed).random((count, 3))
    return SITE + (place.lower_m + share * (place.upper_m - place.lower_m)) @ place.axes


def largest_share(values: np.ndarray, exact: np.ndarray) -> float:
    sizes = [np.linalg.norm(a.reshape(len(a), -1), axis=1) for a in (values - exact, exact)]
    return float((sizes[0] / sizes[1]).max())


def test_the_field_is_the_polyhedrons_within_the_measured_error(fitted: BoxedField) -> None:
    assert fitted.field.kind is GravityKind.BOXED
    assert 0.0 < fitted.error < 5.0 * TOLERANCE
    assert fitted.covered > 0.8 and fitted.pieces > 1 and fitted.checked_points == 40 * fitted.pieces
    points = points_in_box(3000)
    g, G = accelerations_and_gradients(fitted.field, points)
    exact_g, exact_G = accelerations_and_gradients(EXACT, points)
    assert largest_share(g, exact_g) < 3.0 * fitted.error
    assert largest_share(G, exact_G) < 5.0 * fitted.gradient_error
    exact_u = potentials(EXACT, points)
    np.testing.assert_allclose(potentials(fitted.field, points), exact_u, rtol=1e-8, atol=0)
    # and it is the fit that answers, not the polyhedron
    assert (g != exact_g).any(axis=1).mean() > 0.8


def test_a_smaller_tolerance_gives_a_smaller_error() -> None:
    coarse, fine = (boxed_field(EXACT, box(), tolerance, 6) for tolerance in (1e-5, 1e-8))
    assert coarse.error > 10.0 * fine.error
    assert coarse.pieces < fine.pieces and coarse.covered > fine.covered


def test_outside_the_box_and_in_the_body_the_polyhedron_answers(fitted: BoxedField) -> None:
    below = SITE - np.outer([1e-3, 5.0], UP)
    points = np.concatenate([points_around(700.0, 20), points_around(50.0, 20), below])
    np.testing.assert_array_equal(accelerations(fitted.field, points), accelerations(EXACT, points))
    np.testing.assert_array_equal(gradients(fitted.field, points), gradients(EXACT, points))
    np.testing.assert_array_equal(potentials(fitted.field, points), potentials(EXACT, points))


def test_third_derivatives_are_the_polyhedrons(fitted: BoxedField) -> None:
    place, along = points_in_box(1)[0], (0.3, -0.2, 0.9)
    found = curvature(fitted.field.kind, fitted.field.params, *place, *along)
    assert found == curvature(EXACT.kind, EXACT.params, *place, *along)


def test_the_fitted_field_is_conservative(fitted: BoxedField) -> None:
    """g is the slope of U, and G that of g, by central differences within one piece."""
    place, h = SITE + 41.3 * UP + np.array([3.1, -2.2, 0.7]), 1e-2
    steps = h * np.eye(3)
    by_u = [(potentials(fitted.field, [place + e]) - potentials(fitted.field, [place - e]))[0] for e in steps]
    g, G = accelerations_and_gradients(fitted.field, [place])
    np.testing.assert_allclose(np.array(by_u) / (2 * h), g[0], rtol=0, atol=1e-9 * np.abs(g).max())
    by_g = [
        (accelerations(fitted.field, [place + e]) - accelerations(fitted.field, [place - e]))[0]
        for e in steps
    ]
    np.testing.assert_allclose(np.array(by_g).T / (2 * h), G[0], rtol=0, atol=1e-7 * np.abs(G).max())
    np.testing.assert_array_equal(G[0], G[0].T)


def test_the_site_itself_can_be_fitted() -> None:
    """The floor lies in the facet's plane; rounding puts the site on either side of it."""
    small = boxed_field(EXACT, box((-5.0, -5.0, 0.0), (5.0, 5.0, 6.0)), TOLERANCE)
    assert small.covered == pytest.approx(1.0, rel=1e-12)
    places = [SITE + 1e-12 * UP, SITE - 1e-12 * UP]
    g, exact = (accelerations(field, places) for field in (small.field, EXACT))
    assert largest_share(g, exact) < 3.0 * small.error
    assert (g != exact).all()


def test_triangles_in_a_box_are_those_that_sampling_finds() -> None:
    rng = np.random.default_rng(11)
    center, half = np.array([0.1, -0.2, 0.3]), np.array([1.0, 0.6, 0.8])
    corners = center + rng.normal(size=(400, 1, 3)) + 0.7 * rng.normal(size=(400, 3, 3))
    found = triangles_in_box(corners, center, half)
    shares = rng.dirichlet(np.ones(3), size=4000)
    samples = np.einsum("sk,fkc->fsc", shares, corners) - center
    inside = (np.abs(samples) < half * (1 - 1e-6)).all(axis=2).any(axis=1)
    kept = (corners[:, None] == found[None]).all(axis=(2, 3)).any(axis=1)
    assert (kept | ~inside).all()  # none that reaches in is missed
    assert 0 < len(found) - inside.sum() <= 8  # a few only touch a corner between the samples


def test_a_triangle_on_the_face_of_a_box_stays_outside() -> None:
    floor = np.array([[[-5.0, -5.0, 0.0], [5.0, -5.0, 0.0], [0.0, 5.0, 0.0]]])
    center, half = np.array([0.0, 0.0, 1.0]), np.ones(3)
    assert len(triangles_in_box(floor, center, half)) == 0
    assert len(triangles_in_box(floor + np.array([0.0, 0.0, 1e-3]), center, half)) == 1


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: boxed_field(point_mass_field(5.0), box()), "point_mass field is not worth"),
        (lambda: boxed_field(EXACT, box(lower=(60.0, -40.0, 0.0))), "the box is empty"),
        (lambda: boxed_field(EXACT, box(), 0.0), "tolerance is 0"),
    ],
)
def test_what_cannot_be_interpolated_is_refused(make, message: str) -> None:
    with pytest.raises(InputRefused, match=message):
        make()
