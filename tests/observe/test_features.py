"""Landmarks on the mesh: drawn ones by their statistics, listed ones by trimesh."""

from __future__ import annotations

import numpy as np
import pytest
from shape_helpers import box, fibonacci_ellipsoid

from landing_cli.body.bvh import build_surface_index
from landing_cli.body.clearance import signed_distances
from landing_cli.body.mesh import facet_centroids, facet_normals
from landing_cli.errors import InputRefused
from landing_cli.observe.features import (
    ThomasField,
    placed_landmarks,
    thomas_landmarks,
    thomas_points,
)
from landing_cli.observe.site_frame import site_frame
from landing_cli.sources.landmark_files import LandmarkEntry, LandmarkTable, landmark_table
from landing_cli.sources.shape_files import read_mesh

DRAWN = ThomasField(seed=20260, clusters=3, mean_per_cluster=12.0, spread_m=10.0, extent_m=100.0)


def listed(*entries: tuple[tuple[float, ...] | None, tuple[float, float] | None]) -> LandmarkTable:
    rows = [LandmarkEntry(f"list, line {i}", "", p, d, None) for i, (p, d) in enumerate(entries, 1)]  # type: ignore[arg-type]
    return landmark_table(rows, "0" * 64, "list")


def test_a_thomas_process_has_its_moments():
    drawn = ThomasField(seed=3, clusters=4000, mean_per_cluster=5.0, spread_m=2.0, extent_m=1e6)
    points = thomas_points(drawn)
    assert len(points) == pytest.approx(20000, abs=5 * np.sqrt(20000))
    steps = np.diff(points, axis=0)
    same = np.abs(steps).max(axis=1) < 50.0  # consecutive ones of one cluster
    assert steps[same].std() == pytest.approx(2.0 * np.sqrt(2.0), rel=0.03)
    counts = np.diff(np.flatnonzero(np.concatenate([[True], ~same, [True]])))
    assert counts.std() == pytest.approx(2.2, rel=0.05)  # of a Poisson number that is not zero
    parents = points[np.concatenate([[True], ~same])]
    assert np.abs(parents).max() < 1e6 + 20.0
    assert parents.std(axis=0) == pytest.approx(1e6 / np.sqrt(3.0), rel=0.05)


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(reference_shapes):
    mesh = read_mesh(reference_shapes / "eros_near_3897.obj", "km")
    surface = build_surface_index(mesh)
    frame = site_frame(facet_centroids(mesh)[6551], facet_normals(mesh)[6551], "radial", 6551)
    first, again = (thomas_landmarks(mesh, surface, frame, DRAWN) for _ in range(2))
    for name in ("position_m", "normal", "facet"):
        assert getattr(first, name).tobytes() == getattr(again, name).tobytes()
    assert first.name == again.name and first.name[0] == "L001"
    np.testing.assert_allclose(frame.to_site(first.position_m)[:, :2], thomas_points(DRAWN), atol=1e-8)
    assert np.abs(signed_distances(surface, first.position_m)).max() < 1e-8
    np.testing.assert_array_equal(first.normal, facet_normals(mesh)[first.facet])
    other = thomas_landmarks(mesh, surface, frame, ThomasField(1, 3, 12.0, 10.0, 100.0))
    assert other.position_m.tobytes() != first.position_m.tobytes()


def test_a_field_that_leaves_the_body_is_refused():
    mesh = box((50.0, 50.0, 50.0))
    frame = site_frame([50.0, 25.0, 25.0], [1.0, 0.0, 0.0], "normal")
    with pytest.raises(InputRefused, match=r"fall beside the body.*reduce extent_m"):
        thomas_landmarks(mesh, build_surface_index(mesh), frame, DRAWN)
    with pytest.raises(InputRefused, match="draws no landmark"):
        thomas_landmarks(mesh, build_surface_index(mesh), frame, ThomasField(0, 1, 1e-9, 1.0, 1.0))


def test_listed_landmarks_are_put_on_the_mesh():
    mesh = fibonacci_ellipsoid((100.0, 60.0, 50.0), 400)
    surface = build_surface_index(mesh)
    table = listed(
        ((101.0, 2.0, 3.0), None), (None, (90.0, 0.0)), ((0.0, -57.0, 8.0), None), (None, (270.0, 45.0))
    )
    found = placed_landmarks(table, mesh, surface)
    assert np.abs(signed_distances(surface, found.position_m)).max() < 1e-12
    np.testing.assert_array_equal(found.normal, facet_normals(mesh)[found.facet])
    offsets = np.linalg.norm(found.position_m - table.position_m, axis=1)
    expected = np.abs(signed_distances(surface, table.position_m[[0, 2]]))
    np.testing.assert_allclose(offsets[[0, 2]], expected, rtol=1e-10)
    assert found.position_m[1] == pytest.approx([0.0, 60.0, 0.0], abs=0.6)
    x, y, z = found.position_m[3]
    assert abs(x) < 1e-12 and y < 0 and z == pytest.approx(-y, rel=1e-12)
    assert found.name == ("L001", "L002", "L003", "L004")


def test_a_direction_takes_the_outermost_surface():
    """A box that the origin does not lie in is met twice along +x."""
    mesh = box((10.0, 4.0, 4.0), (5.0, -2.0, -2.0))
    surface = build_surface_index(mesh)
    found = placed_landmarks(listed((None, (0.0, 1.0))), mesh, surface)
    assert found.position_m[0, 0] == pytest.approx(15.0, rel=1e-12)
    with pytest.raises(InputRefused, match=r"list, line 1: no surface lies above .*'L001'"):
        placed_landmarks(listed((None, (180.0, 1.0))), mesh, surface)


def test_a_position_off_the_body_is_refused():
    mesh = fibonacci_ellipsoid((100.0, 60.0, 50.0), 400)
    table = listed(((100.0, 0.0, 0.0), None), ((0.1, 0.06, 0.0), None))
    with pytest.raises(InputRefused, match=r"list, line 2: landmark 'L002' is 4.* m from the surface"):
        placed_landmarks(table, mesh, build_surface_index(mesh))
