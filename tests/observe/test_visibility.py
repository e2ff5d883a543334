"""What is seen: each test of a sight line by itself, and all of them on Eros."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from seeing_samples import landmarks_at, observe_case, path_through, sensor
from shape_helpers import box

from landing_cli.body.bvh import build_surface_index
from landing_cli.body.mesh import Mesh, facet_centroids, facet_normals
from landing_cli.observe.features import ThomasField, thomas_landmarks
from landing_cli.observe.records import REJECTIONS, ObserveCase, SiteFrame
from landing_cli.observe.site_frame import site_frame
from landing_cli.observe.visibility import (
    RAY_OFFSET_M,
    boresights,
    clear_lines,
    seen_along,
    seen_at,
    sensor_times,
    sunlit_lines,
    unseen_reason,
)
from landing_cli.sources.shape_files import read_mesh

SITE_FACET = 6551


def table_with_a_wall() -> Mesh:
    """A slab of 200 x 200 x 20 m with its top at z = 0, and a wall, 10 m high, on its edge x = 90 to 100."""
    xs, top, base, wall = (-100.0, 90.0, 100.0), 0.0, -20.0, 10.0
    outline = [(xs[0], base), (xs[2], base), (xs[2], wall), (xs[1], wall), (xs[1], top), (xs[0], top)]
    front = np.array([[x, -100.0, z] for x, z in outline])
    vertices = np.concatenate([front, front + np.array([0.0, 200.0, 0.0])])
    cap = [[0, 4, 5], [0, 1, 4], [1, 2, 4], [2, 3, 4]]
    faces = [*cap, *([c + 6, b + 6, a + 6] for a, b, c in cap)]
    for i in range(6):
        j = (i + 1) % 6
        faces += [[i, i + 6, j], [j, i + 6, j + 6]]
    return Mesh(vertices, np.array(faces))


def on_the_table(points: list[list[float]], **changes: object) -> ObserveCase:
    mesh = table_with_a_wall()
    frame = SiteFrame(np.zeros(3), np.eye(3), "normal", -1, np.array([0.0, 0.0, 1.0]))
    return observe_case(mesh, landmarks_at(mesh, points), [0.0, 0.0, 0.0], frame=frame, **changes)


@pytest.fixture(scope="module")
def eros(request: pytest.FixtureRequest) -> ObserveCase:
    folder = request.getfixturevalue("reference_shapes")
    mesh = read_mesh(folder / "eros_near_3897.obj", "km")
    site = facet_centroids(mesh)[SITE_FACET]
    frame = site_frame(site, facet_normals(mesh)[SITE_FACET], "radial", SITE_FACET)
    drawn = ThomasField(seed=5, clusters=12, mean_per_cluster=10.0, spread_m=150.0, extent_m=2500.0)
    landmarks = thomas_landmarks(mesh, build_surface_index(mesh), frame, drawn)
    return observe_case(mesh, landmarks, site, frame=frame)


def test_the_solid_is_closed_and_wound_outwards():
    mesh = table_with_a_wall()
    volume = np.einsum("ij,ij->i", mesh.corners[:, 0], np.cross(mesh.corners[:, 1], mesh.corners[:, 2]))
    assert volume.sum() / 6.0 == pytest.approx(200.0 * (200.0 * 20.0 + 10.0 * 10.0), rel=1e-12)


def test_sensor_times_are_its_own_and_the_touchdown():
    np.testing.assert_array_equal(sensor_times(sensor(rate_hz=0.5), 5.0), [0.0, 2.0, 4.0, 5.0])
    np.testing.assert_array_equal(sensor_times(sensor(rate_hz=0.5), 6.0), [0.0, 2.0, 4.0, 6.0])
    np.testing.assert_allclose(sensor_times(sensor(rate_hz=10.0), 0.3), [0.0, 0.1, 0.2, 0.3], rtol=1e-15)
    for tof in (799.9999, 800.0, 800.0 * (1 + 1e-15)):
        times = sensor_times(sensor(rate_hz=3.0), tof)
        assert times[-1] == tof and (np.diff(times) > 1e-6).all()


@pytest.mark.parametrize(
    ("changes", "seen", "reason"),
    [
        ({"half_field_of_view_rad": math.radians(30.1)}, True, None),
        ({"half_field_of_view_rad": math.radians(29.9)}, False, "field_of_view"),
        ({"range_max_m": 115.5}, True, None),
        ({"range_max_m": 115.4}, False, "range"),
        ({"range_min_m": 115.4}, True, None),
        ({"range_min_m": 115.5}, False, "range"),
        ({"emission_max_rad": math.radians(30.1)}, True, None),
        ({"emission_max_rad": math.radians(29.9)}, False, "emission"),
        ({"incidence_max_rad": math.radians(60.1)}, True, None),
        ({"incidence_max_rad": math.radians(59.9)}, False, "incidence"),
        ({"incidence_max_rad": math.radians(59.9), "kind": "lidar"}, True, None),
    ],
)
def test_each_limit_at_its_edge(changes, seen, reason):
    """From 100 m above the site, a landmark 57.735 m beside it is 115.470 m away and 30 deg off nadir."""
    sun = np.array([-math.sin(math.radians(60.0)), 0.0, math.cos(math.radians(60.0))])
    case = on_the_table([[-100.0 / math.sqrt(3.0), 0.0, 0.0]], sensor=sensor(**changes), sun_direction=sun)
    found = seen_at(case, np.zeros(1), np.array([[0.0, 0.0, 100.0]]))
    assert found.visible.tolist() == [[seen]]
    assert dict(found.rejected) == {name: int(name == reason) for name in REJECTIONS}
    assert found.lit == (case.sensor.kind == "camera")


def test_terrain_hides_what_lies_behind_it_and_casts_shadows():
    """From 20 m high, 110 m beyond the wall's far edge at x = 90, the ground is hidden to x = -20."""
    points = [[x, 0.0, 0.0] for x in (-20.5, -19.5, 50.0, 89.0)]
    case = on_the_table(points)
    eye = np.array([[200.0, 0.0, 20.0]])
    assert clear_lines(case, eye).tolist() == [[True, False, False, False]]
    found = seen_at(replace(case, sensor=sensor(half_field_of_view_rad=math.radians(89.9))), np.zeros(1), eye)
    assert found.rejected["occlusion"] == 3
    low = np.array([20.0, 0.0, 2.0]) / math.sqrt(404.0)  # the wall's shadow is 100 m long, to x = -10
    points = [[x, 0.0, 0.0] for x in (-10.5, -9.5, 50.0, 89.0)]
    case = on_the_table(points, sun_direction=low)
    assert sunlit_lines(case, np.zeros(1)).tolist() == [[True, False, False, False]]
    found = seen_at(case, np.zeros(1), np.array([[0.0, 0.0, 100.0]]))
    assert found.visible.tolist() == [[True, False, False, False]]
    assert found.rejected["shadow"] == 3


