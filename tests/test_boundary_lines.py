"""The boundary tau = 1 on the surface: a circle where all is round, against bisection, in the file."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from landing_samples import GM_M3_S2, SPIN_RAD_S, asteroid, landing_case, rock

from landing_cli.body.adjacency import facet_neighbours
from landing_cli.body.asteroid import Asteroid
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.mesh import facet_centroids
from landing_cli.reach.boundary_lines import lines_from_group, lines_group, margin_lines
from landing_cli.reach.consistency import faults_of
from landing_cli.reach.exports import boundary_table, export_lines
from landing_cli.reach.facet_work import solve_items
from landing_cli.reach.free_descent import PreparedCase, prepare, solve_prepared, survey
from landing_cli.reach.margin import thrust_levels_at
from landing_cli.reach.records import FacetSolutions, Verdict
from landing_cli.reach.stored import CaseResult, ReachRun, run_from_result, run_to_tree
from landing_cli.reach.summary import summarise
from landing_cli.reach.verify import verify_run
from landing_cli.results.store import StoredResult
from landing_cli.results.tree import Dataset, Group

RADIUS_M = 260.0


@lru_cache
def round_case(subdivisions: int) -> PreparedCase:
    """A ball under a point mass; the descent begins at rest over its pole, so that all is round about z."""
    mesh = rock(subdivisions, (RADIUS_M, RADIUS_M, RADIUS_M))
    ball = Asteroid("ball", mesh, SPIN_RAD_S, point_mass_field(GM_M3_S2), GM_M3_S2)
    facts: dict[str, Any] = {"position_m": np.array([0.0, 0.0, 800.0]), "velocity_m_s": np.zeros(3)}
    case = landing_case(ball, margin=True, ellipsoid_m=np.full(3, RADIUS_M), **facts)
    return prepare(case, survey(case))


def colatitude_of_the_boundary(prepared: PreparedCase) -> float:
    """Bisection for tau = 1 along a meridian of the ball itself, deg."""
    low, high = 40.0, 140.0
    for _ in range(4):
        angles = np.linspace(low, high, 11)
        normals = np.stack([np.sin(np.radians(angles)), 0 * angles, np.cos(np.radians(angles))], axis=1)
        within = thrust_levels_at(prepared, RADIUS_M * normals, normals).level <= 1.0
        assert within[0]
        assert not within[-1]
        last = int(np.flatnonzero(within)[-1])
        low, high = float(angles[last]), float(angles[last + 1])
    return 0.5 * (low + high)


@lru_cache
def answered(subdivisions: int) -> tuple[PreparedCase, FacetSolutions]:
    prepared = round_case(subdivisions)
    count = len(prepared.case.asteroid.mesh.faces)
    return prepared, solve_items((prepared,), count, np.arange(count))


def test_the_boundary_over_a_ball_is_a_circle_and_converges() -> None:
    """Its mean falls with the facets' size squared, 320 to 1280 of them; single points with their size.

    A facet is asked with its own normal, which is not quite the ball's.
    """
    truth = colatitude_of_the_boundary(round_case(3))
    worst, mean = [], []
    for subdivisions in (2, 3):
        prepared, found = answered(subdivisions)
        lines = margin_lines(prepared.case.asteroid.mesh, found.rows)
        assert len(lines.offsets) == 2
        p = lines.points_m
        colatitude = np.degrees(np.arccos(p[:, 2] / np.linalg.norm(p, axis=1)))
        worst.append(np.abs(colatitude - truth).max())
        mean.append(abs(colatitude.mean() - truth))
        assert lines.area_within_m2 == pytest.approx(
            2.0 * np.pi * RADIUS_M**2 * (1.0 - np.cos(np.radians(truth))), rel=5e-2
        )
    assert mean[0] < 0.5
    assert mean[1] < 0.3 * mean[0]
    assert worst[0] < 1.0
    assert worst[1] < 0.6 * worst[0]


@lru_cache
def rough() -> tuple[PreparedCase, FacetSolutions]:
    case = landing_case(asteroid(rock(3)), margin=True)
    prepared = prepare(case, survey(case))
    return prepared, solve_items((prepared,), 1280, np.arange(1280))


def test_the_boundary_lies_where_bisection_between_neighbours_finds_it() -> None:
    prepared, found = rough()
    mesh, shared = prepared.case.asteroid.mesh, prepared.shared
    lines = margin_lines(mesh, found.rows)
    level = 1.0 - found.rows["thrust_margin"]
    inside, side = np.nonzero((level[:, None] <= 1.0) & (level[facet_neighbours(mesh)] > 1.0))
    outside = facet_neighbours(mesh)[inside, side]
    inside, outside = inside[::9], outside[::9]
    assert len(inside) > 6
    low, high = np.zeros(len(inside)), np.ones(len(inside))
    for _ in range(7):
        share = 0.5 * (low + high)[:, None]
        points = (1.0 - share) * shared.centroids_m[inside] + share * shared.centroids_m[outside]
        normals = (1.0 - share) * shared.normals[inside] + share * shared.normals[outside]
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        within = thrust_levels_at(prepared, points, normals).level <= 1.0
        low, high = np.where(within, share[:, 0], low), np.where(within, high, share[:, 0])
    away = np.linalg.norm(points[:, None] - lines.points_m, axis=2).min(axis=1)
    # the line's points are some metres apart themselves
    assert np.median(away) < 0.12 * shared.mean_edge_m
    assert away.max() < 0.35 * shared.mean_edge_m


def result_of(prepared: PreparedCase, found: FacetSolutions) -> CaseResult:
    mesh = prepared.case.asteroid.mesh
    lines = lines_group(margin_lines(mesh, found.rows))
    return CaseResult(prepared.case, "start", found, summarise(mesh, found), level_set=lines)


def test_asking_for_the_margin_changes_no_verdict() -> None:
    prepared, found = rough()
    plain = solve_prepared(prepared, np.arange(1280))
    assert (plain.rows["verdict"] == found.rows["verdict"]).all()
    for name in ("performance_index_m2_s3", "handover_position_m", "binding"):
        np.testing.assert_array_equal(plain.rows[name], found.rows[name])
    assert (found.rows["proved"] >= plain.rows["proved"]).all()


def test_the_flown_level_and_the_bound_enclose_the_margin() -> None:
    _, found = rough()
    rows, level = found.rows, 1.0 - found.rows["thrust_margin"]
    assert np.isfinite(level).all()
    assert (rows["thrust_level_bound"] <= level).all()
    reachable, flown = rows["verdict"] == Verdict.REACHABLE, np.isfinite(rows["thrust_level_flown"])
    assert flown[reachable].all()
    assert flown.mean() > 0.99
    assert rows["thrust_level_flown"][flown] == pytest.approx(level[flown], abs=1e-4)
    assert ((level <= 1.0) == reachable).all()


def test_a_run_with_margins_is_stored_and_verified(tmp_path: Path) -> None:
    result = result_of(*rough())
    summary = result.summary
    assert summary["thrust_margin"]["unknown"] == 0
    assert summary["boundary"]["area_within_m2"] == pytest.approx(summary["reachable_area_m2"], rel=0.02)
    tree = run_to_tree(ReachRun((result,)))
    back = run_from_result(StoredResult(tmp_path / "a.h5", tree, {}, "")).cases[0]
    assert back.case.margin
    assert back.case.free_final_stage is None
    assert faults_of(back) == ()
    (report,) = verify_run((back,))
    assert report.verified, report.reason
    assert report.worst["stored_thrust_level_flown"].value == 0.0


def told(result: CaseResult) -> str:
    return " ".join(fault.told for fault in faults_of(result))


@pytest.mark.parametrize(
    ("column", "change", "complaint"),
    [
        ("thrust_level_bound", 0.5, "has a least thrust level below its certified bound"),
        ("thrust_margin", -0.7, "needs more than all thrust"),
        ("thrust_level_flown", -0.9, "has a flight below its certified thrust level"),
    ],
)
def test_margins_that_contradict_are_found(column: str, change: float, complaint: str) -> None:
    prepared, found = rough()
    rows = found.rows.copy()
    row = int(np.flatnonzero(rows["verdict"] == Verdict.REACHABLE)[10])
    rows[column][row] += change
    assert complaint in told(result_of(prepared, FacetSolutions(rows, found.thrust_nodes_n)))


def test_an_unreachable_facet_with_thrust_to_spare_is_found() -> None:
    prepared, found = rough()
    rows = found.rows.copy()
    rows["thrust_margin"][rows["verdict"] == Verdict.UNREACHABLE] = 0.1
    told_ = told(result_of(prepared, FacetSolutions(rows, found.thrust_nodes_n)))
    assert "is unreachable, but full thrust is enough" in told_


def test_lines_that_are_not_those_of_the_margins_are_found() -> None:
    result = result_of(*rough())
    assert result.level_set is not None
    points = result.level_set.dataset("points_m").data.copy()
    points[3, 0] += 1e-3
    moved = Dataset(points, "m", "points", ("point", "xyz"))
    wrong = Group({**result.level_set.members, "points_m": moved}, result.level_set.attributes)
    assert "the boundary's lines are not those of the margins" in told(replace(result, level_set=wrong))
    assert "the boundary's lines are missing" in told(replace(result, level_set=None))


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("points_m", np.full((4, 3), np.nan)),
        ("points_m", np.zeros((4, 2))),
        ("offsets", np.array([0, 1, 4])),
        ("offsets", np.array([0, 9])),
        ("offsets", np.array([0.0, 4.0])),
    ],
)
def test_a_broken_list_of_lines_is_refused(name: str, data: np.ndarray) -> None:
    good = {"points_m": np.zeros((4, 3)), "offsets": np.array([0, 4])} | {name: data}
    dims = {"points_m": ("point", "xyz"), "offsets": ("offset",)}
    members = {n: Dataset(d, "1", "", dims[n]) for n, d in good.items()}
    group = Group(members, {"level": 1.0, "area_within_m2": 1.0})
    with pytest.raises(ValueError, match=f"level_set/{name}"):
        lines_from_group(group)


def test_the_boundary_is_exported_as_points_and_as_lines() -> None:
    result = result_of(*rough())
    table = boundary_table(result)
    assert list(table.columns) == ["line", "position_m_x", "position_m_y", "position_m_z"]
    assert result.level_set is not None
    points = result.level_set.dataset("points_m").data
    assert len(table) == len(points)
    run = ReachRun((result,))
    text = export_lines(run, "obj").decode().splitlines()
    vertices = np.array([line.split()[1:] for line in text if line.startswith("v ")], dtype=float)
    np.testing.assert_array_equal(vertices, points)
    lines = [line for line in text if line.startswith("l ")]
    assert len(lines) == len(result.level_set.dataset("offsets").data) - 1
    assert lines[0].split()[1] == "1"
    assert b"<Lines>" in export_lines(run, "vtp")


def test_json_needs_no_margin_of_runs_that_never_asked() -> None:
    prepared, _ = rough()
    plain = solve_prepared(prepared, np.arange(0, 1280, 100))
    summary = summarise(prepared.case.asteroid.mesh, plain)
    assert "thrust_margin" not in json.dumps(summary)
    assert "final_stage_s" not in summary


def test_centroids_and_lines_agree_on_the_domain() -> None:
    """The area within the lines is that of the reachable facets, but for what the lines cut finer."""
    prepared, found = rough()
    mesh = prepared.case.asteroid.mesh
    lines = margin_lines(mesh, found.rows)
    reachable = facet_centroids(mesh)[found.rows["verdict"] == Verdict.REACHABLE]
    nearest = np.linalg.norm(lines.points_m[:, None] - reachable, axis=2).min(axis=1)
    assert nearest.max() < 2.0 * prepared.shared.mean_edge_m


def test_with_extremals_the_margin_is_that_of_free_control() -> None:
    """It rules out what it forbids, and proves more; what it allows an extremal may still not reach."""
    case = landing_case(asteroid(), margin=True, descent="extremal")
    prepared, chosen = prepare(case, survey(case)), np.arange(0, 320, 16)
    rows = solve_items((prepared,), 320, chosen).rows
    reachable, proved = rows["verdict"] == Verdict.REACHABLE, rows["proved"] == 1
    assert 3 < reachable.sum() < 17
    assert (rows["thrust_margin"][reachable] >= 0.0).all()
    assert proved.sum() > 3
    assert (proved == (rows["thrust_level_bound"] > 1.0)).all()
