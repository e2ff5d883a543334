"""Claims about rays, remeshing and resampling."""

from __future__ import annotations

import numpy as np
import pytest
from shape_helpers import box, fibonacci_ellipsoid

from landing_cli.body.adjacency import facet_neighbours
from landing_cli.body.mass_properties import is_star_shaped, mass_properties, translated
from landing_cli.body.mesh import Mesh
from landing_cli.body.mesh_checks import Surface, check_surface
from landing_cli.body.remesh import corner_angles, delaunay, relaxed
from landing_cli.body.resample import facet_samples, resampled
from landing_cli.body.star_surface import StarSurface
from landing_cli.body.surface_deviation import radial_deviation, triangle_quality
from landing_cli.errors import InputRefused, UsageError
from landing_cli.sources.shape_files import obj_text, read_mesh, rounded


def bumpy(count: int = 1500) -> Mesh:
    """An elongated, asymmetric body, off its centre of mass."""
    mesh = fibonacci_ellipsoid((900.0, 400.0, 300.0), count)
    x, y, z = mesh.vertices.T
    swell = 1.0 + 0.1 * np.sin(x / 150.0) * np.cos(y / 120.0) + 0.05 * np.sin(z / 60.0)
    return translated(Mesh(mesh.vertices * swell[:, None], mesh.faces), np.array([40.0, -20.0, 10.0]))


def test_rays_meet_a_box_where_its_faces_are():
    cube = box((2.0, 2.0, 2.0), (-1.0, -1.0, -1.0))
    directions = np.random.default_rng(1).normal(size=(5000, 3))
    points = StarSurface(cube).points_along(directions)
    np.testing.assert_allclose(np.abs(points).max(axis=1), 1.0, rtol=1e-13)
    np.testing.assert_allclose(np.cross(points, directions), 0.0, atol=1e-13)


def test_rays_through_vertices_and_edges_meet_them():
    mesh = fibonacci_ellipsoid((9.0, 4.0, 3.0), 300)
    surface = StarSurface(mesh)
    np.testing.assert_allclose(surface.points_along(mesh.vertices), mesh.vertices, rtol=0, atol=1e-11)
    middles = 0.5 * (mesh.corners + np.roll(mesh.corners, -1, axis=1)).reshape(-1, 3)
    np.testing.assert_allclose(surface.points_along(middles), middles, rtol=0, atol=1e-11)


def test_rays_that_lose_their_way_ask_every_facet(monkeypatch):
    mesh = bumpy()
    mesh = translated(mesh, -mass_properties(mesh).center_of_mass_m)
    directions = np.random.default_rng(2).normal(size=(1000, 3))
    walked = StarSurface(mesh).facets_along(directions)
    monkeypatch.setattr("landing_cli.body.star_surface._STEPS", 0)
    np.testing.assert_array_equal(StarSurface(mesh).facets_along(directions), walked)


def test_samples_share_the_area_and_average_to_the_centroid():
    mesh = bumpy(100)
    for divisions in (1, 2, 5):
        points, areas, weights = facet_samples(mesh, divisions)
        assert len(weights) == divisions**2
        np.testing.assert_allclose(
            points.reshape(len(mesh.faces), -1, 3).mean(axis=1), mesh.corners.mean(axis=1), rtol=1e-12
        )
        np.testing.assert_allclose(
            areas.reshape(len(mesh.faces), -1).sum(axis=1) * 2,
            np.linalg.norm(
                np.cross(mesh.corners[:, 1] - mesh.corners[:, 0], mesh.corners[:, 2] - mesh.corners[:, 0]),
                axis=1,
            ),
            rtol=1e-12,
        )


def test_delaunay_leaves_no_edge_opposite_more_than_180_degrees_and_keeps_the_surface_closed():
    sphere = fibonacci_ellipsoid((1.0, 1.0, 1.0), 400)
    stretched = Mesh(sphere.vertices * [900.0, 300.0, 200.0], sphere.faces)
    found = delaunay(stretched)
    assert (found.faces != stretched.faces).any()
    neighbours = facet_neighbours(found)
    angles = corner_angles(found)
    for f, row in enumerate(neighbours):
        for i, other in enumerate(row):
            apex = np.flatnonzero(~np.isin(found.faces[other], found.faces[f]))[0]
            assert angles[f, (i + 2) % 3] + angles[other, apex] < np.pi + 2e-4
    assert is_star_shaped(found, np.zeros(3))


