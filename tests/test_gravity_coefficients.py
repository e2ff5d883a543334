"""Coefficients against solids in closed form, the exact polyhedron, and the reference table."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from gravity_helpers import points_around, read_obj_km
from shape_helpers import box, fibonacci_ellipsoid, tetrahedron

from landing_cli.body.gravity.coefficients import (
    degree2_from_mesh,
    dipole_from_mesh,
    kappa,
    long_axis_azimuth,
)
from landing_cli.body.gravity.dipole import dipole_field
from landing_cli.body.gravity.field_values import potentials
from landing_cli.body.gravity.harmonics import harmonics_field
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.body.mass_properties import centred
from landing_cli.body.mesh import Mesh
from landing_cli.errors import InputRefused


def turned(mesh: Mesh, angle: float) -> Mesh:
    cos, sin = math.cos(angle), math.sin(angle)
    return Mesh(mesh.vertices @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]]), mesh.faces)


def test_box_has_the_coefficients_of_its_sides() -> None:
    a, b, c = 30.0, 20.0, 10.0
    found = degree2_from_mesh(box((a, b, c), (-a / 2, -b / 2, -c / 2)), 12.0)
    assert found.c20 == pytest.approx((2 * c * c - a * a - b * b) / 24 / 144, rel=1e-14)
    assert found.c22 == pytest.approx((a * a - b * b) / 48 / 144, rel=1e-14)
    assert np.abs([found.c21, found.s21, found.s22]).max() < 1e-16


def test_coefficients_are_about_the_origin_of_the_mesh() -> None:
    a, b, c = 30.0, 20.0, 10.0
    found = degree2_from_mesh(box((a, b, c)), 1.0)
    assert found.c21 == pytest.approx(a * c / 4, rel=1e-14)
    assert found.s21 == pytest.approx(b * c / 4, rel=1e-14)
    assert found.s22 == pytest.approx(a * b / 8, rel=1e-14)


def test_all_five_coefficients_carry_the_far_field_of_the_polyhedron() -> None:
    mesh = centred(tetrahedron(100.0))
    c = degree2_from_mesh(mesh, 50.0)
    harmonics = harmonics_field(5.0, 50.0, c.c20, c.c22, c.s22, c.c21, c.s21)
    exact = polyhedron_field(mesh.vertices, mesh.faces, 5.0)
    for radius in (2e3, 4e3):
        points = points_around(radius, 20)
        missing = potentials(exact, points) - potentials(harmonics, points)
        # what is left is of degree 3 and higher
        assert np.abs(missing).max() < 3.0 * 5.0 / radius * (50.0 / radius) ** 3 / 10


def test_dipole_carries_degree_two_and_three_along_its_axis() -> None:
    # an ellipsoid that tapers towards +x
    mesh = fibonacci_ellipsoid((400.0, 120.0, 100.0), 300)
    taper = 1.0 - 0.4 * mesh.vertices[:, :1] / 400.0
    mesh = centred(Mesh(mesh.vertices * np.hstack([np.ones_like(taper), taper, taper]), mesh.faces))
    fitted = dipole_from_mesh(mesh)
    assert fitted.mass_fraction < 0.49
    dipole = dipole_field(5.0, fitted.mass_fraction, fitted.separation_m)
    exact = polyhedron_field(mesh.vertices, mesh.faces, 5.0)
    errors = []
    for x in (4e3, 8e3):
        axis = np.array([[x, 0.0, 0.0], [-x, 0.0, 0.0]])
        errors.append(np.abs(potentials(dipole, axis) / potentials(exact, axis) - 1.0).max())
    # on the axis the first missing term is of degree 4
    assert errors[0] < 1e-5
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.2)


def test_long_axis_turns_with_the_body() -> None:
    mesh = fibonacci_ellipsoid((400.0, 120.0, 100.0), 300)
    angle = long_axis_azimuth(turned(mesh, 0.4)) - long_axis_azimuth(mesh)
    assert angle == pytest.approx(0.4, abs=1e-12)
    straight, moved = dipole_from_mesh(mesh), dipole_from_mesh(turned(mesh, 0.4), 0.4)
    assert moved.separation_m == pytest.approx(straight.separation_m, rel=1e-12)
    assert moved.mass_fraction == pytest.approx(straight.mass_fraction, rel=1e-12)


def test_body_that_is_short_along_x_has_no_dipole() -> None:
    with pytest.raises(InputRefused, match="not elongated"):
        dipole_from_mesh(box((10.0, 20.0, 20.0)))
    with pytest.raises(InputRefused, match="reference_radius_m"):
        degree2_from_mesh(box((10.0, 20.0, 20.0)), 0.0)


# shape, reference radius, C20, C22, S22 of the reference table, to its digits
TABLE = [
    ("bennu_radar_1348", 246.0, (-0.03922, 0.003742, None), (5e-6, 5e-7, 0)),
    ("bacchus_radar_2048", 1000.0, (-0.02674, 0.01313, -0.00045), (5e-6, 5e-6, 5e-6)),
    ("eros_near_3897", 16000.0, (-0.1185, 0.0539, -0.0182), (5e-5, 5e-5, 5e-5)),
]


@pytest.mark.parametrize(("name", "radius", "expected", "digits"), TABLE, ids=[row[0] for row in TABLE])
def test_reference_shapes_have_the_coefficients_of_the_table(
    reference_shapes: Path, name: str, radius: float, expected: tuple, digits: tuple
) -> None:
    found = degree2_from_mesh(centred(read_obj_km(reference_shapes / f"{name}.obj")), radius)
    for value, wanted, digit in zip((found.c20, found.c22, found.s22), expected, digits, strict=True):
        assert wanted is None or abs(value - wanted) <= digit


def test_dipoles_of_bacchus_and_eros_are_those_of_the_table(reference_shapes: Path) -> None:
    bacchus = dipole_from_mesh(read_obj_km(reference_shapes / "bacchus_radar_2048.obj"))
    assert bacchus.mass_fraction == pytest.approx(0.437, abs=5e-4)
    assert bacchus.separation_m == pytest.approx(463.1, abs=0.05)
    # the table's dipole of Eros lies along the long axis, 9.3 degrees off x
    mesh = read_obj_km(reference_shapes / "eros_near_3897.obj")
    eros = dipole_from_mesh(mesh, long_axis_azimuth(mesh))
    assert math.degrees(eros.azimuth_rad) == pytest.approx(-9.32, abs=0.005)
    assert eros.mass_fraction == pytest.approx(0.528, abs=5e-4)
    assert eros.separation_m == pytest.approx(15364.0, abs=0.5)
    assert kappa(4.4628e5, 3.3117e-4, eros.separation_m) == pytest.approx(1.122, abs=5e-4)