def test_the_sun_turns_backwards_with_the_body():
    """Half a turn later the sun that stood behind the wall stands opposite, and the ground is lit."""
    low = np.array([20.0, 0.0, 2.0]) / math.sqrt(404.0)
    case = on_the_table([[50.0, 0.0, 0.0]], sun_direction=low)
    turn = 2.0 * math.pi / case.asteroid.rotation_rate_rad_s
    times = np.array([0.0, turn / 2.0, turn])
    assert sunlit_lines(case, times)[:, 0].tolist() == [False, True, False]


def test_a_landmark_on_the_site_is_lost_at_touchdown():
    case = on_the_table([[0.0, 0.0, 0.0]])
    found = seen_at(case, np.arange(3.0), np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1e-3], [0.0, 0.0, 0.0]]))
    assert found.visible[:, 0].tolist() == [True, True, False]
    assert found.rejected["range"] == 1


def test_boresights():
    case = on_the_table([[0.0, 0.0, 0.0]])
    eyes = np.array([[30.0, 0.0, 40.0], [0.0, 0.0, 0.0]])
    down = [0.0, 0.0, -1.0]
    np.testing.assert_allclose(boresights(sensor(), case.frame, eyes), [down, down], atol=1e-15)
    np.testing.assert_allclose(
        boresights(sensor(boresight="site"), case.frame, eyes), [[-0.6, 0.0, -0.8], down], atol=1e-15
    )


def test_gaps_and_counts_along_a_path():
    """Past two landmarks 40 m apart at 1 m/s, 10 m up, with 45 deg either side: each is seen for 20 s."""
    case = on_the_table(
        [[-20.0, 0.0, 0.0], [20.0, 0.0, 0.0]], sensor=sensor(half_field_of_view_rad=math.radians(45.0001))
    )
    t = np.linspace(0.0, 80.0, 41)
    path = path_through(t, np.stack([t - 40.0, 0 * t, 0 * t + 10.0], axis=1))
    found = seen_along(case, path)
    assert found.visible.shape == (81, 2)
    assert found.count.sum() == 42 and found.distinct == 2
    assert found.longest_gap_s == pytest.approx(20.0)
    assert (found.t_s[found.visible[:, 0]][[0, -1]] == [10.0, 30.0]).all()


