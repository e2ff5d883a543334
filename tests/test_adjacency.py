"""Claims about edges and neighbours."""

from __future__ import annotations

import numpy as np
import pytest
from shape_helpers import box, fibonacci_ellipsoid, tetrahedron

from landing_cli.body.adjacency import edges, equilateral_height_m, facet_neighbours, mean_edge_m
from landing_cli.body.mesh import Mesh
from landing_cli.errors import InputRefused


def test_the_neighbour_across_edge_i_holds_that_edge_reversed():
    mesh = fibonacci_ellipsoid((3.0, 2.0, 1.0), 200)
    neighbours = facet_neighbours(mesh)
    for facet, row in enumerate(neighbours):
        for i, other in enumerate(row):
            a, b = mesh.faces[facet, i], mesh.faces[facet, (i + 1) % 3]
            assert [b, a] in [[mesh.faces[other, k], mesh.faces[other, (k + 1) % 3]] for k in range(3)]
            assert other != facet


def test_a_closed_surface_of_n_vertices_has_3n_minus_6_edges_each_once():
    mesh = fibonacci_ellipsoid((3.0, 2.0, 1.0), 200)
    pairs = edges(mesh)
    assert pairs.shape == (3 * 200 - 6, 2)
    assert len(np.unique(pairs, axis=0)) == len(pairs)
    assert (pairs[:, 0] < pairs[:, 1]).all()


def test_an_open_surface_is_refused_with_the_edge():
    mesh = tetrahedron()
    with pytest.raises(InputRefused, match=r"facet 0: .* open at the edge from vertex 2 to vertex 1"):
        facet_neighbours(Mesh(mesh.vertices, mesh.faces[:3]))


def test_lengths_of_the_unit_cube():
    cube = box((1.0, 1.0, 1.0))
    assert mean_edge_m(cube) == pytest.approx((12 + 6 * np.sqrt(2)) / 18, rel=1e-14)
    assert equilateral_height_m(cube) == pytest.approx(np.sqrt(np.sqrt(3) / 2), rel=1e-14)
