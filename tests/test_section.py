"""Section and expansion on made-up domains whose truth is known everywhere."""

from __future__ import annotations

import numpy as np
import pytest
from shape_helpers import fibonacci_ellipsoid

from landing_cli.body.adjacency import facet_neighbours, mean_edge_m
from landing_cli.body.mesh import Mesh, facet_areas, facet_centroids
from landing_cli.errors import InputRefused
from landing_cli.reach.section import section_and_expansion
from landing_cli.reach.section_sweep import compare_domains, section_sweep

NORTH = np.array([0.0, 0.0, 800.0])
SLANTED = np.array([600.0, 0.0, 500.0])
AZIMUTHS = np.arange(0.0, 360.0, 10.0)


class Planet:
    """A mesh with what the search needs to know about it."""

    def __init__(self, mesh: Mesh) -> None:
        self.points = facet_centroids(mesh)
        self.neighbours = facet_neighbours(mesh)
        self.areas = facet_areas(mesh)
        self.h = mean_edge_m(mesh)

    def range_from(self, start: np.ndarray) -> np.ndarray:
        return np.linalg.norm(self.points - start, axis=1)

    def search(self, start, truth, azimuth=0.0):
        return section_and_expansion(
            self.points, self.neighbours, start, self.h, azimuth, lambda facets: truth[facets]
        )


@pytest.fixture(scope="module")
def planet() -> Planet:
    """A Bennu-sized ellipsoid of 2692 facets, 26 m a side."""
    return Planet(fibonacci_ellipsoid((280.0, 270.0, 255.0), 1348))


def azimuth_of(points: np.ndarray) -> np.ndarray:
    """Azimuth about +z from +x, rad: what the search uses above the pole."""
    return np.arctan2(points[:, 1], points[:, 0])


@pytest.mark.parametrize("start", [NORTH, SLANTED])
@pytest.mark.parametrize("radius", [620.0, 760.0, 950.0])
def test_cap_of_given_distance_is_found_exactly_up_to_the_rim_of_the_ring(planet, start, radius):
    truth = planet.range_from(start) < radius
    for azimuth in AZIMUTHS:
        found = planet.search(start, truth, azimuth)
        assert radius - planet.h < found.radius_m < radius
        assert found.closed
        assert found.expansions <= 1
        covered = planet.range_from(start) <= found.radius_m + 0.5 * planet.h
        np.testing.assert_array_equal(found.domain, truth & covered)


def lobes(planet: Planet, depth: float = 0.12, count: int = 3) -> np.ndarray:
    """Seen from above the pole: reachable to 800 m, less between `count` lobes, one of them on +x."""
    edge = 800.0 * (1.0 - 0.5 * depth * (1.0 - np.cos(count * azimuth_of(planet.points))))
    return planet.range_from(NORTH) < edge


def test_expansion_follows_the_boundary_inwards(planet):
    truth = lobes(planet)
    found = planet.search(NORTH, truth)
    assert found.closed
    assert found.expansions >= 2
    assert len(found.expansion_facets) > 0
    comparison = compare_domains(found.domain, truth, planet.areas)
    assert comparison.iou > 0.995
    assert comparison.misclassified <= 6
    assert found.ratio < 0.18
    in_order = azimuth_of(planet.points[found.boundary_facets])
    assert np.all(np.diff(in_order % (2 * np.pi)) >= 0) or np.sum(np.diff(in_order) < 0) <= 1


def test_section_in_a_notch_misses_the_lobes_and_says_nothing_false_inside(planet):
    truth = lobes(planet)
    found = planet.search(NORTH, truth, 60.0)
    assert found.radius_m < 720.0
    assert not (found.domain & ~truth).any()
    assert compare_domains(found.domain, truth, planet.areas).iou < 0.9


def test_rough_boundary_and_islands_cost_little(planet):
    rng = np.random.default_rng(3)
    directions = planet.points / np.linalg.norm(planet.points, axis=1)[:, None]
    rough = sum(np.sin(directions @ rng.normal(size=3) * 4.0 + rng.uniform(0, 6)) for _ in range(5))
    reach = planet.range_from(SLANTED)
    truth = reach < 820.0 + 12.0 * rough
    islands = rng.choice(np.flatnonzero(reach > 900.0), 15, replace=False)
    truth[islands] = True
    sweep = section_sweep(planet.points, planet.neighbours, SLANTED, planet.h, AZIMUTHS, truth, planet.areas)
    assert np.median(sweep.iou) > 0.95
    assert sweep.iou.min() > 0.78  # where the section happens to end in a bay
    assert np.median(sweep.ratio) < 0.10


