"""The field around a whole body against the polyhedron that it stands for, and its parts."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from gravity_helpers import FIELDS, POTATO, points_around
from kernel_calls import from_python

from landing_cli.body.gravity import surrounding, surrounding_kernels
from landing_cli.body.gravity.bounds import FIT_MARGIN, largest_acceleration_on_ellipsoid
from landing_cli.body.gravity.facet_potential import FACET, facet_curvature, facet_gradient, facet_pull
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.field_values import (
    accelerations,
    accelerations_and_gradients,
    gradients,
    potentials,
)
from landing_cli.body.gravity.kernel_types import FloatArray
from landing_cli.body.gravity.kernels import curvature as curvature_part
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.body.gravity.surface_bound import largest_acceleration_on_mesh
from landing_cli.body.gravity.surrounding import SurroundingField, surrounding_field
from landing_cli.body.gravity.surrounding_checks import is_sound
from landing_cli.body.gravity.surrounding_pieces import Body
from landing_cli.body.mesh import facet_centroids, facet_normals
from landing_cli.errors import InputRefused
from landing_cli.kernel import kernel
from landing_cli.sources import kept_interpolation as kept

curvature = from_python(curvature_part)

EXACT = FIELDS["polyhedron"]
TABLE = Body.of(EXACT).table
RADIUS = Body.of(EXACT).radius_m
SOME = np.arange(0, 60)
NEAR_SOME = TABLE[30, :3] + np.array([[60.0, 20.0, 35.0], [9.0, 14.0, 25.0], [-40.0, 70.0, 10.0]])
ALONG = (0.3, -1.2, 0.7)


@kernel
def sums(table: FloatArray, count: int, p: FloatArray, along: FloatArray, found: FloatArray) -> None:
    for f in range(count):
        k = FACET * f
        u = facet_pull(table, k, p[0], p[1], p[2])
        g = facet_gradient(table, k, p[0], p[1], p[2])
        t = facet_curvature(table, k, p[0], p[1], p[2], along[0], along[1], along[2])
        found[0] += u[0]
        found[1] += u[1]
        found[2] += u[2]
        found[3] += u[3]
        for i in range(9):
            found[4 + i] += g[i]
        for i in range(6):
            found[13 + i] += t[i]


def summed(facets: np.ndarray, points: np.ndarray) -> np.ndarray:
    """U, its gradient, gradient and Hessian, curvature along ALONG of some facets, (n, 19)."""
    rows = np.zeros((len(points), 19))
    for point, row in zip(points, rows, strict=True):
        sums(TABLE[facets].ravel(), len(facets), point, np.array(ALONG), row)
    return 0.5 * EXACT.params[2] * rows


def tensor(six: np.ndarray) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = np.moveaxis(six, -1, 0)
    return np.moveaxis(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), -1, 0)


def share(values: np.ndarray, exact: np.ndarray) -> float:
    return float(np.abs(values - exact).max() / np.abs(exact).max())


def shares(values: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """Error at every point over the value there, by norms."""
    rows = ((values - exact).reshape(len(exact), -1), exact.reshape(len(exact), -1))
    return np.divide(*(np.linalg.norm(row, axis=1) for row in rows))


# ------------------------------------------------------------------------------------- single facets


def test_facets_add_up_to_the_polyhedron_outside_and_inside() -> None:
    up = facet_centroids(POTATO) + 5.0 * facet_normals(POTATO)
    points = np.concatenate(
        [points_around(450.0, 5), points_around(1500.0, 5), points_around(90.0, 5), up[:5]]
    )
    all_of_it = summed(np.arange(len(TABLE)), points)
    assert share(all_of_it[:, 0], potentials(EXACT, points)) < 1e-13
    assert share(all_of_it[:, 1:4], accelerations(EXACT, points)) < 1e-12
    assert share(all_of_it[:, 4:7], accelerations(EXACT, points)) < 1e-12
    assert share(tensor(all_of_it[:, 7:13]), gradients(EXACT, points)) < 1e-12
    bent = np.array([curvature(EXACT.kind, EXACT.params, *p, *ALONG) for p in points])
    assert share(all_of_it[:, 13:], bent) < 1e-10


def test_each_derivative_of_some_facets_is_the_slope_of_the_one_below() -> None:
    """Of an open part of the surface: what Werner and Scheeres' sums do not give."""
    h = 1e-2
    steps = [h * axis for axis in np.eye(3)]

    def slope(step: np.ndarray) -> np.ndarray:
        ahead, behind = summed(SOME, NEAR_SOME + step), summed(SOME, NEAR_SOME - step)
        wider = summed(SOME, NEAR_SOME + 2 * step) - summed(SOME, NEAR_SOME - 2 * step)
        return (8.0 * (ahead - behind) - wider) / (12.0 * np.linalg.norm(step))

    here, slopes = summed(SOME, NEAR_SOME), np.stack([slope(step) for step in steps], axis=-1)
    assert share(here[:, 1:4], slopes[:, 0]) < 1e-10
    assert share(here[:, 4:7], here[:, 1:4]) < 1e-13
    assert share(tensor(here[:, 7:13]), slopes[:, 4:7]) < 1e-9
    along = np.einsum("kij,j->ki", slopes[:, 7:13], ALONG)
    assert share(here[:, 13:], along) < 1e-8


