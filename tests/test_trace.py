"""The trace of the boundary: on made-up levels whose domain is known everywhere, and on real cases."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from shape_helpers import fibonacci_ellipsoid

from landing_cli.body.adjacency import components, facet_neighbours
from landing_cli.body.boundary_loops import boundary_loops
from landing_cli.body.bvh import build_surface_index
from landing_cli.body.mesh import Mesh, facet_areas, facet_centroids, facet_normals
from landing_cli.errors import InputRefused
from landing_cli.parallel import WorkPlan
from landing_cli.reach.consistency import faults_of
from landing_cli.reach.exports import boundary_table
from landing_cli.reach.facet_story import tell_facet
from landing_cli.reach.figures.traced import trace_figure
from landing_cli.reach.level_estimate import estimate, features
from landing_cli.reach.pipeline import RunOptions, run
from landing_cli.reach.records import Verdict
from landing_cli.reach.stored import run_from_result
from landing_cli.reach.stored_checks import check_case
from landing_cli.reach.trace import Answers, Ground, TraceResult, trace_domain
from landing_cli.reach.traced import LEAST_COMPONENT
from landing_cli.results.plotting import style, write_png
from landing_cli.results.store import read
from landing_cli.results.surface_map import map_surface
from landing_cli.results.tree import Dataset, Group
from landing_cli.scenario.load import load
from landing_cli.scenario.schema import Reach

Levels = np.ndarray


class Planet:
    """A mesh as the search sees it."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.points, self.normals = facet_centroids(mesh), facet_normals(mesh)
        self.areas = facet_areas(mesh)
        radius = np.sqrt(self.areas.sum() / (4 * np.pi))
        neighbours = facet_neighbours(mesh)
        place = features(self.points, self.normals, radius)
        self.ground = Ground(place, neighbours, build_surface_index(mesh).facets)
        self.edge = np.sqrt(self.areas.mean())
        self.asked: list[np.ndarray] = []

    def trace(self, levels: Levels) -> TraceResult:
        self.asked = []

        def ask(facets: np.ndarray) -> Answers:
            self.asked.append(facets)
            return Answers(levels[facets] <= 1.0, np.ones(len(facets), dtype=bool), levels[facets])

        return trace_domain(self.ground, ask)

    def dip(self, at: np.ndarray, depth: float, width: float) -> Levels:
        """A hollow in the levels, `width` facets across."""
        away = np.linalg.norm(self.points - at, axis=1)
        return -depth * np.exp(-0.5 * (away / (width * self.edge)) ** 2)

    def sizes(self, levels: Levels, inside: bool) -> list[int]:
        """Facets of the components of the domain, or of the rest."""
        part = levels <= 1.0
        label = components(self.ground.neighbours, part)
        return sorted(np.bincount(label)[np.unique(label[part == inside])].tolist(), reverse=True)


