"""The polyhedron against closed forms, an independent package, and its own limits."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import polyhedral_gravity as pg
import pytest
from gravity_helpers import FIELDS, POTATO, icosphere, points_around, read_obj_km
from kernel_calls import from_python
from shape_helpers import box

from landing_cli.body.gravity.field_values import accelerations, gradients, potentials
from landing_cli.body.gravity.polyhedron import (
    inside_share as inside_share_part,
    laplacian as laplacian_part,
    polyhedron_field,
)
from landing_cli.body.mesh import Mesh
from landing_cli.errors import InputRefused

inside_share = from_python(inside_share_part)
laplacian = from_python(laplacian_part)

PACKAGE_G = 6.67430e-11
SIZE = (3.0, 2.0, 1.0)
BOX = box(SIZE, (-1.0, -1.2, -0.3))


def prism(point: np.ndarray) -> tuple[float, np.ndarray]:
    """U and g of the box for G rho = 1 (MacMillan 1930; Nagy et al. 2000)."""
    low = BOX.vertices.min(axis=0) - point
    potential, g = 0.0, np.zeros(3)
    for corner in itertools.product((0, 1), repeat=3):
        x, y, z = low + np.array(corner) * SIZE
        r = math.sqrt(x * x + y * y + z * z)
        sign = (-1.0) ** (3 - sum(corner))
        lx, ly, lz = math.log(x + r), math.log(y + r), math.log(z + r)
        ax, ay, az = math.atan(y * z / (x * r)), math.atan(x * z / (y * r)), math.atan(x * y / (z * r))
        potential += sign * (
            x * y * lz + y * z * lx + x * z * ly - (x * x * ax + y * y * ay + z * z * az) / 2
        )
        g -= sign * np.array([y * lz + z * ly - x * ax, x * lz + z * lx - y * ay, x * ly + y * lx - z * az])
    return potential, g


def test_box_equals_the_closed_form_inside_and_outside() -> None:
    field = polyhedron_field(BOX.vertices, BOX.faces, math.prod(SIZE))
    points = np.random.default_rng(3).uniform(-3.0, 3.0, (200, 3))
    expected = [prism(p) for p in points]
    np.testing.assert_allclose(potentials(field, points), [u for u, _ in expected], rtol=1e-13, atol=0)
    np.testing.assert_allclose(accelerations(field, points), [g for _, g in expected], rtol=0, atol=5e-14)


def test_sphere_acts_from_outside_as_a_point_mass() -> None:
    sphere = icosphere(100.0, 4)
    field = polyhedron_field(sphere.vertices, sphere.faces, 7.0)
    # the facets' cut-off caps change U by the relative area error times a steep power of R/r
    for radius, tolerance in ((120.0, 1e-5), (200.0, 5e-7), (1000.0, 1e-10), (1e5, 2e-9)):
        points = points_around(radius, 10)
        np.testing.assert_allclose(potentials(field, points), 7.0 / radius, rtol=tolerance, atol=0)
        pull = -np.einsum("ni,ni->n", accelerations(field, points), points) / radius
        np.testing.assert_allclose(pull, 7.0 / radius**2, rtol=10 * tolerance, atol=0)


def test_shell_theorem_holds_inside_the_sphere() -> None:
    sphere = icosphere(100.0, 4)
    field = polyhedron_field(sphere.vertices, sphere.faces, 7.0)
    points = points_around(50.0, 10)
    np.testing.assert_allclose(accelerations(field, points), -7.0 * points / 1e6, rtol=0, atol=3e-6)


def test_potato_agrees_with_the_polyhedral_gravity_package() -> None:
    compare_with_package(POTATO, 5.0, np.vstack([points_around(310.0, 20), points_around(900.0, 20)]))


def test_bennu_and_eros_agree_with_the_polyhedral_gravity_package(reference_shapes: Path) -> None:
    for name, gm, radius in (("bennu_radar_1348", 4.892, 300.0), ("eros_near_856", 4.4628e5, 19000.0)):
        compare_with_package(read_obj_km(reference_shapes / f"{name}.obj"), gm, points_around(radius, 6))


def compare_with_package(mesh: Mesh, gm: float, points: np.ndarray) -> None:
    field = polyhedron_field(mesh.vertices, mesh.faces, gm)
    # in metres the package's own orientation check "heals" a right mesh to half its gravity
    body = pg.Polyhedron(
        (mesh.vertices, mesh.faces),
        density=field.params[2] / PACKAGE_G,
        integrity_check=pg.PolyhedronIntegrity.DISABLE,
    )
    rows = pg.evaluate(body, points, parallel=False)
    xx, yy, zz, xy, xz, yz = np.array([row[2] for row in rows]).T
    hessians = np.moveaxis(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), 2, 0)
    for ours, theirs, tolerance in (
        (potentials(field, points), np.array([row[0] for row in rows]), 2e-13),
        (accelerations(field, points), np.array([row[1] for row in rows]), 2e-13),
        (gradients(field, points), hessians, 1e-11),
    ):
        assert np.abs(ours - theirs).max() < tolerance * np.abs(theirs).max()


def test_laplacian_tells_inside_from_outside() -> None:
    field = FIELDS["polyhedron"]
    scales = np.linalg.norm(POTATO.vertices, axis=1).min(), np.linalg.norm(POTATO.vertices, axis=1).max()
    for p in points_around(0.5 * scales[0], 20):
        assert inside_share(field.params, *p) == pytest.approx(1.0, abs=1e-13)
        assert np.trace(gradients(field, p)[0]) == pytest.approx(laplacian(field.params, *p), rel=1e-13)
        assert laplacian(field.params, *p) == pytest.approx(-4.0 * math.pi * field.params[2], rel=1e-13)
    for p in points_around(1.01 * scales[1], 20):
        assert inside_share(field.params, *p) == pytest.approx(0.0, abs=1e-13)


def test_inside_test_is_sharp_at_a_facet() -> None:
    field, corners = FIELDS["polyhedron"], POTATO.corners
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    for centroid, normal in zip(corners.mean(axis=1)[::7], normals[::7], strict=True):
        assert inside_share(field.params, *(centroid - 1e-6 * normal)) > 1.0 - 1e-6
        assert inside_share(field.params, *(centroid + 1e-6 * normal)) < 1e-6


def test_field_is_finite_and_continuous_at_vertices_edges_and_facets() -> None:
    field, corners = FIELDS["polyhedron"], POTATO.corners[::5]
    on_surface = np.vstack([corners[:, 0], corners[:, :2].mean(axis=1), corners.mean(axis=1)])
    assert np.isfinite(gradients(field, on_surface[-len(corners) :])).all()
    outside = on_surface * (1.0 + 1e-9)
    scale = np.linalg.norm(accelerations(field, outside), axis=1).max()
    assert np.abs(accelerations(field, on_surface) - accelerations(field, outside)).max() < 1e-7 * scale
    np.testing.assert_allclose(potentials(field, on_surface), potentials(field, outside), rtol=1e-8, atol=0)


def test_far_away_the_sums_keep_their_digits() -> None:
    field = FIELDS["polyhedron"]
    for ratio, tolerance in ((1e2, 1e-11), (1e4, 1e-7)):
        p = points_around(300.0 * ratio, 5)
        pull = -np.einsum("ni,ni->n", accelerations(field, p), p) / (300.0 * ratio)
        quadrupole = 3.0 / ratio**2
        np.testing.assert_allclose(pull, 5.0 / (300.0 * ratio) ** 2, rtol=tolerance + quadrupole, atol=0)


def test_numbering_of_vertices_and_facets_does_not_matter() -> None:
    rng = np.random.default_rng(5)
    order = rng.permutation(len(POTATO.vertices))
    faces = np.argsort(order)[POTATO.faces][rng.permutation(len(POTATO.faces))]
    shuffled = polyhedron_field(POTATO.vertices[order], np.roll(faces, 1, axis=1), 5.0)
    points = points_around(400.0, 5)
    np.testing.assert_allclose(
        gradients(shuffled, points), gradients(FIELDS["polyhedron"], points), rtol=0, atol=1e-19
    )


def test_open_inverted_and_flat_meshes_are_refused() -> None:
    with pytest.raises(InputRefused, match="exactly two facets"):
        polyhedron_field(BOX.vertices, BOX.faces[1:], 1.0)
    with pytest.raises(InputRefused, match="exactly two facets"):
        polyhedron_field(BOX.vertices, np.vstack([BOX.faces, BOX.faces]), 1.0)
    with pytest.raises(InputRefused, match="wind its facets outwards"):
        polyhedron_field(BOX.vertices, BOX.faces[:, ::-1], 1.0)
    with pytest.raises(InputRefused, match="without area"):
        polyhedron_field(BOX.vertices * [1.0, 1.0, 0.0], BOX.faces, 1.0)
    with pytest.raises(InputRefused, match="gm_m3_s2"):
        polyhedron_field(BOX.vertices, BOX.faces, 0.0)
