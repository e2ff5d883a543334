"""Claims about volume, centre of mass and inertia: closed forms and the reference figures."""

from __future__ import annotations

import numpy as np
import pytest
from shape_helpers import box, fibonacci_ellipsoid, tetrahedron

from landing_cli.body.mass_properties import (
    centred,
    facets_hidden_from,
    is_star_shaped,
    mass_properties,
    principal_axes,
    translated,
)
from landing_cli.body.mesh import Mesh


@pytest.mark.parametrize("corner", [(0.0, 0.0, 0.0), (-1.0, -1.5, -2.0), (1e4, -2e4, 3e4)])
def test_a_box_has_its_closed_form_wherever_the_origin_is(corner):
    size = np.array([2.0, 3.0, 4.0])
    found = mass_properties(box(tuple(size), corner))
    np.testing.assert_allclose(found.volume_m3, size.prod(), rtol=1e-11)
    np.testing.assert_allclose(found.center_of_mass_m, corner + size / 2, rtol=1e-14, atol=1e-14)
    expected = np.diag((size @ size - size**2) / 12)
    np.testing.assert_allclose(found.inertia_m2, expected, rtol=1e-11, atol=1e-10)


def test_a_tetrahedron_has_its_closed_form():
    found = mass_properties(tetrahedron(2.0))
    np.testing.assert_allclose(found.volume_m3, 8 / 6, rtol=1e-14)
    np.testing.assert_allclose(found.center_of_mass_m, 0.5, rtol=1e-14)
    # About the COM, per unit mass, edge s: int x^2 = s^2 (1/10 - 1/16), int xy = s^2 (1/20 - 1/16).
    expected = 4 * (np.eye(3) * 2 * (1 / 10 - 1 / 16) - (1 - np.eye(3)) * (1 / 20 - 1 / 16))
    np.testing.assert_allclose(found.inertia_m2, expected, rtol=1e-13)


def test_an_ellipsoid_is_approached_with_the_square_of_the_facet_size():
    exact_volume = 4 / 3 * np.pi * 6
    exact_inertia = np.array([4 + 1, 9 + 1, 9 + 4]) / 5
    errors = []
    for count in (500, 2000):
        found = mass_properties(fibonacci_ellipsoid((3.0, 2.0, 1.0), count))
        volume_error = 1 - found.volume_m3 / exact_volume
        inertia_error = np.abs(np.diag(found.inertia_m2) / exact_inertia - 1).max()
        errors.append((volume_error, inertia_error))
    np.testing.assert_allclose(np.divide(*errors), 4.0, rtol=0.1)
    assert errors[1][0] < 3e-3


def test_winding_inwards_changes_the_sign_of_the_volume_alone():
    mesh = fibonacci_ellipsoid((3.0, 2.0, 1.0), 100)
    inward = mass_properties(Mesh(mesh.vertices, mesh.faces[:, ::-1]))
    outward = mass_properties(mesh)
    assert inward.volume_m3 == pytest.approx(-outward.volume_m3, rel=1e-14)
    np.testing.assert_allclose(inward.inertia_m2, outward.inertia_m2, rtol=0, atol=1e-13)


def test_principal_axes_of_a_turned_box_are_its_edges():
    angle = np.radians(20.0)
    turn = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    cuboid = box((6.0, 4.0, 2.0))
    found = principal_axes(mass_properties(Mesh(cuboid.vertices @ turn, cuboid.faces)))
    np.testing.assert_allclose(found.axes, turn, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.moments_m2, np.array([20, 40, 52]) / 12, rtol=1e-13)
    np.testing.assert_allclose(found.angles_deg, [[20, 70, 90], [70, 20, 90], [90, 90, 0]], rtol=0, atol=2e-6)
    assert np.linalg.det(found.axes) == pytest.approx(1.0, rel=1e-14)


def test_centring_puts_the_centre_of_mass_at_the_origin():
    mesh = centred(translated(fibonacci_ellipsoid((30.0, 20.0, 10.0), 100), np.array([5.0, -7.0, 9.0])))
    np.testing.assert_allclose(mass_properties(mesh).center_of_mass_m, 0.0, atol=1e-13)


def test_a_dented_body_is_not_star_shaped_and_its_hidden_facets_are_named():
    mesh = fibonacci_ellipsoid((3.0, 2.0, 1.0), 200)
    assert is_star_shaped(mesh, np.zeros(3))
    vertices = mesh.vertices.copy()
    vertices[100] *= -0.5  # pulled through the centre
    ring = np.flatnonzero((mesh.faces == 100).any(axis=1))
    assert set(facets_hidden_from(Mesh(vertices, mesh.faces), np.zeros(3))) == set(ring)


@pytest.mark.parametrize(
    ("name", "volume_km3", "offset_m"),
    [
        ("bennu_radar_1348.obj", 0.0622656, (0.04, 0.0, 0.01)),
        ("bacchus_radar_2048.obj", 0.1354690, (-25.2, -1.2, -1.4)),
        ("eros_near_3897.obj", 2525.99, (-21.6, 2.4, 47.5)),
    ],
)
def test_the_reference_bodies_have_their_published_figures(reference_shapes, name, volume_km3, offset_m):
    from landing_cli.sources.shape_files import read_mesh

    found = mass_properties(read_mesh(reference_shapes / name, "km"))
    np.testing.assert_allclose(found.volume_m3 / 1e9, volume_km3, rtol=2e-6)
    np.testing.assert_allclose(found.center_of_mass_m, offset_m, rtol=0, atol=0.05)