@pytest.mark.parametrize(("width_in_h", "expanded"), [(2.0, False), (4.5, True)])
def test_notch_is_entered_when_it_is_wider_than_three_steps(planet, width_in_h, expanded):
    aside = planet.points[:, 1]  # a notch on -x
    notch = (np.abs(aside) < 0.5 * width_in_h * planet.h) & (planet.points[:, 0] < 0)
    reach = planet.range_from(NORTH)
    truth = (reach < 800.0) & ~(notch & (reach > 700.0))
    found = planet.search(NORTH, truth)
    assert found.closed
    assert (found.expansions > 1) == expanded
    inside = planet.points[found.expansion_facets]
    assert np.any(notch[found.expansion_facets]) == expanded
    assert np.all(inside[:, 0] < 0)


def test_patch_to_one_side_is_not_taken_for_a_closed_boundary(planet):
    patch = np.linalg.norm(planet.points - [260.0, 0.0, 80.0], axis=1) < 1.2 * planet.h
    found = planet.search(NORTH, patch)
    assert found.ring_facets.size > 0
    assert not found.closed
    assert compare_domains(found.domain, patch, planet.areas).misclassified <= 5


def test_scattered_points_do_not_set_the_radius(planet):
    reach = planet.range_from(NORTH)
    section = (np.abs(planet.points[:, 1]) < 0.5 * planet.h) & (planet.points[:, 0] > 0)
    island = np.flatnonzero(section & (reach > 800.0))[:2]
    truth = reach < 700.0
    truth[island] = True
    assert planet.search(NORTH, truth).radius_m < 700.0


def test_a_short_run_before_the_domain_is_scattered_too(planet):
    reach = planet.range_from(NORTH)
    truth = (reach < 800.0) & ((reach > 600.0) | (reach < 550.0))
    found = planet.search(NORTH, truth)
    assert 800.0 - planet.h < found.radius_m < 800.0


def test_walk_passes_the_waist_of_a_peanut():
    """Over a waist the distance from the start rises and falls along the section."""
    ball = fibonacci_ellipsoid((1.0, 1.0, 1.0), 2048)
    radius = 250.0 * (
        1.0 + 1.2 * ball.vertices[:, 0] ** 4 - 0.45 * np.exp(-((ball.vertices[:, 0] / 0.25) ** 2))
    )
    peanut = Planet(Mesh(ball.vertices * radius[:, None], ball.faces))
    everywhere = np.ones(len(peanut.points), dtype=bool)
    for start in (np.array([0.0, 0.0, 600.0]), np.array([400.0, 0.0, 600.0])):
        found = peanut.search(start, everywhere)
        section = peanut.points[found.section_facets]
        range_m = peanut.range_from(start)[found.section_facets]
        assert np.sum(np.diff(range_m) < -0.1 * peanut.h) > 5
        assert (section @ start).min() < -0.9 * (section @ start).max()  # to the far side
        assert found.radius_m == range_m.max()
        assert np.abs(found.radius_m - peanut.range_from(start).max()) < peanut.h
        assert found.domain.mean() > 0.99


def test_every_facet_is_asked_at_most_once(planet):
    truth = lobes(planet)
    asked: list[int] = []

    def feasible(facets: np.ndarray) -> np.ndarray:
        asked.extend(facets.tolist())
        return truth[facets]

    for azimuth in (0.0, 45.0):
        asked.clear()
        found = section_and_expansion(planet.points, planet.neighbours, NORTH, planet.h, azimuth, feasible)
        assert len(asked) == len(set(asked)) == found.solves
        np.testing.assert_array_equal(np.sort(asked), np.flatnonzero(found.solved))
        np.testing.assert_array_equal(found.reachable[found.solved], truth[found.solved])
        np.testing.assert_array_equal(found.domain[found.solved], truth[found.solved])
        parts = [found.section_facets, found.ring_facets, found.expansion_facets]
        np.testing.assert_array_equal(np.unique(np.concatenate(parts)), np.flatnonzero(found.solved))


