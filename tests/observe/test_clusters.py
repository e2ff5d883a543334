"""Clusters, elbow and sides: by brute force, by construction, and by the paper's table."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from seeing_samples import landmarks_at, observe_case as sample_case, path_through
from shape_helpers import box

from landing_cli.errors import InputRefused
from landing_cli.observe.cases import observe_case
from landing_cli.observe.clusters import cluster, elbow, k_means, projected, side_and_way
from landing_cli.observe.features import ThomasField, thomas_points
from landing_cli.observe.observed import Clustering
from landing_cli.observe.records import SteeringOptions
from landing_cli.scenario.build import build
from landing_cli.scenario.load import load

PAPER_START = (-60.0, 70.0)
TABLE_CENTERS = np.array([[-28.67, 71.88], [1.92, -21.90]])
CORRECTED_CENTERS = np.array([[-28.67, 71.88], [1.92, 21.90]])
PLANE = box((400.0, 400.0, 400.0), (-200.0, -200.0, -200.0))


def clustered(points: np.ndarray, track: np.ndarray, **options: object) -> Clustering:
    """Cluster landmarks of the face x = 200 of a cube: the site frame's x is +y there, its y is +z."""
    where = np.column_stack([np.full(len(points), 200.0), points])
    case = sample_case(PLANE, landmarks_at(PLANE, where), [200.0, 0.0, 0.0])
    corners = np.column_stack([np.linspace(300.0, 200.0, len(track)), track])
    path = path_through(np.linspace(0.0, 100.0, len(track)), corners)
    return cluster(case, path, SteeringOptions(**options))  # type: ignore[arg-type]


def test_k_means_finds_the_best_of_all_partitions():
    points = np.random.default_rng(1).normal(size=(9, 2)) * 10.0
    for k in (1, 2, 3):
        least = min(
            sum(
                ((points[members] - points[members].mean(axis=0)) ** 2).sum()
                for members in (np.flatnonzero(np.array(labels) == j) for j in range(k))
            )
            for labels in itertools.product(range(k), repeat=9)
            if len(set(labels)) == k
        )
        center, label, errors = k_means(points, k)
        assert errors == pytest.approx(least, rel=1e-12)
        means = [points[label == j].mean(axis=0) for j in range(k)]
        np.testing.assert_allclose(center, means, rtol=1e-12)
        assert (np.diff(center[:, 0]) >= 0).all()


def test_k_means_of_as_many_clusters_as_points_leaves_no_error():
    points = np.random.default_rng(2).normal(size=(7, 2))
    center, label, errors = k_means(points, 7)
    assert errors == 0.0 and sorted(label) == list(range(7))
    np.testing.assert_array_equal(center[label], points)


def test_the_elbow_lies_farthest_from_the_chord():
    assert elbow(np.exp2([9.0, 8.0, 4.0, 3.5, 3.0, 2.5])) == 3
    assert elbow(np.exp2([9.0, 4.0, 3.5, 3.0, 2.5, 2.0])) == 2
    assert elbow(np.exp2([9.0, 8.0, 7.0, 3.0, 2.5, 2.0])) == 4
    assert elbow(np.array([9.0])) == elbow(np.array([9.0, 0.0])) == elbow(np.zeros(4)) == 1
    assert elbow(np.array([9.0, 1.0, 0.9, 0.0])) == elbow(np.array([9.0, 1.0, 0.9])) == 2


def test_the_elbow_counts_random_fields_of_three_clusters():
    """57 of 60 fields with three clusters are found to have three (at least 45 are asked; the note: 50)."""
    found = []
    for seed in range(60):
        points = thomas_points(ThomasField(seed, 3, 12.0, 8.0, 100.0))
        found.append(elbow(np.array([k_means(points, k)[2] for k in range(1, 10)])))
    assert found.count(3) == 57


@pytest.mark.parametrize("name", ["eros", "published/shen2026-eros"])
def test_the_shipped_fields_have_three_clusters(project_root, reference_shapes, monkeypatch, name):
    monkeypatch.setenv("LANDING_REFERENCE_DATA", str(reference_shapes.parent))
    loaded = load(str(project_root / "configs" / f"{name}.yaml"))
    built = build(loaded)
    case = observe_case(loaded, built.asteroid, built.spacecraft)
    points = np.ascontiguousarray(case.frame.to_site(case.landmarks.position_m)[:, :2])
    assert elbow(np.array([k_means(points, k)[2] for k in range(1, 10)])) == 3


def test_the_paper_table_has_its_centres_on_opposite_sides():
    track = np.array([PAPER_START, (0.0, 0.0)])
    side, _ = side_and_way(track, TABLE_CENTERS)
    assert side.tolist() == [1, -1]
    side, way = side_and_way(track, CORRECTED_CENTERS)
    assert side.tolist() == [1, 1]
    assert way[0] < way[1]