def test_on_its_own_facet_a_point_gets_what_the_polyhedron_gives() -> None:
    """Touchdown points lie on the surface; rounding puts them on either side of it."""
    points = facet_centroids(POTATO)[:40]
    all_of_it = summed(np.arange(len(TABLE)), points)
    assert share(all_of_it[:, 1:4], accelerations(EXACT, points)) < 1e-12


# ------------------------------------------------------------------------------------- the field


@pytest.fixture(scope="module")
def fitted() -> SurroundingField:
    return surrounding_field(EXACT)


def everywhere() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(5)
    at, up = facet_centroids(POTATO), facet_normals(POTATO)
    shells = [points_around(r, 150, int(r)) for r in (1.05 * RADIUS, 1.4 * RADIUS, 1.9 * RADIUS)]
    return {
        "touchdown": at,
        "low": at + 3.0 * rng.random((len(at), 1)) * up,
        "over the facets": at + 100.0 * rng.random((len(at), 1)) * up,
        "around": np.concatenate(shells),
        "beyond": np.concatenate([points_around(r * RADIUS, 100) for r in (2.0001, 2.5, 8.0, 100.0)]),
    }


@pytest.mark.parametrize("where", everywhere())
def test_the_field_is_the_polyhedrons_within_the_measured_error(fitted: SurroundingField, where: str) -> None:
    assert fitted.field.kind is GravityKind.INTERPOLATED
    assert 0.0 < fitted.error < 5e-5 and fitted.checked_points >= 3 * min(fitted.pieces, 400)
    points = everywhere()[where]
    g, G = accelerations_and_gradients(fitted.field, points)
    exact_g, exact_G = accelerations_and_gradients(EXACT, points)
    assert shares(g, exact_g).max() < 3.0 * fitted.error
    assert np.median(shares(g, exact_g)) < 0.1 * fitted.error
    if where != "touchdown":  # on the surface itself the polyhedron's gradient jumps
        assert np.quantile(shares(G, exact_G), 0.99) < 3.0 * fitted.gradient_error
    np.testing.assert_allclose(potentials(fitted.field, points), potentials(EXACT, points), rtol=1e-6, atol=0)
    assert (g != exact_g).any(axis=1).mean() > 0.99  # no point is left to the polyhedron


def test_inside_the_body_too(fitted: SurroundingField) -> None:
    at = facet_centroids(POTATO)
    points = 0.8 * np.random.default_rng(3).random((len(at), 1)) * at
    wrong = np.linalg.norm(accelerations(fitted.field, points) - accelerations(EXACT, points), axis=1)
    assert np.quantile(wrong, 0.9) < fitted.error * 5.0 / RADIUS**2
    assert wrong.max() < 10.0 * fitted.error * 5.0 / RADIUS**2  # where nothing flies


def test_values_are_derivatives_of_one_potential(fitted: SurroundingField) -> None:
    """By central differences about points well inside a piece, among facets, far from them, and beyond."""
    field, params = fitted.field, fitted.field.params
    up = facet_centroids(POTATO)[7] + 11.0 * facet_normals(POTATO)[7]
    for place, h in (
        (up, 1e-3),
        (up + 30.0, 1e-3),
        (np.array([431.0, 377.0, 203.0]), 1e-2),
        (8e2 * up, 10.0),
    ):
        steps = h * np.eye(3)
        by_u = [(potentials(field, [place + e]) - potentials(field, [place - e]))[0] / (2 * h) for e in steps]
        g, G = accelerations_and_gradients(field, [place])
        np.testing.assert_allclose(by_u, g[0], rtol=0, atol=1e-7 * np.abs(g).max())
        by_g = [(accelerations(field, [place + e]) - accelerations(field, [place - e]))[0] for e in steps]
        np.testing.assert_allclose(np.array(by_g).T / (2 * h), G[0], rtol=0, atol=1e-6 * np.abs(G).max())
        np.testing.assert_array_equal(G[0], G[0].T)
        step = h * np.array(ALONG)
        by_G = (gradients(field, [place + step]) - gradients(field, [place - step]))[0] / (2 * h)
        bent = tensor(np.array([curvature(field.kind, params, *place, *ALONG)]))[0]
        np.testing.assert_allclose(by_G, bent, rtol=0, atol=1e-5 * np.abs(bent).max())
    none = curvature(field.kind, params, *(3e3, 0.0, 0.0), 0.0, 0.0, 0.0)
    assert none == (0.0,) * 6


