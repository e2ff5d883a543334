"""Where walls off the terrain stand: points of flights, closest points, rays and frames by other means."""

from __future__ import annotations

import numpy as np
import pytest
from landing_samples import asteroid, landing_case, rock

from landing_cli.body.adjacency import mean_edge_m
from landing_cli.body.bvh import build_surface_index
from landing_cli.body.mesh import Mesh, facet_centroids, facet_normals
from landing_cli.reach.scaled_case import ScaledCase, scale_case
from landing_cli.reach.terrain_walls import ARC_POINTS, Flown, Terrain, Way, look_below, walls_along

N = 12
RADIUS_M = 250.0
FACET = 17


def ball() -> Mesh:
    return rock(3, (RADIUS_M, RADIUS_M, RADIUS_M))


def over(mesh: Mesh) -> Terrain:
    return Terrain(
        build_surface_index(mesh), mesh.corners, facet_centroids(mesh), facet_normals(mesh), mean_edge_m(mesh)
    )


def flights(terrain: Terrain, scaled: ScaledCase, below_m: float) -> tuple[Flown, np.ndarray, np.ndarray]:
    """Two flights to one facet: one in from afar, one that dips below the ball's far side first."""
    start = scaled.position * scaled.length_m
    target, normal = terrain.centroids_m[FACET], terrain.normals[FACET]
    handover = np.array([*(target + 120.0 * normal), *(-0.8 * normal), 1990.0])
    t = np.linspace(0.0, 1.0, N + 1)[:, None]
    above = (1 - t) * start + t * handover[:3]
    dip = above / np.linalg.norm(above, axis=1)[:, None] * (RADIUS_M - below_m)
    position = np.stack([above, np.where((t > 0.4) & (t < 0.8), dip, above)]) / scaled.length_m
    handovers = np.stack([handover, handover])
    landing = np.array([FACET, FACET])
    return look_below(terrain, scaled, landing, position, handovers, 200.0), position, handovers


@pytest.fixture(scope="module")
def scaled() -> ScaledCase:
    return scale_case(landing_case(asteroid(ball(), spin=8.0)), N)


@pytest.fixture(scope="module")
def terrain() -> Terrain:
    return over(ball())


def turned(scaled: ScaledCase, k: int, v: np.ndarray) -> np.ndarray:
    """A vector in solver axes seen from the body at node k."""
    c, s = scaled.node_cos[k], scaled.node_sin[k]
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ v


def test_points_are_the_nodes_seen_from_the_body_and_the_arc_to_the_touchdown(
    terrain: Terrain, scaled: ScaledCase
) -> None:
    flown, position, handovers = flights(terrain, scaled, 30.0)
    assert flown.node.tolist() == [*range(1, N), *[0] * ARC_POINTS]
    for k in range(1, N):
        expected = turned(scaled, k, position[1, k] * scaled.length_m)
        np.testing.assert_allclose(flown.points_m[1, k - 1], expected, rtol=0, atol=1e-9)
    arc = flown.points_m[0, N - 1 :]
    np.testing.assert_allclose(arc[0], handovers[0, :3], rtol=0, atol=1e-9)
    # a cubic in the time-to-go that ends at rest on the target: its values and slopes at both ends
    seconds = 200.0 * flown.fraction[N - 1 :]
    cubic = np.polynomial.Polynomial.fit(seconds, arc @ terrain.normals[FACET], 3).convert()
    target = float(terrain.centroids_m[FACET] @ terrain.normals[FACET])
    assert cubic(0.0) == pytest.approx(target, abs=1e-7)
    assert cubic.deriv()(0.0) == pytest.approx(0.0, abs=1e-8)
    assert -cubic.deriv()(200.0) == pytest.approx(-0.8, abs=1e-9)
    np.testing.assert_allclose(
        np.linalg.norm(flown.points_m - flown.closest_m, axis=2), np.abs(flown.distance_m), atol=1e-9
    )