def test_section_and_ring_lie_where_the_paper_puts_them(planet):
    truth = planet.range_from(SLANTED) < 800.0
    found = planet.search(SLANTED, truth, 90.0)
    axis = SLANTED / np.linalg.norm(SLANTED)
    north = np.array([0.0, 0.0, 1.0]) - axis * axis[2]
    north /= np.linalg.norm(north)
    section = planet.points[found.section_facets]
    assert np.all(np.abs(section @ north) <= 0.5 * planet.h)
    assert np.all(section @ np.cross(axis, north) > -0.5 * planet.h)
    angle = np.arccos(section @ axis / np.linalg.norm(section, axis=1))
    assert np.all(np.diff(angle) >= -0.5 * planet.h / 250.0)
    assert (
        found.radius_m == planet.range_from(SLANTED)[found.section_facets[truth[found.section_facets]]].max()
    )
    ring = np.abs(planet.range_from(SLANTED) - found.radius_m) < 0.5 * planet.h
    np.testing.assert_array_equal(found.ring_facets, np.flatnonzero(ring))


def test_answer_turns_with_the_body(planet):
    truth = planet.range_from(SLANTED) < 800.0 + 40.0 * np.sin(planet.points[:, 1] / 60.0)
    here = planet.search(SLANTED, truth, 30.0)
    turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    there = section_and_expansion(
        planet.points @ turn.T, planet.neighbours, turn @ SLANTED, planet.h, 30.0, lambda f: truth[f]
    )
    np.testing.assert_array_equal(here.domain, there.domain)
    assert (here.solves, here.expansions) == (there.solves, there.expansions)


def test_everything_reachable_is_everything(planet):
    found = planet.search(NORTH, np.ones(len(planet.points), dtype=bool))
    assert found.domain.all()
    assert found.closed
    assert found.ratio < 0.07


def test_nothing_reachable_is_nothing(planet):
    found = planet.search(NORTH, np.zeros(len(planet.points), dtype=bool))
    assert not found.domain.any()
    assert not found.closed
    assert np.isnan(found.radius_m)
    assert found.solves == len(found.section_facets) > 0
    assert "no feasible facet" in found.message


def test_domain_beside_the_axis_ends_without_closing(planet):
    """No boundary can run around the axis: the search says so; it takes what lies nearer for reachable."""
    reach = planet.range_from(NORTH)
    truth = (reach > 600.0) & (reach < 800.0) & (np.abs(azimuth_of(planet.points)) < 0.6)
    found = planet.search(NORTH, truth)
    assert not found.closed
    assert "never closed" in found.message
    assert reach[found.domain & ~truth].max() < 600.0
    assert compare_domains(found.domain, truth, planet.areas).iou > 0.8


@pytest.mark.parametrize(
    ("h", "azimuth", "start"),
    [
        (0.0, 0.0, NORTH),
        (-1.0, 0.0, NORTH),
        (np.nan, 0.0, NORTH),
        (25.0, np.inf, NORTH),
        (25.0, 0.0, np.zeros(3)),
        (25.0, 0.0, np.array([np.nan, 0.0, 1.0])),
    ],
)
def test_a_section_that_cannot_be_is_refused(planet, h, azimuth, start):
    with pytest.raises(InputRefused, match="no section"):
        section_and_expansion(planet.points, planet.neighbours, start, h, azimuth, lambda f: f > 0)


def test_comparison_weighs_by_area():
    truth = np.array([True, True, False, False])
    found = np.array([True, False, True, False])
    areas = np.array([5.0, 2.0, 3.0, 100.0])
    assert compare_domains(found, truth, areas) == (2, 0.5)
    assert compare_domains(np.zeros(4, bool), np.zeros(4, bool), areas) == (0, 1.0)


def test_sweep_reports_each_azimuth_as_a_single_run_does(planet):
    truth = lobes(planet)
    sweep = section_sweep(planet.points, planet.neighbours, NORTH, planet.h, [0.0, 70.0], truth, planet.areas)
    for i, azimuth in enumerate((0.0, 70.0)):
        found = planet.search(NORTH, truth, azimuth)
        comparison = compare_domains(found.domain, truth, planet.areas)
        assert sweep.solves[i] == found.solves
        assert sweep.expansions[i] == found.expansions
        assert sweep.section_count[i] == len(found.section_facets)
        assert sweep.ratio[i] == found.ratio
        assert (sweep.misclassified[i], sweep.iou[i]) == comparison
