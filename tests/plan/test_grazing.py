"""Sections, grazing tangents and nearest vertices against closed forms, trimesh and brute force."""

from __future__ import annotations

import numpy as np
import pytest
from shape_helpers import box, fibonacci_ellipsoid

from landing_cli.body.bvh import build_surface_index
from landing_cli.body.clearance import signed_distances
from landing_cli.body.mesh import Mesh
from landing_cli.body.plane_section import clip_outline, crossings, grazing_angles, plane_section
from landing_cli.body.vertex_distance import vertex_distances

AXES = np.eye(3)


def lumpy(seed: int = 3) -> Mesh:
    ball = fibonacci_ellipsoid((100.0, 80.0, 60.0), 400)
    return Mesh(ball.vertices * np.random.default_rng(seed).uniform(0.8, 1.2, 400)[:, None], ball.faces)


def in_plane(segments: np.ndarray, origin: np.ndarray, x: np.ndarray, z: np.ndarray) -> np.ndarray:
    return (segments - origin) @ np.stack([x, z], axis=1)


def test_section_of_a_box_is_its_rectangle():
    section = plane_section(box((2.0, 3.0, 4.0)), [0.0, 1.25, 0.0], AXES[1])
    assert np.ptp(section.reshape(-1, 3), axis=0) == pytest.approx([2.0, 0.0, 4.0])
    length = np.linalg.norm(section[:, 1] - section[:, 0], axis=1).sum()
    assert length == pytest.approx(12.0, rel=1e-14)


def test_section_is_that_of_trimesh_and_closed():
    import trimesh

    mesh, rng = lumpy(), np.random.default_rng(1)
    body = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    for _ in range(10):
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        origin = rng.uniform(-20, 20, 3)
        section = plane_section(mesh, origin, normal)
        lines = trimesh.intersections.mesh_plane(body, normal, origin)
        lengths = [np.linalg.norm(s[:, 1] - s[:, 0], axis=1).sum() for s in (section, lines)]
        assert lengths[0] == pytest.approx(lengths[1], rel=1e-10)
        assert np.abs((section - origin) @ normal).max() < 1e-12 * 100
        ends, counts = np.unique(np.round(section.reshape(-1, 3), 7), axis=0, return_counts=True)
        assert len(ends) == len(section) and (counts == 2).all()


def test_tangents_to_a_circle_have_their_closed_form():
    ball = fibonacci_ellipsoid((100.0, 100.0, 100.0), 20000)
    section = plane_section(ball, np.zeros(3), AXES[1])
    for distance in (150.0, 300.0, 3500.0):
        outline = in_plane(section, np.array([-distance, 0.0, 0.0]), AXES[0], AXES[2])
        right, left = grazing_angles(outline, [0.0, 0.0])
        assert left == pytest.approx(np.arcsin(100.0 / distance), rel=3e-3)
        assert right == pytest.approx(-np.arcsin(100.0 / distance), rel=3e-3)


def test_a_ray_above_the_tangent_misses_and_one_below_hits():
    """The tangent separates rays that hit the body (brute force over segments) from those that do not."""
    mesh, rng = lumpy(), np.random.default_rng(5)
    for _ in range(20):
        eye = np.array([-rng.uniform(200, 900), 0.0, rng.uniform(-300, 300)])
        outline = in_plane(plane_section(mesh, np.zeros(3), AXES[1]), eye, AXES[0], AXES[2])
        right, left = grazing_angles(outline, [0.0, 0.0])
        for tangent, outside in ((right, -1.0), (left, 1.0)):
            for step, hit in ((1e-6 * outside, False), (-1e-4 * outside, True)):
                c, s = np.cos(tangent + step), np.sin(tangent + step)
                turned = outline @ np.array([[c, -s], [s, c]])
                assert (crossings(turned, 0.0, np.inf) > 0) == hit


def test_clipping_keeps_what_lies_between():
    rng = np.random.default_rng(8)
    outline = rng.uniform(-1, 1, (500, 2, 2))
    outline[:20, 1, 0] = outline[:20, 0, 0]
    kept = clip_outline(outline, -0.3, 0.5)
    assert kept[..., 0].min() >= -0.3 - 1e-12 and kept[..., 0].max() <= 0.5 + 1e-12
    shares = (np.arange(2000) + 0.5) / 2000
    points = outline[:, None, 0] + shares[:, None] * (outline[:, None, 1] - outline[:, None, 0])
    inside = (points[..., 0] >= -0.3) & (points[..., 0] <= 0.5)
    lengths = np.linalg.norm(outline[:, 1] - outline[:, 0], axis=1)
    expected = (inside.mean(axis=1) * lengths).sum()
    assert np.linalg.norm(kept[:, 1] - kept[:, 0], axis=1).sum() == pytest.approx(expected, rel=1e-4)


def test_vertex_distance_is_that_of_every_vertex():
    mesh = lumpy()
    surface = build_surface_index(mesh)
    points = np.random.default_rng(6).uniform(-300, 300, (2000, 3))
    brute = np.linalg.norm(points[:, None] - mesh.vertices, axis=2).min(axis=1)
    np.testing.assert_allclose(vertex_distances(surface, points), brute, rtol=1e-13)
    assert (np.abs(signed_distances(surface, points)) <= brute * (1 + 1e-13)).all()


def test_what_lies_behind_the_eye_is_not_grazed():
    outline = np.array([[[2.0, 1.0], [3.0, -0.5]], [[-1.0, 5.0], [-0.1, -7.0]]])
    right, left = grazing_angles(outline, [0.0, 0.0])
    assert (right, left) == (np.arctan2(-0.5, 3.0), np.arctan2(1.0, 2.0))
    assert np.isnan(grazing_angles(outline, [10.0, 0.0])).all()