@cache
def planet(facets: int = 6000, rough: bool = False) -> Planet:
    mesh = fibonacci_ellipsoid((280.0, 250.0, 230.0), facets // 2 + 2)
    if rough:
        noise = np.random.default_rng(5).normal(0.0, 1.2, len(mesh.vertices))
        mesh = Mesh(mesh.vertices * (1.0 + noise[:, None] / 250.0), mesh.faces)
    return Planet(mesh)


def cap(ground: Planet) -> Levels:
    return 1.0 + (20.0 - ground.points[:, 2]) / 400.0


def annulus(ground: Planet) -> Levels:
    height = ground.points[:, 2] / 230.0
    return 0.7 + 1.5 * (height - 0.3) ** 2 / 0.16 * 0.3


def saddle(ground: Planet) -> Levels:
    x, y, z = ground.points.T / 250.0
    return 1.0 + 0.4 * (x**2 - y**2) + 0.05 * z + 0.01


def islands(ground: Planet) -> Levels:
    """Background out of reach, a hole in the cap and two islands of few facets."""
    levels = np.maximum(cap(ground), 0.75) + 0.02
    levels += ground.dip(ground.points[np.argmin(ground.points[:, 2])], 0.66, 9.0)
    levels += ground.dip(ground.points[np.argmin(ground.points[:, 0] + ground.points[:, 2])], 0.47, 6.0)
    return levels - ground.dip(ground.points[np.argmax(ground.points[:, 2])], 0.33, 5.0)


@pytest.mark.parametrize("field", [cap, annulus, saddle, islands])
@pytest.mark.parametrize("rough", [False, True])
def test_every_facet_gets_its_verdict(field, rough):
    ground = planet(rough=rough)
    levels = field(ground)
    found = ground.trace(levels)
    np.testing.assert_array_equal(found.domain, levels <= 1.0)
    assert found.ratio < 0.25


@pytest.mark.parametrize("size", range(1, 8))
def test_an_island_of_few_facets_in_a_wide_hollow_is_found(size):
    """The hollow is as wide as the seeds are apart; only its bottom is within reach."""
    ground = planet(12000)
    centre = ground.points[np.argmin(ground.points @ (0.3, -0.5, -0.8))]
    levels = 1.3 + ground.dip(centre, 0.5, 4.0)
    levels += 1.0 - 0.5 * (np.sort(levels)[size - 1] + np.sort(levels)[size])
    assert (levels <= 1.0).sum() == size
    found = ground.trace(levels)
    np.testing.assert_array_equal(found.domain, levels <= 1.0)


def test_levels_that_follow_the_normals_are_followed():
    """On a rough surface levels jump from facet to facet, as normals do, and leave small components."""
    ground = planet(rough=True)
    towards = ground.normals @ np.array([0.6, 0.0, 0.8])
    levels = 1.0 + 0.5 * (0.2 - ground.points[:, 2] / 230.0) - 0.4 * (towards - 0.5)
    pieces = ground.sizes(levels, True) + ground.sizes(levels, False)
    assert len([size for size in pieces if size >= LEAST_COMPONENT]) >= 4
    found = ground.trace(levels)
    label = components(ground.ground.neighbours, levels <= 1.0)
    right = np.bincount(label, weights=found.domain == (levels <= 1.0))
    assert (right[np.bincount(label) >= LEAST_COMPONENT] > 0).all()
    assert (found.domain != (levels <= 1.0)).sum() == 0


def test_both_sides_of_the_boundary_were_asked():
    ground = planet()
    found = ground.trace(islands(ground))
    across = found.domain[:, None] != found.domain[ground.ground.neighbours]
    facet, side = np.nonzero(across)
    assert found.asked[facet].all()
    assert found.asked[ground.ground.neighbours[facet, side]].all()


def test_every_facet_is_asked_once_and_the_seeds_are_spread():
    ground = planet()
    found = ground.trace(islands(ground))
    asked = np.concatenate(ground.asked)
    assert len(np.unique(asked)) == len(asked) == found.solves
    assert all((np.diff(facets) > 0).all() for facets in ground.asked)
    assert len(ground.asked) == found.rounds
    np.testing.assert_array_equal(np.flatnonzero(found.asked), np.sort(asked))
    nearest = np.linalg.norm(ground.points[:, None] - ground.points[found.seeds], axis=2).min(axis=1)
    assert nearest.max() < 2.0 * ground.edge * np.sqrt(len(ground.points) / len(found.seeds))


def test_solves_grow_like_the_root_of_the_facets():
    sizes = np.array([2000, 8000, 32000])
    grounds = [planet(int(size)) for size in sizes]
    solves = [ground.trace(islands_of_size(ground)).solves for ground in grounds]
    exponent = np.polyfit(np.log(sizes), np.log(solves), 1)[0]
    assert 0.4 < exponent < 0.6


def islands_of_size(ground: Planet) -> Levels:
    """Levels that do not change with the mesh."""
    x, y, z = ground.points.T / 250.0
    return 1.05 - 0.4 * z - 0.3 * np.exp(-8.0 * ((x - 0.8) ** 2 + y**2 + (z + 0.5) ** 2))


@pytest.mark.parametrize("level", [0.5, 2.0, np.nan])
def test_one_verdict_everywhere_asks_little_more_than_the_seeds(level):
    ground = planet()
    wobble = 0.05 * np.sin(ground.points[:, 0] / 90.0)
    found = ground.trace(np.full(len(ground.points), level) + wobble)
    assert found.domain.all() if level < 1.0 else not found.domain.any()
    if np.isfinite(level):
        assert found.solves < 1.1 * len(found.seeds)


def test_facets_without_a_level_or_a_verdict_do_not_mislead():
    """A tenth of the searches fails: the domain is right elsewhere, and the failures are out of it."""
    ground = planet()
    levels = islands(ground)
    fails = np.random.default_rng(2).random(len(levels)) < 0.1

    def ask(facets: np.ndarray) -> Answers:
        bad = fails[facets]
        return Answers((levels[facets] <= 1.0) & ~bad, ~bad, np.where(bad, np.nan, levels[facets]))

    found = trace_domain(ground.ground, ask)
    known = found.asked & ~fails
    np.testing.assert_array_equal(found.domain[known], levels[known] <= 1.0)
    assert not found.domain[found.asked & fails].any()
    np.testing.assert_array_equal(found.resolved, known)
    # a failure that nobody asked is believed to be what lies around
    np.testing.assert_array_equal(found.domain[~found.asked], levels[~found.asked] <= 1.0)


def test_a_plane_is_estimated_exactly_and_its_error_vanishes():
    rng = np.random.default_rng(1)
    known, asked = rng.normal(size=(200, 6)), 0.3 * rng.normal(size=(50, 6))
    slope = rng.normal(size=6)
    exact = estimate(known, 2.0 + known @ slope, asked)
    np.testing.assert_allclose(exact.value, 2.0 + asked @ slope, rtol=0, atol=0.15)
    noisy = estimate(known, 2.0 + known @ slope + rng.normal(0.0, 1.0, 200), asked)
    assert (noisy.error > exact.error).all()
    assert np.mean(np.abs(noisy.value - 2.0 - asked @ slope) < 2.0 * noisy.error) > 0.9


def test_too_few_known_levels_estimate_nothing():
    known = np.random.default_rng(1).normal(size=(5, 6))
    assert np.isinf(estimate(known, np.zeros(5), known + 0.1).error).all()


def test_loops_run_around_the_part_and_close():
    ground = planet()
    part = islands(ground) <= 1.0
    faces, neighbours = ground.mesh.faces, ground.ground.neighbours
    loops = boundary_loops(faces, neighbours, part)
    assert len(loops.loop) == (part[:, None] & ~part[neighbours]).sum()
    assert part[loops.inside].all()
    assert not part[loops.outside].any()
    for loop in range(loops.loop.max() + 1):
        own = loops.loop == loop
        np.testing.assert_array_equal(loops.end[own], np.roll(loops.start[own], -1))
        # the part lies to the left: the edge runs as in its facet's own corners
        corner = np.argmax(faces[loops.inside[own]] == loops.start[own][:, None], axis=1)
        following = faces[loops.inside[own], (corner + 1) % 3]
        np.testing.assert_array_equal(following, loops.end[own])
    lengths = np.bincount(loops.loop)
    assert (np.diff(lengths) <= 0).all()
    # Euler: on a sphere, k pieces and their complement's k' pieces are parted by k + k' - 1 loops
    pieces = len(ground.sizes(islands(ground), True)) + len(ground.sizes(islands(ground), False))
    assert len(lengths) == pieces - 1 == 4


def test_parts_that_touch_at_a_corner_have_loops_of_their_own():
    ground = planet()
    fan = np.flatnonzero((ground.mesh.faces == 100).any(axis=1))
    first = fan[0]
    opposite = next(f for f in fan if f != first and f not in ground.ground.neighbours[first])
    part = np.zeros(len(ground.points), dtype=bool)
    part[[first, opposite]] = True
    loops = boundary_loops(ground.mesh.faces, ground.ground.neighbours, part)
    np.testing.assert_array_equal(np.bincount(loops.loop), [3, 3])
    assert len(np.unique(loops.inside[loops.loop == 0])) == 1


def test_no_boundary_has_no_loops():
    ground = planet()
    for part in (np.ones(len(ground.points), dtype=bool), np.zeros(len(ground.points), dtype=bool)):
        assert len(boundary_loops(ground.mesh.faces, ground.ground.neighbours, part).loop) == 0


def test_components_are_numbered_by_their_first_facet():
    ground = planet()
    label = components(ground.ground.neighbours, islands(ground) <= 1.0)
    first = [np.flatnonzero(label == k)[0] for k in range(label.max() + 1)]
    assert first == sorted(first)
    assert label[0] == 0


def short_run(tmp_path, jobs: int, name: str, *more: str, progress=lambda done, total: None):
    state = "{name: mid_latitude, position_km: [0.6, 0, 0.5]}"
    chosen = ["reach.method=trace", "reach.tof_s=700", f"reach.initial_states=[{state}]", *more]
    options = RunOptions(WorkPlan(jobs), resume=True, compare="--compare" in name)
    return run(load("bennu.yaml", chosen), tmp_path / f"{name}.h5", options, progress).run


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    return short_run(tmp_path_factory.mktemp("compared"), 2, "a--compare").cases[0]


def test_nothing_is_missed_on_bennu(compared):
    told = compared.summary["trace"]
    assert (told["misclassified"], told["missed_components"], told["missed_smaller"]) == (0, 0, 0)
    assert told["closed"] == 1
    assert told["unreachable_components"] > 1  # or the claim is empty
    assert told["ratio"] < 0.2
    rows, domain = compared.solutions.rows, compared.boundary.dataset("domain").data
    np.testing.assert_array_equal(domain == 1, rows["verdict"] == Verdict.REACHABLE)
    assert compared.boundary.dataset("missed_facets").data.size == 0


def test_traced_facets_have_the_verdicts_of_the_traversal(compared, tmp_path):
    traced = short_run(tmp_path, 1, "b").cases[0].solutions
    rows = compared.solutions.rows[traced.rows["facet"]]
    for name in set(rows.dtype.names) - {"thrust_margin"}:
        np.testing.assert_array_equal(traced.rows[name], rows[name])
    margin = traced.rows["thrust_margin"]
    assert ((margin >= 0.0) == (rows["verdict"] == Verdict.REACHABLE)).all()
    again = short_run(tmp_path, 2, "c").cases[0].solutions
    np.testing.assert_array_equal(again.rows.tobytes(), traced.rows.tobytes())
    np.testing.assert_array_equal(again.thrust_nodes_n, traced.thrust_nodes_n)


def test_a_propellant_bound_takes_part_in_the_level(tmp_path):
    case = short_run(tmp_path, 2, "d--compare", "spacecraft.propellant_kg=1.9").cases[0]
    limited = short_run(tmp_path, 2, "e", "spacecraft.propellant_kg=1.9").cases[0]
    assert case.summary["unresolved"] > 10  # beyond the propellant
    assert case.summary["trace"]["missed_components"] == 0
    assert case.summary["trace"]["misclassified"] <= 5
    assert limited.summary["trace"]["N"] == case.summary["trace"]["N"]


@pytest.mark.parametrize(("key", "value"), [("descent", "extremal"), ("terrain", "require")])
def test_a_trace_is_refused_where_levels_do_not_decide(key, value):
    with pytest.raises(InputRefused, match=f"does not decide with {key}: {value}"):
        load("bennu.yaml", ["reach.method=trace", f"reach.{key}={value}"])
    assert Reach.model_fields["method"].default == "traverse"


class Stopped(Exception):
    """Something ended the run."""


def test_an_interrupted_trace_continues_to_the_same_bits(compared, tmp_path):
    whole = short_run(tmp_path, 2, "whole").cases[0]
    rounds = []

    def stop(done: int, total: int) -> None:
        rounds.append(total)
        if len(set(rounds)) == 3 and done > total - 60:
            raise Stopped

    with pytest.raises(Stopped):
        short_run(tmp_path, 1, "broken", progress=stop)
    assert (tmp_path / "broken.h5.journal").stat().st_size > 100_000
    resumed = short_run(tmp_path, 2, "broken").cases[0]
    np.testing.assert_array_equal(resumed.solutions.rows.tobytes(), whole.solutions.rows.tobytes())
    assert resumed.summary == whole.summary
    assert whole.summary["trace"]["N"] == compared.summary["trace"]["N"]


def test_a_traced_result_is_read_back_shown_and_held_to_what_it_can_be(compared, tmp_path):
    path = tmp_path / "stored.h5"
    written = short_run(tmp_path, 1, "stored").cases[0]
    stored = run_from_result(read(path)).cases[0]
    assert faults_of(stored) == faults_of(compared) == ()
    for name, member in written.boundary.members.items():
        np.testing.assert_array_equal(stored.boundary.dataset(name).data, member.data)
    table = boundary_table(stored)
    assert len(table) == stored.summary["trace"]["boundary_edges"]
    assert set(table.columns) >= {"loop", "reachable_facet", "unreachable_facet"}
    with pytest.raises(InputRefused, match="never asked for this facet"):
        tell_facet(stored, int(np.setdiff1d(np.arange(2692), stored.solutions.rows["facet"])[0]))
    for name in ("start_vertex", "loop", "seed_facets"):
        wrong = dict(stored.boundary.members)
        wrong[name] = Dataset(wrong[name].data + 2500, "1", "", wrong[name].dims)
        with pytest.raises(ValueError, match="names what does not exist"):
            check_case(replace(stored, boundary=Group(wrong)))
    with pytest.raises(ValueError, match="summary/trace is missing"):
        check_case(replace(stored, summary={k: v for k, v in stored.summary.items() if k != "trace"}))


def test_the_trace_is_drawn(compared, tmp_path):
    surface = map_surface(compared.case.asteroid.mesh)
    with style():
        write_png(trace_figure(compared, compared.boundary, surface), tmp_path / "trace.png")
    assert (tmp_path / "trace.png").stat().st_size > 50_000
