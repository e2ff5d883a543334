"""Rays against a mesh, held to every facet one by one, to a closed form, and to embree."""

from __future__ import annotations

import numpy as np
import pytest
from shape_helpers import box, fibonacci_ellipsoid

from landing_cli.body.bvh import build_surface_index
from landing_cli.body.mesh import Mesh, facet_centroids, facet_normals
from landing_cli.body.ray_cast import first_hits, is_obstructed
from landing_cli.sources.shape_files import read_mesh


def lumpy(count: int = 700) -> Mesh:
    ball = fibonacci_ellipsoid((1.0, 1.0, 1.0), count)
    u = ball.vertices
    lumps = 1.0 + 0.25 * np.sin(7 * u[:, 0]) * np.cos(5 * u[:, 1] + 1.0) * np.sin(6 * u[:, 2] + 2.0)
    return Mesh(u * lumps[:, None] * [160.0, 80.0, 60.0], ball.faces)


def hits_on_every_facet(mesh: Mesh, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Shares of the direction at which a ray meets each facet, by solving for it; NaN where it does not."""
    a, b, c = np.moveaxis(mesh.corners, 1, 0)
    columns = np.stack([b - a, c - a, np.broadcast_to(-direction, a.shape)], axis=2)
    u, v, share = np.linalg.solve(columns, (origin - a)[:, :, None])[:, :, 0].T
    return np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (share > 0), share, np.nan)


def rays_through(mesh: Mesh, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """From a shell around the body, and from inside it, in every direction that has a chance."""
    rng = np.random.default_rng(seed)
    reach = np.abs(mesh.vertices).max(axis=0)
    origins = rng.normal(size=(count, 3))
    origins *= reach * rng.uniform(0.1, 2.5, (count, 1)) / np.linalg.norm(origins, axis=1, keepdims=True)
    return origins, rng.uniform(-0.8, 0.8, (count, 3)) * reach - origins


@pytest.fixture(scope="module")
def body() -> Mesh:
    return lumpy()


def test_first_hits_are_those_of_looking_at_every_facet(body):
    surface = build_surface_index(body)
    origins, directions = rays_through(body, 400, 1)
    shares, facets = first_hits(surface, origins, directions)
    for origin, direction, share, facet in zip(origins, directions, shares, facets, strict=True):
        each = hits_on_every_facet(body, origin, direction)
        if np.isnan(each).all():
            assert share == np.inf and facet == -1
        else:
            assert facet == np.nanargmin(each)
            assert share == pytest.approx(np.nanmin(each), rel=1e-11, abs=0)
    assert 50 < (facets >= 0).sum() < 400 or (facets >= 0).all()


def test_no_ray_slips_between_facets(body):
    """Rays at vertices and at points of edges, where rounding would open gaps, from inside."""
    surface = build_surface_index(body)
    rng = np.random.default_rng(2)
    ends = np.concatenate([body.vertices, body.corners[:, :2].mean(axis=1)])
    origins = rng.uniform(-5.0, 5.0, ends.shape)
    shares, facets = first_hits(surface, origins, ends - origins)
    assert (facets >= 0).all()
    assert (shares < 1.0 + 1e-12).all()


def test_rays_along_the_facets_of_a_box():
    surface = build_surface_index(box((2.0, 3.0, 4.0)))
    origins = np.array([[-1.0, 1, 2], [-1, 1, 2], [-1, -1e-9, 2], [1, 1.5, 9], [1, 1.5, 2]])
    directions = np.array([[2.0, 0, 0], [-1, 0, 0], [1, 0, 0], [0, 0, -0.5], [0, 0, 1]])
    shares, facets = first_hits(surface, origins, directions)
    np.testing.assert_allclose(shares, [0.5, np.inf, np.inf, 10.0, 2.0], rtol=1e-15)
    assert ((facets >= 0) == [True, False, False, True, True]).all()


def test_the_offset_frees_the_ends_and_nothing_else():
    surface = build_surface_index(box((2.0, 3.0, 4.0)))
    top, above, below, beside = [1.0, 1.0, 4.0], [1.0, 1.0, 9.0], [1.0, 1.0, -5.0], [1.0, 1.0, 4.05]
    starts, ends = np.array([top, top, above, top]), np.array([above, below, below, beside])
    assert is_obstructed(surface, starts, ends, 0.05).tolist() == [False, True, True, False]
    assert is_obstructed(surface, ends, starts, 0.05).tolist() == [False, True, True, False]


def test_a_convex_body_hides_no_facet_that_faces_the_eye():
    mesh = fibonacci_ellipsoid((300.0, 200.0, 150.0), 400)
    surface = build_surface_index(mesh)
    rng = np.random.default_rng(6)
    eyes = rng.normal(size=(len(mesh.faces), 3))
    eyes *= 700.0 / np.linalg.norm(eyes, axis=1, keepdims=True)
    marks = facet_centroids(mesh)
    cosine = ((eyes - marks) * facet_normals(mesh)).sum(axis=1) / np.linalg.norm(eyes - marks, axis=1)
    faces, clear_of_edge = cosine > 0.0, np.abs(cosine) > 0.01
    for one, other in ((marks, eyes), (eyes, marks)):
        hidden = is_obstructed(surface, one, other, 0.05)
        np.testing.assert_array_equal(hidden[clear_of_edge], ~faces[clear_of_edge])


def test_a_line_along_a_face_does_not_meet_it():
    """Whatever rounding makes of a direction in the plane of a turned box's top."""
    turn = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    mesh = Mesh(box((2.0, 3.0, 4.0)).vertices @ turn, box((2.0, 3.0, 4.0)).faces)
    rng = np.random.default_rng(8)
    ends = np.concatenate([rng.uniform([0.1, 0.1], [1.9, 2.9], (4000, 2)), np.full((4000, 1), 4.0)], axis=1)
    starts, ends = (ends @ turn).reshape(2, -1, 3)
    assert not is_obstructed(build_surface_index(mesh), starts, ends, 1e-3).any()


def test_obstruction_is_a_hit_within_the_segment(body):
    surface = build_surface_index(body)
    starts, directions = rays_through(body, 600, 3)
    ends = starts + np.random.default_rng(4).uniform(0.2, 2.5, (600, 1)) * directions
    lengths = np.linalg.norm(ends - starts, axis=1)
    expected = []
    for start, end, length in zip(starts, ends, lengths, strict=True):
        each = hits_on_every_facet(body, start, end - start) * length
        expected.append(bool(((each > 0.05) & (each < length - 0.05)).any()))
    assert 100 < np.count_nonzero(expected) < 580
    assert is_obstructed(surface, starts, ends, 0.05).tolist() == expected


def test_first_hits_agree_with_embree(reference_shapes):
    """Embree works in single precision: about a millimetre on Eros."""
    import trimesh

    mesh = read_mesh(reference_shapes / "eros_near_3897.obj", "km")
    origins, directions = rays_through(mesh, 2000, 5)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    distance, facets = first_hits(build_surface_index(mesh), origins, directions)
    body = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    oracle = body.ray.intersects_first(origins, directions)
    along_edges = facets != oracle
    assert np.count_nonzero(along_edges) <= 2
    assert np.isfinite(distance[facets >= 0]).all()