def test_sides_follow_the_nearest_part_of_a_bent_track():
    """A hairpin: what lies inside it is on the right of both legs, also where its corner is nearest."""
    track = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, -20.0], [0.0, -20.0]])
    points = np.array([[50.0, -8], [50, -12], [95, -10], [50, 5], [50, -25], [103, 4], [-9, 1], [-9, -22]])
    side, way = side_and_way(track, points)
    assert side.tolist() == [-1, -1, -1, 1, 1, 1, 1, 1]
    np.testing.assert_allclose(way, [50, 170, 110, 50, 170, 100, -9, 229], atol=1e-12)
    mirrored, same = side_and_way(track * [1, -1], points * [1, -1])
    assert (mirrored == -side).all()
    np.testing.assert_allclose(same, way, atol=1e-12)


@pytest.mark.parametrize("turned", np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False))
def test_a_sharp_corner_is_decided_by_both_its_segments(turned):
    """Beyond the tip of a 20 deg wedge, the two produced segments disagree; outside is outside.

    Rounding makes either segment the nearer one, turn by turn.
    """
    half = np.radians(10.0)
    back = 100.0 * np.array([np.cos(half), np.sin(half)])
    track = np.array([-back, [0.0, 0.0], -back * [1, -1]])
    points = np.array([[-40.0, 0.0], [5.0, 5.0], [5.0, -5.0], [5.0, 0.0], [-30.0, 20.0], [-30.0, -20.0]])
    turn = np.array([[np.cos(turned), np.sin(turned)], [-np.sin(turned), np.cos(turned)]])
    away = np.array([1234.5, -87.6])
    side, way = side_and_way(track @ turn + away, points @ turn + away)
    assert side.tolist() == [1, -1, -1, -1, -1, -1]
    np.testing.assert_allclose(way[1:4], 100.0, rtol=1e-12)


def test_steps_without_direction_are_dropped():
    stays = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 1e-12], [1.0, 1.0], [1.0, 1.0]])
    np.testing.assert_array_equal(projected(stays), [[0, 0], [1, 0], [1, 1]])
    with pytest.raises(InputRefused, match="vertical line"):
        projected(np.zeros((5, 2)))


def field(centers: list[tuple[float, float]], count: int = 12, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.concatenate([np.array(center) + rng.normal(0.0, 4.0, (count, 2)) for center in centers])


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_control_points_are_the_centres_of_the_richer_side_in_the_order_of_flight(mirror):
    points = field([(1.9, 21.9), (-28.7, 71.9), (-40.0, -30.0)]) * [mirror, 1.0]
    track = np.linspace(PAPER_START, (0.0, 0.0), 60) * [mirror, 1.0]
    found = clustered(points, track)
    assert len(found.center_m) == 3 and found.chosen_by == "elbow" and len(found.sse_m2) == 9
    assert (np.diff(found.sse_m2) < 0).all()
    assert found.side.tolist() == ([-1, 1, 1] if mirror > 0 else [-1, -1, 1])
    assert found.steered_to == ("left" if mirror > 0 else "right")
    assert found.side_chosen_by == "more_centers"
    expected = [points[12:24].mean(axis=0), points[:12].mean(axis=0)]
    np.testing.assert_allclose(found.control_points_m, expected, rtol=1e-12)
    assert np.bincount(found.label).tolist() == [12, 12, 12]


def test_choices_can_be_overridden():
    points = field([(1.9, 21.9), (-28.7, 71.9), (-40.0, -30.0)])
    track = np.linspace(PAPER_START, (0.0, 0.0), 60)
    found = clustered(points, track, side="right")
    assert (found.steered_to, found.side_chosen_by) == ("right", "given")
    np.testing.assert_allclose(found.control_points_m, [points[24:].mean(axis=0)], rtol=1e-12)
    found = clustered(points, track, clusters=1, clusters_max=3)
    assert len(found.center_m) == 1 and found.chosen_by == "given" and len(found.sse_m2) == 3
    found = clustered(points, track, clusters=12, clusters_max=5)
    assert len(found.center_m) == 12 and len(found.sse_m2) == 12


def test_a_tie_of_centres_goes_to_more_landmarks():
    points = np.concatenate([field([(-10.0, 60.0)], 8), field([(-60.0, -30.0)], 20)])
    found = clustered(points, np.linspace(PAPER_START, (0.0, 0.0), 60), clusters=2)
    assert sorted(found.side) == [-1, 1]
    assert (found.steered_to, found.side_chosen_by) == ("right", "more_landmarks")


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"clusters": 5}, "steering.clusters: 5 clusters of 4 landmarks; ask for fewer"),
        (
            {"clusters": 1, "side": "right"},
            "steering.side: no centre lies on the right of the unsteered path",
        ),
    ],
)
def test_impossible_choices_are_refused(options, told):
    points = np.array([[-10.0, 60.0], [-12.0, 66.0], [-9.0, 63.0], [-8.0, 61.0]])
    with pytest.raises(InputRefused) as refused:
        clustered(points, np.linspace(PAPER_START, (0.0, 0.0), 60), **options)
    assert str(refused.value).startswith(told)


def test_few_landmarks_make_few_clusters():
    track = np.linspace(PAPER_START, (0.0, 0.0), 60)
    for count in (1, 2, 3):
        points = np.array([[-10.0, 60.0], [-60.0, -12.0], [10.0, 40.0]])[:count]
        found = clustered(points, track)
        assert len(found.sse_m2) == count and found.sse_m2[-1] == pytest.approx(0.0, abs=1e-20)
