"""Flights clear of rock: against collocation past a sphere, trimesh, and geometry that is known."""

from __future__ import annotations

import csv
import json
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
import trimesh
from landing_samples import asteroid, flown_by_dop853, landing_case, rock
from truth.tables import HERE, TruthCase, gravity_field, landing_case as truth_case, tetrahedra

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.mesh import Mesh
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.free_descent import prepare, solve_facets, solve_prepared, survey
from landing_cli.reach.records import Binding, FacetSolutions, LandingCase, Verdict

J = "performance_index_m2_s3"
CLEARANCE = "terrain_clearance_min_m"
FLAT: dict[str, Any] = {
    "glide_slope_half_angle_rad": np.radians(80.0),
    "position_m": np.array([200.0, 200.0, 900.0]),
    "tof_s": 800.0,
}
EVERY = np.arange(320)
# enough for the flight through the boulder, not for the one around it
WEAK_N = 8.1


def mesa() -> Asteroid:
    """The rock with its upper cap lifted straight up, so that a flat arc to its foot would cut the wall."""
    mesh = rock()
    vertices = mesh.vertices.copy()
    up = np.array([0.1, 0.2, 1.0]) / np.linalg.norm([0.1, 0.2, 1.0])
    vertices[vertices @ up > 0.6 * np.linalg.norm(vertices, axis=1)] *= 1.3
    return asteroid(Mesh(vertices, mesh.faces))


@lru_cache
def over_the_mesa(**changes: Any) -> tuple[LandingCase, FacetSolutions]:
    case = landing_case(mesa(), **{**FLAT, **changes})
    return case, solve_facets(case, EVERY)


def reachable(rows: np.ndarray) -> np.ndarray:
    return np.asarray(rows["verdict"] == Verdict.REACHABLE)


def path_m(case: LandingCase, solutions: FacetSolutions, row: int) -> np.ndarray:
    """A stored flight by DOP853 and the closed form of the final arc, body frame."""
    known = solutions.rows[row]
    states = flown_by_dop853(case, solutions.nodes_of(row), samples=6)
    r, v, T = states[-1, :3], states[-1, 3:6], case.final_stage_s
    corners = case.asteroid.mesh.corners[known["facet"]]
    d, s = r - corners.mean(axis=0), np.linspace(T, 0.0, 400)[:, None]
    a, b = 3 * d / T**2 + v / T, -2 * d / T**3 - v / T**2
    return np.concatenate([states[:, :3], corners.mean(axis=0) + s**2 * (a + b * s)])


def test_what_did_not_cut_rock_is_answered_as_before() -> None:
    _, report = over_the_mesa()
    _, require = over_the_mesa(terrain="require")
    good = reachable(report.rows)
    cut = good & (report.rows[CLEARANCE] < 0.0)
    assert cut.sum() >= 10
    for name in report.rows.dtype.names:
        np.testing.assert_array_equal(require.rows[name][~cut], report.rows[name][~cut], err_msg=name)
    assert reachable(require.rows)[good & ~cut].all()


def test_flights_around_rock_clear_it_and_cost_more() -> None:
    _, report = over_the_mesa()
    case, require = over_the_mesa(terrain="require")
    again = reachable(require.rows) & reachable(report.rows) & (report.rows[CLEARANCE] < 0.0)
    assert again.sum() >= 10
    rows = require.rows[again]
    assert (rows[CLEARANCE] >= 0.0).all()
    assert (rows["violation"] == 0.0).all()
    assert (rows["binding"] == Binding.TERRAIN).mean() > 0.5
    ratio = rows[J] / report.rows[J][again]
    assert ratio.min() > 1.0
    mesh = trimesh.Trimesh(case.asteroid.mesh.vertices, case.asteroid.mesh.faces, process=False)
    for row in np.flatnonzero(again)[:6]:
        path = path_m(case, require, int(row))
        known = require.rows[row]
        apart = np.linalg.norm(path - path[-1], axis=1)
        _, distance, _ = trimesh.proximity.closest_point_naive(mesh, path)
        distance[mesh.contains(path)] *= -1.0
        edge = np.linalg.norm(np.diff(case.asteroid.mesh.corners, axis=1), axis=2).mean()
        assert distance.min() > -1e-3
        assert distance[apart > edge].min() > 0.0
        # the column looks every fortieth of an edge
        assert distance[apart > edge].min() >= known[CLEARANCE] - edge / 80.0


def test_what_is_left_is_not_called_reachable_and_says_why() -> None:
    _, report = over_the_mesa()
    _, require = over_the_mesa(terrain="require")
    cut = reachable(report.rows) & (report.rows[CLEARANCE] < 0.0)
    left = require.rows[cut & ~reachable(require.rows)]
    assert (left["binding"] == Binding.TERRAIN).all()
    assert (left["violation"] > 0.0).all()
    assert (left["proved"] == 0).all()
    short = left["verdict"] == Verdict.UNREACHABLE
    np.testing.assert_allclose(left["violation"][short], -left["thrust_margin"][short], rtol=0, atol=1e-15)
    assert np.isnan(left["thrust_margin"][~short]).all()


