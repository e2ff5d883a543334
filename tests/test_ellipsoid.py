"""Claims about the least-volume ellipsoid."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import nnls
from shape_helpers import CUBE_CORNERS, fibonacci_ellipsoid

from landing_cli.body.ellipsoid import least_volume_ellipsoid
from landing_cli.body.mass_properties import centred
from landing_cli.errors import InputRefused


def test_the_corners_of_a_box_lie_on_sqrt3_times_its_half_edges():
    half = np.array([200.0, 30.0, 4.0])
    np.testing.assert_allclose(
        least_volume_ellipsoid((2 * CUBE_CORNERS - 1) * half), np.sqrt(3) * half, rtol=1e-12
    )


def test_an_octahedron_gives_its_half_diagonals():
    points = np.vstack([np.diag([5.0, 3.0, 2.0]), -np.diag([5.0, 3.0, 2.0])])
    np.testing.assert_allclose(least_volume_ellipsoid(points), [5.0, 3.0, 2.0], rtol=1e-12)


def test_points_on_an_ellipsoid_give_it_back():
    points = fibonacci_ellipsoid((500.0, 300.0, 250.0), 5000).vertices
    np.testing.assert_allclose(least_volume_ellipsoid(points), [500.0, 300.0, 250.0], rtol=1e-12)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(3, 400))
def test_every_vertex_is_inside_and_the_multipliers_prove_the_volume_least(seed, count):
    """KKT: 1/w = sum of lambda_i p_i^2 over the binding points, with lambda >= 0."""
    points = np.random.default_rng(seed).normal(size=(count, 3)) * [900.0, 40.0, 7.0]
    axes = least_volume_ellipsoid(points)
    assert ((points / axes) ** 2).sum(axis=1).max() <= 1.0
    assert (points**2 @ (1.0 / axes**2)).max() <= 1.0
    levels = ((points / axes) ** 2).sum(axis=1)
    binding = (points[levels > 1.0 - 1e-9] / axes) ** 2
    multipliers, residual = nnls(binding.T, np.ones(3))
    assert residual < 1e-6
    assert multipliers.sum() == pytest.approx(3.0, rel=1e-6)


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (np.array([[1.0, 0, 0], [0, 1.0, 0]]), "coordinate plane"),
        (np.array([[1.0, 0, np.nan], [0, 1.0, 0]]), "not all finite"),
    ],
)
def test_points_without_a_least_ellipsoid_are_refused(points, words):
    with pytest.raises(InputRefused, match=words):
        least_volume_ellipsoid(points)


@pytest.mark.parametrize(
    ("name", "semi_axes_m"),
    [
        ("bennu_radar_1348.obj", (289.9, 279.4, 266.1)),
        ("bacchus_radar_2048.obj", (605.2, 287.4, 337.0)),
        ("eros_near_3897.obj", (21013.0, 10590.0, 7774.0)),
    ],
)
def test_the_reference_bodies_have_their_published_ellipsoids(reference_shapes, name, semi_axes_m):
    from landing_cli.sources.shape_files import read_mesh

    found = least_volume_ellipsoid(centred(read_mesh(reference_shapes / name, "km")).vertices)
    np.testing.assert_allclose(found, semi_axes_m, rtol=2e-4)
