"""Lines of a level over facet values: exact circles on spheres, orientation, area, holes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from landing_samples import rock

from landing_cli.body.mesh import Mesh, facet_areas, facet_centroids
from landing_cli.reach.level_set import LevelSet, level_set, split_surface, trace

RADIUS_M = 100.0
AXIS = np.array([1.0, 2.0, 0.5]) / np.linalg.norm([1.0, 2.0, 0.5])
ANGLE = np.radians(50.0)


def sphere(subdivisions: int) -> Mesh:
    return rock(subdivisions, (RADIUS_M, RADIUS_M, RADIUS_M))


def off_axis(points: np.ndarray) -> np.ndarray:
    return np.asarray(np.arccos(points @ AXIS / np.linalg.norm(points, axis=1)))


def cap(subdivisions: int) -> LevelSet:
    """The cap of half-angle 50 degrees, known by the cosine at the centroids."""
    mesh = sphere(subdivisions)
    return level_set(mesh, 1.0 - np.cos(off_axis(facet_centroids(mesh))), 1.0 - np.cos(ANGLE))


def test_the_rim_of_a_cap_is_a_circle_to_second_order() -> None:
    """Four times the facets: a quarter of the error in angle, length and area."""
    coarse, fine = cap(3), cap(4)
    errors = []
    for found in (coarse, fine):
        assert len(found.offsets) == 2
        assert (found.points_m[0] == found.points_m[-1]).all()
        errors.append(
            (
                np.abs(off_axis(found.points_m) - ANGLE).max(),
                abs(found.length_m / (2.0 * np.pi * RADIUS_M * np.sin(ANGLE)) - 1.0),
                abs(found.area_within_m2 / (2.0 * np.pi * RADIUS_M**2 * (1.0 - np.cos(ANGLE))) - 1.0),
            )
        )
    assert (np.array(errors[1]) < [2e-3, 4e-4, 4e-3]).all()
    assert np.array(errors[0]) / np.array(errors[1]) == pytest.approx(4.0, rel=0.12)


def test_lower_values_lie_to_the_left() -> None:
    line = cap(3).line(0)
    middle, along = 0.5 * (line[1:] + line[:-1]), np.diff(line, axis=0)
    assert (np.cross(middle, along) @ AXIS > 0.0).all()


def test_the_lines_lie_on_the_facets() -> None:
    mesh, found = sphere(2), cap(2)
    heights = [np.abs((found.points_m - c[0]) @ np.cross(c[1] - c[0], c[2] - c[0])) for c in mesh.corners]
    assert np.min(heights, axis=0) == pytest.approx(0.0, abs=1e-9 * RADIUS_M**3)


def test_within_and_beyond_make_the_whole_surface() -> None:
    mesh = sphere(2)
    values = np.random.default_rng(1).normal(size=len(mesh.faces))
    within, beyond = level_set(mesh, values, 0.2), level_set(mesh, -values, -0.2)
    assert len(within.offsets) > 5
    whole = facet_areas(mesh).sum()
    assert within.area_within_m2 + beyond.area_within_m2 == pytest.approx(whole, rel=1e-12)
    assert within.length_m == pytest.approx(beyond.length_m, rel=1e-12)
    assert all((within.line(k)[0] == within.line(k)[-1]).all() for k in range(len(within.offsets) - 1))


def test_every_line_parts_its_centroids() -> None:
    """A lone facet below the level among higher ones lies within a small line of its own."""
    mesh = sphere(2)
    values = np.ones(len(mesh.faces))
    values[[3, 200]] = 0.0
    found = level_set(mesh, values, 0.5)
    assert len(found.offsets) == 3
    centroids = facet_centroids(mesh)[[3, 200]]
    near = [np.linalg.norm(found.line(k).mean(axis=0) - centroids, axis=1).min() for k in range(2)]
    assert max(near) < 0.05 * RADIUS_M


def test_lines_end_at_what_is_not_known() -> None:
    mesh = sphere(3)
    values = 1.0 - np.cos(off_axis(facet_centroids(mesh)))
    whole = level_set(mesh, values, 1.0 - np.cos(ANGLE))
    holed = values.copy()
    holed[facet_centroids(mesh)[:, 2] > 30.0] = np.nan
    found = level_set(mesh, holed, 1.0 - np.cos(ANGLE))
    assert 0.2 * whole.length_m < found.length_m < 0.9 * whole.length_m
    assert any((found.line(k)[0] != found.line(k)[-1]).any() for k in range(len(found.offsets) - 1))
    assert (facet_centroids(mesh)[:, 2][~np.isfinite(holed)] > 30.0).all()
    for begin, end in pairwise(found.offsets.tolist()):
        assert end - begin >= 2


def test_no_level_no_line() -> None:
    mesh = sphere(1)
    for values in (np.zeros(len(mesh.faces)), np.full(len(mesh.faces), np.nan)):
        found = level_set(mesh, values, 1.0)
        assert len(found.offsets) == 1
        assert found.length_m == 0.0
        assert found.points_m.shape == (0, 3)


def test_vertices_take_the_plane_through_the_centroids_around() -> None:
    """On a flat patch of any triangles a linear function is kept exactly inside a fan."""
    rng = np.random.default_rng(3)
    ring = np.linspace(0.0, 2.0 * np.pi, 6, endpoint=False) + rng.uniform(-0.3, 0.3, 6)
    rim = np.stack([np.cos(ring), np.sin(ring), np.zeros(6)], axis=1) * rng.uniform(0.6, 1.5, (6, 1))
    vertices = np.concatenate([[[0.1, -0.05, 0.0]], rim, [[0.0, 0.0, -5.0]]])
    top = [[0, 1 + k, 1 + (k + 1) % 6] for k in range(6)]
    bottom = [[7, 1 + (k + 1) % 6, 1 + k] for k in range(6)]
    mesh = Mesh(vertices, np.array(top + bottom))
    values = facet_centroids(mesh) @ np.array([0.7, -1.3, 0.0]) + 2.0
    assert split_surface(mesh, values).values[0] == pytest.approx(
        vertices[0] @ [0.7, -1.3, 0.0] + 2.0, rel=1e-12
    )


def test_several_levels_share_one_split() -> None:
    mesh = sphere(2)
    values = off_axis(facet_centroids(mesh))
    split = split_surface(mesh, values)
    for level in (0.5, 1.0, 1.5):
        assert (trace(split, level).points_m == level_set(mesh, values, level).points_m).all()
