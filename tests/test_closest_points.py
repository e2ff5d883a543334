"""Closest points of triangles against trimesh."""

from __future__ import annotations

import numpy as np
import trimesh

from landing_cli.body.closest_points import closest_points


def test_closest_points_are_those_of_trimesh() -> None:
    rng = np.random.default_rng(6)
    corners, points = rng.normal(size=(3000, 3, 3)), 2.0 * rng.normal(size=(3000, 3))
    found = closest_points(corners, points)
    expected = trimesh.triangles.closest_point(corners, points)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert len({tuple(np.round(p, 9)) for p in found - points}) > 2900