def wall_at(scaled: ScaledCase, walls: object, row: int, node: int) -> tuple[np.ndarray, float]:
    """Unit normal in body axes and offset (m) of the wall at a node."""
    place = int(np.flatnonzero(walls.node[row, : walls.walls[row]] == node)[0])  # type: ignore[attr-defined]
    n, offset = walls.normal[row, place], walls.offset[row, place]  # type: ignore[attr-defined]
    size = np.linalg.norm(n)
    assert size == pytest.approx(scaled.inverse_axes.max(), rel=1e-12)
    return turned(scaled, node, n / size), offset / size * scaled.length_m


def test_points_in_rock_are_led_out_along_the_way(terrain: Terrain, scaled: ScaledCase) -> None:
    flown, _, _ = flights(terrain, scaled, 30.0)
    margin = np.array([0.0, 2.0])
    inside = np.flatnonzero(flown.distance_m[1] < 0.0)
    assert len(inside) >= 3
    middle = int(inside[len(inside) // 2])
    point = flown.points_m[1, middle]
    outward = point / np.linalg.norm(point)
    for way in Way:
        walls = walls_along(terrain, scaled, flown, way, 20.0, margin)
        n, offset = wall_at(scaled, walls, 1, int(flown.node[middle]))
        depth = offset - n @ point  # how far the wall leads the point, less the margin
        if way in (Way.CLOSEST, Way.OUTWARD):
            np.testing.assert_allclose(n, outward, rtol=0, atol=0.1)
            assert depth == pytest.approx(32.0, abs=1.5)
        elif way is Way.NORMAL:
            np.testing.assert_allclose(n, terrain.normals[FACET], rtol=0, atol=1e-12)
            assert depth > 31.0
        else:
            assert abs(n @ outward) < 0.25
            assert depth > 90.0  # sideways it is far to the surface
    left, right = (walls_along(terrain, scaled, flown, w, 20.0, margin) for w in (Way.LEFT, Way.RIGHT))
    one, other = (wall_at(scaled, w, 1, int(flown.node[middle]))[0] for w in (left, right))
    np.testing.assert_allclose(one, -other, rtol=0, atol=1e-12)


def test_points_above_the_surface_keep_to_their_side_of_a_plane_that_touches_it(
    terrain: Terrain, scaled: ScaledCase
) -> None:
    flown, _, _ = flights(terrain, scaled, -5.0)  # 5 m above
    assert (flown.distance_m > 0.0).all()
    walls = walls_along(terrain, scaled, flown, Way.OUTWARD, 20.0, np.zeros(2))
    low = np.flatnonzero((flown.distance_m[1] < 20.0) & (flown.node > 0))
    assert len(low) >= 3
    for c in low:
        n, offset = wall_at(scaled, walls, 1, int(flown.node[c]))
        assert n @ flown.points_m[1, c] - offset == pytest.approx(flown.distance_m[1, c], abs=1e-8)
        # the ball is convex: all of it lies behind the plane
        assert (terrain.corners_m.reshape(-1, 3) @ n).max() == pytest.approx(offset, abs=1e-8)
    assert walls.walls[0] < walls.walls[1]


def test_the_facet_to_land_on_gets_no_wall_by_the_touchdown(terrain: Terrain, scaled: ScaledCase) -> None:
    flown, _, _ = flights(terrain, scaled, 30.0)
    walls = walls_along(terrain, scaled, flown, Way.CLOSEST, 20.0, np.zeros(2))
    fractions = walls.fraction[0, : walls.walls[0]]
    nearest = np.linalg.norm(flown.points_m[0] - terrain.centroids_m[FACET], axis=1)
    landing = nearest[flown.node == 0] <= terrain.mean_edge_m
    assert landing.sum() >= 5
    assert not np.isin(flown.fraction[flown.node == 0][landing], fractions).any()
