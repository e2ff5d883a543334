"""The frame at the site: its axes by their meaning."""

from __future__ import annotations

import numpy as np
import pytest

from landing_cli.body.mesh import facet_centroids, facet_normals
from landing_cli.errors import InputRefused
from landing_cli.observe.site_frame import site_frame
from landing_cli.sources.shape_files import read_mesh

SITE, NORMAL = np.array([3000.0, 4000.0, 1200.0]), np.array([0.0, 3.0, 4.0])


@pytest.mark.parametrize("kind", ["radial", "normal"])
def test_axes_are_east_north_up(kind):
    frame = site_frame(SITE, NORMAL, kind, 7)
    x, y, z = frame.axes
    np.testing.assert_allclose(frame.axes @ frame.axes.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(np.cross(x, y), z, atol=1e-15)
    assert x[2] == 0.0 and np.cross([0, 0, 1], z) @ x > 0 and y[2] > 0
    np.testing.assert_allclose(
        z, SITE / np.linalg.norm(SITE) if kind == "radial" else [0, 0.6, 0.8], rtol=1e-15
    )
    np.testing.assert_allclose(frame.normal, [0, 0.6, 0.8], rtol=1e-15)
    assert frame.facet == 7


def test_positions_there_and_back():
    frame = site_frame(SITE, NORMAL, "radial")
    points = np.random.default_rng(0).normal(size=(20, 3)) * 500.0
    np.testing.assert_allclose(frame.to_site(frame.to_body(points)), points, atol=1e-11)
    np.testing.assert_allclose(frame.to_site(SITE), np.zeros(3), atol=0)
    up = frame.to_site(SITE * 1.1)
    np.testing.assert_allclose(up, [0, 0, 0.1 * np.linalg.norm(SITE)], atol=1e-12)


@pytest.mark.parametrize(
    ("site", "normal", "kind", "told"),
    [
        ([0.0, 0.0, 900.0], [1.0, 0.0, 1.0], "radial", "take the normal frame"),
        ([10.0, 0.0, 900.0], [0.0, 0.0, -2.0], "normal", "take the radial frame"),
        ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], "radial", "no radial direction"),
    ],
)
def test_a_site_without_east_is_refused(site, normal, kind, told):
    with pytest.raises(InputRefused, match=told):
        site_frame(site, normal, kind)


def test_radial_and_normal_differ_on_eros_as_the_note_says(reference_shapes):
    """16.4, 43.4 and 70.7 deg at 5, 50 and 95 % of the facets (the note: 17, 43, 71)."""
    mesh = read_mesh(reference_shapes / "eros_near_3897.obj", "km")
    out, normal = facet_centroids(mesh), facet_normals(mesh)
    cosine = (out * normal).sum(axis=1) / np.linalg.norm(out, axis=1)
    angle = np.degrees(np.arccos(cosine))
    found = np.percentile(angle, [5, 50, 95])
    np.testing.assert_allclose(found, [16.36, 43.36, 70.65], atol=0.01)