def test_visibility_is_that_of_embree(eros):
    """200 rays from Eros landmarks, of which terrain stops dozens.

    Flatter than 85 deg, embree's single precision stops rays at the landmark's own facet, 5 cm off or not:
    one in 1500 in ``python -m bench rays``, where every facet is asked who is right, and ours always are.
    """
    import trimesh

    rng = np.random.default_rng(8)
    landmarks = eros.landmarks
    which = rng.integers(len(landmarks.name), size=1200)
    eye = eros.frame.to_body(rng.uniform([-6000.0, -6000.0, -2000.0], [6000.0, 6000.0, 500.0], (1200, 3)))
    start, normal = landmarks.position_m[which], landmarks.normal[which]
    length = np.linalg.norm(eye - start, axis=1)
    direction = (eye - start) / length[:, None]
    rows = np.flatnonzero((direction * normal).sum(axis=1) > math.cos(math.radians(85.0)))[:200]
    assert len(rows) == 200
    body = trimesh.Trimesh(eros.asteroid.mesh.vertices, eros.asteroid.mesh.faces, process=False)
    begin = (start + RAY_OFFSET_M * direction)[rows]
    hits, ray, _ = body.ray.intersects_location(begin, direction[rows])
    near = np.linalg.norm(hits - start[rows][ray], axis=1) < length[rows][ray] - RAY_OFFSET_M
    hidden = np.zeros(200, dtype=bool)
    hidden[ray[near]] = True
    found = np.array([clear_lines(eros, eye[[row]])[0, which[row]] for row in rows])
    assert 20 < hidden.sum() < 180
    np.testing.assert_array_equal(found, ~hidden)


def test_blocks_of_times_make_no_difference(eros, monkeypatch):
    rng = np.random.default_rng(9)
    times = np.arange(40.0)
    eye = eros.frame.to_body(rng.uniform([-3000.0, -3000.0, -500.0], [3000.0, 3000.0, 2000.0], (40, 3)))
    sun = (eros.frame.axes[2] + 0.9 * eros.frame.axes[0]) / math.sqrt(1.81)
    case = replace(eros, sun_direction=sun, sensor=sensor(half_field_of_view_rad=math.radians(60.0)))
    whole = seen_at(case, times, eye)
    monkeypatch.setattr("landing_cli.observe.visibility._BLOCK_PAIRS", 300)
    pieces = seen_at(case, times, eye)
    np.testing.assert_array_equal(whole.visible, pieces.visible)
    assert whole.rejected == pieces.rejected
    assert all(count > 0 for count in whole.rejected.values() if count != whole.rejected["range"])
    assert whole.visible.sum() + sum(whole.rejected.values()) == whole.visible.size
    assert 0 < whole.visible.sum() < whole.visible.size


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {"half_field_of_view_rad": math.radians(20.0)},
            "the camera sees none of 1 landmarks: outside the field of view 100 %; "
            "the best is 30.0 deg off the boresight, 20 are allowed",
        ),
        (
            {"range_max_m": 50.0, "kind": "lidar"},
            "the lidar sees none of 1 landmarks: out of range 100 %; "
            "they are 115.5 to 115.5 m away, 0 to 50 m are in range",
        ),
        (
            {"emission_max_rad": math.radians(10.0)},
            "the camera sees none of 1 landmarks: seen too flat 100 %; "
            "the best is 30.0 deg between normal and line of sight, 10 are allowed",
        ),
        (
            {"incidence_max_rad": math.radians(10.0)},
            "the camera sees none of 1 landmarks: lit too flat 100 %; "
            "the best is 60.0 deg between normal and sun, 10 are allowed",
        ),
    ],
)
def test_a_sensor_that_sees_nothing_says_why(changes, told):
    sun = np.array([-math.sin(math.radians(60.0)), 0.0, math.cos(math.radians(60.0))])
    case = on_the_table([[-100.0 / math.sqrt(3.0), 0.0, 0.0]], sensor=sensor(**changes), sun_direction=sun)
    eye = np.array([[0.0, 0.0, 100.0]])
    assert unseen_reason(case, seen_at(case, np.zeros(1), eye), eye) == told


def test_behind_terrain_is_told_too():
    mesh = box((10.0, 10.0, 10.0))
    case = observe_case(mesh, landmarks_at(mesh, [[10.0, 5.0, 5.0]]), [0.0, 5.0, 5.0])
    case = replace(case, sensor=sensor(emission_max_rad=math.pi))
    eye = np.array([[-20.0, 5.0, 5.0]])
    seen = seen_at(case, np.zeros(1), eye)
    assert "behind terrain 100 %" in unseen_reason(case, seen, eye)