def test_relaxing_keeps_vertices_on_the_surface_and_evens_the_triangles():
    source = bumpy()
    source = translated(source, -mass_properties(source).center_of_mass_m)
    surface = StarSurface(source)
    sphere = fibonacci_ellipsoid((1.0, 1.0, 1.0), 300)
    start = Mesh(surface.points_along(sphere.vertices), sphere.faces)
    found = relaxed(surface, start, 60)
    np.testing.assert_allclose(surface.points_along(found.vertices), found.vertices, rtol=1e-9)
    assert triangle_quality(start).longest_over_mean_edge > 3.0
    assert triangle_quality(found).longest_over_mean_edge < 1.7
    assert triangle_quality(found).least_angle_deg > 30.0


@pytest.mark.parametrize("count", [150, 600])
def test_a_resampled_body_keeps_volume_place_and_shape(count):
    source = bumpy()
    found = resampled(source, count)
    assert found.faces.shape == (2 * count - 4, 3)
    old, new = mass_properties(source), mass_properties(found)
    assert new.volume_m3 == pytest.approx(old.volume_m3, rel=1e-12)
    np.testing.assert_allclose(new.center_of_mass_m, old.center_of_mass_m, rtol=0, atol=40 / count)
    assert radial_deviation(source, found, old.center_of_mass_m).rms_m < 1500 / count
    assert triangle_quality(found).least_angle_deg > 25.0
    assert all(r.status == "passed" for r in check_surface(Surface(found.vertices, found.faces)))


def test_fitted_facets_lie_closer_than_facets_whose_corners_lie_on_the_surface():
    source = bumpy()
    com = mass_properties(source).center_of_mass_m
    about_com = translated(source, -com)
    found = translated(resampled(source, 400), -com)
    inscribed = Mesh(StarSurface(about_com).points_along(found.vertices), found.faces)
    fitted = radial_deviation(about_com, found, np.zeros(3)).rms_m
    assert fitted < 0.5 * radial_deviation(about_com, inscribed, np.zeros(3)).rms_m


def test_resampling_is_the_same_to_the_last_byte_on_every_run():
    texts = {obj_text(rounded(resampled(bumpy(), 200)), ["x"], "km") for _ in range(2)}
    assert len(texts) == 1


def test_a_body_with_an_overhang_is_refused_with_the_reason():
    mesh = fibonacci_ellipsoid((300.0, 200.0, 150.0), 500)
    vertices = mesh.vertices.copy()
    vertices[250] = vertices[250] * 1.5 + np.array([0.0, 0.0, 150.0])
    with pytest.raises(
        InputRefused, match=r"of 996 facets hide from the centre: not star-shaped; .*overhangs"
    ):
        resampled(Mesh(vertices, mesh.faces), 200)


@pytest.mark.parametrize("count", [-5, 11, 100_001])
def test_an_absurd_number_of_vertices_is_refused(count):
    with pytest.raises(UsageError, match=f"{count} vertices asked for; 12 to 100000 are possible"):
        resampled(bumpy(100), count)


@pytest.mark.parametrize(
    ("name", "source", "counts", "rms_m"),
    [
        ("bennu.obj", "bennu_radar_1348.obj", (1348, 2692), 0.6),
        ("bacchus.obj", "bacchus_radar_2048.obj", (2048, 4092), 0.65),
        ("eros.obj", "eros_near_3897.obj", (3897, 7790), 12.0),
    ],
)
def test_the_shipped_shapes_are_as_close_as_their_page_says(
    project_root, reference_shapes, name, source, counts, rms_m
):
    shipped = read_mesh(project_root / "shapes" / name, "km")
    reference = read_mesh(reference_shapes / source, "km")
    assert (len(shipped.vertices), len(shipped.faces)) == counts
    old, new = mass_properties(reference), mass_properties(shipped)
    assert new.volume_m3 == pytest.approx(old.volume_m3, rel=1e-6)
    for a, b in ((reference, shipped), (shipped, reference)):
        assert radial_deviation(a, b, old.center_of_mass_m).rms_m < rms_m
    quality = triangle_quality(shipped)
    assert quality.least_angle_deg > 30.0
    assert quality.greatest_edge_ratio < 2.0


def test_the_shipped_shapes_name_their_origin_and_no_place_on_this_machine(project_root):
    for name in ("bennu", "bacchus", "eros"):
        head = [
            line
            for line in (project_root / "shapes" / f"{name}.obj").read_text().splitlines()
            if line.startswith("#")
        ]
        assert any("NASA PDS" in line for line in head)
        assert not any("/home" in line or "/work" in line or "../" in line for line in head)