def test_answers_around_rock_do_not_depend_on_company_or_order() -> None:
    case, together = over_the_mesa(terrain="require")
    _, report = over_the_mesa()
    cut = np.flatnonzero(reachable(report.rows) & (report.rows[CLEARANCE] < 0.0))[:5]
    prepared = prepare(case, survey(case))
    for facets in (cut[::-1], cut[1:2]):
        alone = solve_prepared(prepared, facets)
        for name in together.rows.dtype.names:
            np.testing.assert_array_equal(alone.rows[name], together.rows[name][facets], err_msg=name)
        for k, facet in enumerate(facets):
            np.testing.assert_array_equal(alone.nodes_of(k), together.nodes_of(facet))


def with_ball(mesh: Mesh, centre: np.ndarray, radius_m: float, subdivisions: int = 3) -> Mesh:
    """A mesh and a sphere of its own beside it."""
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius_m)
    vertices = np.concatenate([mesh.vertices, np.asarray(sphere.vertices) + centre])
    return Mesh(vertices, np.concatenate([mesh.faces, np.asarray(sphere.faces) + len(mesh.vertices)]))


def read_boulders() -> list[tuple[dict[str, Any], float, float]]:
    """Inputs, least J without and with the boulder, of every row of boulder.csv."""
    lines = (HERE / "terrain" / "boulder.csv").read_text().splitlines()
    headers = {h["case"]: h for h in (json.loads(line[2:]) for line in lines if line.startswith("# "))}
    rows = csv.DictReader(line for line in lines if not line.startswith("# "))
    return [(headers[r["case"]], float(r["j_free_m2_s3"]), float(r["j_m2_s3"])) for r in rows]


BOULDERS = {given["case"]: (given, j_free, j) for given, j_free, j in read_boulders()}


def past_a_boulder(given: dict[str, Any], terrain: str, thrust_n: float = 20.0) -> np.void:
    """The row of a facet behind a boulder."""
    centroids, normals = np.array([given["r_c"]]), np.array([given["normal"]])
    truth = TruthCase(given["case"], given, np.zeros(1), centroids, normals, *np.ones((4, 1)))  # type: ignore[arg-type]
    plain, facets = truth_case(truth)
    mesh = with_ball(tetrahedra(centroids, normals)[0], np.array(given["boulder"][:3]), given["boulder"][3])
    body = Asteroid("boulder", mesh, given["omega"], gravity_field(given["gravity"]), given["gravity"][1])
    craft = Spacecraft(given["mass"], thrust_n, given["isp"])
    case = LandingCase(**{**plain.__dict__, "asteroid": body, "spacecraft": craft, "terrain": terrain})
    return solve_facets(case, facets).rows[0]


@pytest.mark.parametrize("name", BOULDERS)
def test_past_a_boulder_the_cost_is_that_of_collocation(name: str) -> None:
    """The truth keeps out of the sphere itself, whose inscribed mesh is at most 0.3 % smaller."""
    given, j_free, j = BOULDERS[name]
    report, require = past_a_boulder(given, "report"), past_a_boulder(given, "require")
    assert report[CLEARANCE] < -5.0
    assert report[J] == pytest.approx(j_free, rel=1e-3)
    assert require["verdict"] == Verdict.REACHABLE
    assert require[CLEARANCE] >= 0.0
    assert require[J] == pytest.approx(j, rel=3e-3)
    assert j > 1.005 * j_free


def under_a_lid() -> tuple[LandingCase, int]:
    """A facet whose whole glide-slope cone (60 degrees) a sphere covers: as wide as 67 degrees from there."""
    mesh = rock()
    facet = int(np.argmax(mesh.corners.mean(axis=1)[:, 2]))
    corners = mesh.corners[facet]
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.linalg.norm(normal)
    centre = corners.mean(axis=0) + 65.0 * normal
    body = asteroid(with_ball(mesh, centre, 60.0, 4))
    return landing_case(
        body, ellipsoid_m=np.array([290.0, 270.0, 250.0]), tof_s=900.0, terrain="require"
    ), facet


def test_a_facet_under_a_lid_stays_unresolved() -> None:
    case, facet = under_a_lid()
    free = landing_case(case.asteroid, ellipsoid_m=case.ellipsoid_m, tof_s=900.0)
    assert solve_facets(free, np.array([facet])).rows["verdict"][0] == Verdict.REACHABLE
    row = solve_facets(case, np.array([facet])).rows[0]
    assert row["verdict"] == Verdict.UNRESOLVED
    assert row["binding"] == Binding.TERRAIN
    assert row["violation"] > 0.0


def test_a_way_round_that_the_thruster_is_too_weak_for_is_told_with_what_it_needs() -> None:
    given, thrust_n = BOULDERS["site_1_boulder_1"][0], WEAK_N
    assert past_a_boulder(given, "report", thrust_n)["verdict"] == Verdict.REACHABLE
    row = past_a_boulder(given, "require", thrust_n)
    assert (row["verdict"], row["binding"]) == (Verdict.UNREACHABLE, Binding.TERRAIN)
    assert row["violation"] == -row["thrust_margin"]
    assert 1e-3 < row["violation"] < 0.1
    needed_n = thrust_n * (1.0 + row["violation"])
    assert past_a_boulder(given, "require", 1.01 * needed_n)["verdict"] == Verdict.REACHABLE
