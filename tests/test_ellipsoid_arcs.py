from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import from_python
from landing_samples import asteroid, landing_case

from landing_cli.reach.ellipsoid_arcs import (
    arc_cuts,
    freeze_on_path,
    last_cut_node as last_cut_node_part,
    lowest_level,
    lowest_levels_between,
)
from landing_cli.reach.records import LandingCase
from landing_cli.reach.scaled_case import (
    ScaledCase,
    ellipsoid_level as ellipsoid_level_part,
    ellipsoid_normal as ellipsoid_normal_part,
    scale_case,
)
from landing_cli.reach.shooting import SUBSTEPS, fly_accurately as fly_accurately_part

ellipsoid_level = from_python(ellipsoid_level_part)
ellipsoid_normal = from_python(ellipsoid_normal_part)
fly_accurately = from_python(fly_accurately_part)
last_cut_node = from_python(last_cut_node_part)

N = 20


def spinning_case(**changes) -> LandingCase:
    return landing_case(asteroid(spin=6.0), **changes)


def level(scaled: ScaledCase, k: int, x: np.ndarray) -> float:
    return ellipsoid_level(scaled, scaled.node_cos[k], scaled.node_sin[k], *x)


def xi_of(case: LandingCase, scaled: ScaledCase, k: int, x: np.ndarray) -> np.ndarray:
    """Position at node k over the semi-axes, in the body's axes at that time."""
    angle = -case.asteroid.rotation_rate_rad_s * case.descent_s * (k / N - 1.0)
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ x * scaled.length_m / case.ellipsoid_m


def straight_path(scaled: ScaledCase, depth: float) -> np.ndarray:
    """From the start past the centre, at ``depth`` of the ellipsoid, and out on the other side."""
    start = scaled.position
    side = np.cross(start, [0.0, 0.0, 1.0])
    side *= depth / (np.linalg.norm(side) * np.linalg.norm(scaled.inverse_axes) / np.sqrt(3))
    end = -0.7 * start
    t = np.linspace(0, 1, N + 1)[:, None]
    return start + t * (end - start) + side


def test_the_level_is_the_length_of_xi_in_the_turning_body() -> None:
    case = spinning_case()
    scaled = scale_case(case, N)
    for k, x in enumerate(straight_path(scaled, 0.4)):
        assert level(scaled, k, x) == pytest.approx(np.linalg.norm(xi_of(case, scaled, k, x)), rel=1e-13)


def test_the_normal_is_the_gradient_of_the_level() -> None:
    scaled = scale_case(spinning_case(), N)
    for k, x in enumerate(straight_path(scaled, 0.4)):
        normal = np.array(ellipsoid_normal(scaled, scaled.node_cos[k], scaled.node_sin[k], *x))
        step = 1e-6 * np.eye(3)
        slope = [(level(scaled, k, x + d) - level(scaled, k, x - d)) / 2e-6 for d in step]
        np.testing.assert_allclose(normal, slope, rtol=0, atol=1e-8)
        assert normal @ x == pytest.approx(level(scaled, k, x), rel=1e-13)


@pytest.mark.parametrize("handover", ["outside", "on_ellipsoid"])
def test_the_lowest_level_spares_the_start_and_a_handover_that_has_its_own_row(handover: str) -> None:
    scaled = scale_case(spinning_case(handover=handover), N)
    path = straight_path(scaled, 0.4)
    levels = np.array([level(scaled, k, x) for k, x in enumerate(path)])
    assert lowest_level(scaled, path) == pytest.approx(levels.min(), rel=1e-14)
    path[-1] = 0.1 * path[-1]  # deepest of all, at the handover
    deepest = level(scaled, N, path[-1])
    assert deepest < levels.min()
    expected = deepest if handover == "outside" else levels[:-1].min()
    assert lowest_level(scaled, path) == pytest.approx(expected, rel=1e-14)
    path[0] = 0.001 * path[0]
    assert lowest_level(scaled, path) == pytest.approx(expected, rel=1e-14)
    assert last_cut_node(scaled, path) == (N if handover == "outside" else N - 1)