def test_far_off_no_digit_is_lost(fitted: SurroundingField) -> None:
    """The polyhedron's own sums cancel there."""
    points = points_around(1e7 * RADIUS, 50)
    expected = accelerations(point_mass_field(5.0), points)
    assert share(accelerations(fitted.field, points), expected) < 1e-11


def test_any_number_of_threads_makes_the_same_field(fitted: SurroundingField) -> None:
    with ThreadPoolExecutor(3) as pool:
        again = surrounding_field(EXACT, pool.map)
    np.testing.assert_array_equal(again.field.params, fitted.field.params)


def test_bounds_hold_for_the_fit_and_for_the_polyhedron(fitted: SurroundingField) -> None:
    axes = np.array([420.0, 260.0, 200.0])
    bound, known = (largest_acceleration_on_ellipsoid(f, axes) for f in (fitted.field, EXACT))
    assert known * (1.0 + 5.0 * fitted.error) < bound
    assert bound < known * (1.0 + 2.0 * FIT_MARGIN * fitted.error)
    points = axes * points_around(1.0, 20_000)
    assert np.linalg.norm(accelerations(fitted.field, points), axis=1).max() < bound
    on_mesh = largest_acceleration_on_mesh(fitted.field, POTATO)  # the polyhedron's own takes half a minute
    assert np.linalg.norm(accelerations(EXACT, facet_centroids(POTATO)), axis=1).max() < on_mesh


# ------------------------------------------------------------------------------------- what is refused


def test_what_cannot_be_fitted_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputRefused, match="point_mass field is not worth"):
        surrounding_field(point_mass_field(5.0))
    monkeypatch.setattr(surrounding, "MOST_FACETS", 100)
    with pytest.raises(InputRefused, match=r"facets are too many.*at most 100"):
        surrounding_field(EXACT)


def test_parameters_that_lead_astray_are_found(fitted: SurroundingField) -> None:
    params = fitted.field.params
    assert is_sound(params)
    header, coefficients = surrounding_kernels.HEADER, int(params[1])
    piece = int(-params[header:coefficients][params[header:coefficients] < 0.0][0])
    near = next(
        int(-v) for v in params[header:coefficients] if v < 0.0 and params[int(-v) + 2] > 0.0 and v == int(v)
    )
    for place, value in (
        (0, len(params) + 1.0),
        (0, -3.0),
        (1, 0.5),
        (3, 0.0),
        (header, 0.5),
        (header, float(len(params))),
        (header + 1, 1.0),  # a child that is its own parent's
        (piece, float(params[0])),
        (piece + 2, 1e12),
        (near + 2, -1.0),
        (near + 3, float(coefficients)),
    ):
        forged = params.copy()
        forged[place] = value
        assert not is_sound(forged), place
    assert not is_sound(params[:5]) and not is_sound(params[:coefficients])


# ------------------------------------------------------------------------------------- the cache


def test_a_kept_field_is_read_again_and_a_broken_one_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    made = []

    def made_up(polyhedron: GravityField, _mapped: object) -> SurroundingField:
        made.append(polyhedron)
        return SurroundingField(small, 0.0, 0.0, 1, 1, 0.0)

    small = surrounding_field(polyhedron_field(TETRAHEDRON, FACES, 1.0)).field
    monkeypatch.setattr(kept.surrounding, "surrounding_field", made_up)
    for _ in range(2):
        found = kept.kept_interpolation(TETRAHEDRON, FACES)
        np.testing.assert_array_equal(found.params, small.params)
    assert len(made) == 1 and found.kind is GravityKind.INTERPOLATED
    (file,) = kept.cache_folder().iterdir()
    data = bytearray(file.read_bytes())
    data[-1] ^= 1
    file.write_bytes(bytes(data))
    kept.kept_interpolation(TETRAHEDRON, FACES)
    assert len(made) == 2
    kept.kept_interpolation(1.01 * TETRAHEDRON, FACES)
    assert len(made) == 3 and len(list(kept.cache_folder().iterdir())) == 2


def test_where_nothing_can_be_kept_the_field_is_made_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert kept.kept_interpolation(TETRAHEDRON, FACES).kind is GravityKind.INTERPOLATED


TETRAHEDRON = np.array(
    [[100.0, 100.0, 100.0], [-100.0, -100.0, 100.0], [-100.0, 100.0, -100.0], [100.0, -100.0, -100.0]]
)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