def test_between_the_nodes_the_level_is_that_of_a_dense_flight() -> None:
    """Where a dip falls between the samples, a parabola finds it."""
    case = spinning_case()
    scaled = scale_case(case, N)
    times = np.linspace(0, N, 40 * N + 1)
    between = 0
    for depth in np.linspace(0.4, 0.8, 5):
        thrust = np.zeros((N, 3))
        aim = np.cross(scaled.position, [0.0, 0.0, 1.0]) * depth - scaled.position
        thrust[: N // 2] = 0.9 * aim / np.linalg.norm(aim)
        thrust[N // 2 :] = 0.95 * scaled.position / np.linalg.norm(scaled.position)
        dense, found = np.zeros((40 * N + 1, 7)), np.zeros(1)
        fly_accurately(scaled, thrust, dense)
        levels = [np.linalg.norm(xi_of(case, scaled, t, x)) for t, x in zip(times, dense[:, :3], strict=True)]
        lowest_levels_between(scaled, thrust[None], found)
        assert found[0] == pytest.approx(min(levels), abs=2e-5)
        between += min(levels) < min(levels[:: 40 // SUBSTEPS]) - 1e-4
    assert between >= 2


def planes(scaled: ScaledCase, path: np.ndarray, side: float) -> tuple[np.ndarray, np.ndarray]:
    nodes, normals = np.zeros(N + 1, dtype=np.int64), np.zeros((N + 1, 3))
    count = arc_cuts(scaled, path, side, nodes, normals)
    return nodes[:count], normals[:count]


def touching_points(
    case: LandingCase, scaled: ScaledCase, nodes: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """Where each plane touches the unit sphere of xi: a normal n in solver axes is that of u/axes, turned."""
    found = []
    for k, n in zip(nodes, normals, strict=True):
        turned = xi_of(case, scaled, k, n) * case.ellipsoid_m / scaled.length_m  # n in the body's axes
        found.append(turned / scaled.inverse_axes)
    return np.array(found)


@pytest.mark.parametrize("depth", [0.15, 0.5, 0.9])
def test_planes_touch_the_ellipsoid_along_an_arc_on_the_side_of_the_path(depth: float) -> None:
    case = spinning_case()
    scaled = scale_case(case, N)
    path = straight_path(scaled, depth)
    nodes, normals = planes(scaled, path, 1.0)
    points = touching_points(case, scaled, nodes, normals)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1.0, rtol=1e-12)
    assert np.array_equal(nodes, np.arange(nodes[0], nodes[-1] + 1))
    inside = [k for k in range(1, N + 1) if level(scaled, k, path[k]) < 1.0]
    assert nodes[0] <= inside[0] - 1
    assert nodes[-1] >= min(N, inside[-1] + 1)
    deepest = min(inside, key=lambda k: level(scaled, k, path[k]))
    on_path = xi_of(case, scaled, deepest, path[deepest])
    middle = points[len(points) // 2]
    assert middle @ on_path > 0.0
    # the arc advances evenly
    inner = points[1:-1]
    angles = np.arccos(np.clip(np.sum(inner[1:] * inner[:-1], axis=1), -1, 1))
    np.testing.assert_allclose(angles, angles.mean(), rtol=1e-6)


def test_the_other_side_is_the_mirror_image_of_the_arc() -> None:
    case = spinning_case()
    scaled = scale_case(case, N)
    path = straight_path(scaled, 0.3)
    nodes, there = planes(scaled, path, 1.0)
    others, back = planes(scaled, path, -1.0)
    np.testing.assert_array_equal(nodes, others)
    one = touching_points(case, scaled, nodes, there)
    other = touching_points(case, scaled, others, back)
    middle = len(one) // 2
    assert one[middle] @ other[middle] < 0.0


def test_frozen_planes_touch_under_the_path_and_join_where_it_is_low() -> None:
    case = spinning_case()
    scaled = scale_case(case, N)
    path = straight_path(scaled, 0.6)
    nodes, normals = np.zeros(N + 1, dtype=np.int64), np.zeros((N + 1, 3))
    nodes[:2] = 3, 8  # two that exist
    count = freeze_on_path(scaled, path, nodes, normals, 2, 1.1)
    low = {k for k in range(1, N + 1) if level(scaled, k, path[k]) < 1.1}
    assert set(nodes[:count]) == {3, 8} | low
    assert len(set(nodes[:count])) == count
    for k, n in zip(nodes[:count], normals[:count], strict=True):
        assert n @ path[k] == pytest.approx(level(scaled, k, path[k]), rel=1e-12)


@pytest.mark.parametrize("handover", ["outside", "on_ellipsoid"])
def test_a_path_that_goes_in_and_stays_gets_planes_up_to_the_end(handover: str) -> None:
    scaled = scale_case(spinning_case(handover=handover), N)
    t = np.linspace(0, 1, N + 1)[:, None]
    path = scaled.position * (1.0 - 0.9 * t)
    path = path + 0.01 * np.cross(scaled.position, [0.0, 0.0, 1.0])
    nodes, normals = planes(scaled, path, 1.0)
    assert nodes[-1] == last_cut_node(scaled, path)
    assert np.isfinite(normals).all()


def test_a_path_through_the_very_centre_still_gets_planes() -> None:
    scaled = scale_case(landing_case(asteroid(spin=0.0)), N)
    path = scaled.position * np.linspace(1, -1, N + 1)[:, None]
    for side in (1.0, -1.0):
        nodes, normals = planes(scaled, path, side)
        assert len(nodes) > 3
        assert np.isfinite(normals).all()
        assert (np.linalg.norm(normals, axis=1) > 0.0).all()
