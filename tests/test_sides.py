"""Proofs around the ellipsoid: covers without gaps, bounds below every flight, and what they prove."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from kernel_calls import from_python
from landing_samples import asteroid, landing_case
from truth.tables import landing_case as true_case, read_table

from landing_cli.optimize.conic_records import new_model
from landing_cli.reach import proofs, sides
from landing_cli.reach.certificate import certified_thrust_level as certified_thrust_level_part
from landing_cli.reach.descent_model import (
    fill_arc_cones as fill_arc_cones_part,
    fill_glide_cones as fill_glide_cones_part,
    fill_handover_rows as fill_handover_rows_part,
)
from landing_cli.reach.free_descent import PreparedCase, prepare, solve_prepared, survey
from landing_cli.reach.margin import least_thrust_flights
from landing_cli.reach.planes import Cuts
from landing_cli.reach.records import Binding, Verdict
from landing_cli.reach.scaled_case import (
    ellipsoid_level as ellipsoid_level_part,
    ellipsoid_normal as ellipsoid_normal_part,
)

certified_thrust_level = from_python(certified_thrust_level_part)
ellipsoid_level = from_python(ellipsoid_level_part)
ellipsoid_normal = from_python(ellipsoid_normal_part)
fill_arc_cones = from_python(fill_arc_cones_part)
fill_glide_cones = from_python(fill_glide_cones_part)
fill_handover_rows = from_python(fill_handover_rows_part)

CASES: dict[str, dict[str, Any]] = {
    "outside": {"position_m": np.array([300.0, 100.0, 650.0]), "tof_s": 780.0},
    "on the ellipsoid": {
        "position_m": np.array([300.0, 100.0, 650.0]),
        "tof_s": 780.0,
        "handover": "on_ellipsoid",
    },
}


@lru_cache
def solved(name: str) -> tuple[PreparedCase, np.ndarray]:
    case = landing_case(asteroid(gravity=2.0, spin=2.0), **CASES[name])
    p = prepare(case, survey(case))
    return p, proofs.with_proofs(p, solve_prepared(p, np.arange(len(p.shared.normals)))).rows


def anything(facets: np.ndarray) -> np.ndarray:
    return np.full(len(facets), np.inf)


def directions(count: int, seed: int = 0) -> np.ndarray:
    u = np.random.default_rng(seed).normal(size=(count, 3))
    return np.asarray(u / np.linalg.norm(u, axis=1, keepdims=True))


def beyond(triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Whether each point is beyond the plane of at least one triangle."""
    return np.asarray((points @ sides.planes_through(triangles).T >= 1.0 - 1e-12).any(axis=1))


def test_every_point_outside_the_sphere_is_beyond_a_plane_of_the_cover() -> None:
    for seed in range(20):
        toward = directions(1, seed)[0]
        opened = sides.Open(sides.Branch(0, (), ()), 3, toward)
        children = sides._children(opened)
        triangles = np.stack([child.triangles[0] for child in children])
        np.testing.assert_allclose(np.linalg.norm(triangles, axis=2), 1.0, rtol=1e-12)
        assert beyond(triangles, directions(2000, seed + 100)).all()
        assert {child.nodes for child in children} == {(3,)}


def test_cutting_a_triangle_leaves_no_gap() -> None:
    """Directions in the cone over a triangle stay covered, however often it is cut."""
    rng = np.random.default_rng(1)
    triangle = np.eye(3)
    for _ in range(4):
        weights = rng.dirichlet(np.ones(3), size=2000)
        points = weights @ triangle
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        parts = sides._children(sides.Open(sides.Branch(0, (5,), (triangle,)), 5, points[0]))
        assert len(parts) == 4
        assert beyond(np.stack([part.triangles[0] for part in parts]), points).all()
        triangle = parts[int(rng.integers(4))].triangles[0]


def test_no_multipliers_of_planes_prove_more_than_a_flight_that_keeps_to_them_needs() -> None:
    """Planes under the best flights' own nodes, random multipliers of them and of everything else."""
    p, rows = solved("outside")
    scaled = p.fine._replace(propellant=2.0)
    reachable = rows["facet"][rows["verdict"] == Verdict.REACHABLE][::25]
    flights = least_thrust_flights(
        p, scaled, p.fine_tube, p.shared.centroids_m[reachable], p.shared.normals[reachable]
    )
    rng, n, best = np.random.default_rng(4), len(scaled.mid_cos), 0.0
    cones = len(scaled.arc_fractions) + 2
    model = new_model(n, cones, 6)
    fill_handover_rows(scaled, model)
    fill_arc_cones(scaled, model)
    for f, facet in enumerate(reachable):
        fill_glide_cones(scaled, p.shared.normals[facet], model)
        node = np.sort(rng.choice(np.arange(1, n + 1), 3, replace=False))
        normal = np.zeros((3, 3))
        for c, k in enumerate(node):
            angle = scaled.node_cos[k], scaled.node_sin[k]
            x = flights.position[f, k]
            normal[c] = np.array(ellipsoid_normal(scaled, *angle, *x)) / ellipsoid_level(scaled, *angle, *x)
        cuts = Cuts(node.astype(np.float64), normal, np.zeros(3), np.ones(3), np.ones(3))
        arc = p.shared.bounds.on_arcs_m_s2 / scaled.acceleration_m_s2
        target = p.shared.centroids_m[facet] / scaled.length_m
        for _ in range(200):
            multiplier = rng.normal(size=9) * 10.0 ** rng.uniform(-2, 2, 9)
            duals = rng.normal(size=(cones, 4)) * 10.0 ** rng.uniform(-2, 2)
            bound = certified_thrust_level(
                scaled, target, p.fine_tube, arc, model, multiplier, duals, np.zeros((cones, 4)), cuts, 3, 1.0
            )
            assert bound <= flights.level[f]
            best = max(best, bound)
    assert best > 0.05


@pytest.mark.parametrize("name", CASES)
def test_no_reachable_facet_is_proved_unreachable(name: str) -> None:
    p, rows = solved(name)
    reachable = rows["facet"][rows["verdict"] == Verdict.REACHABLE].astype(np.int64)
    bounds, iterations = sides.bounds_around(p, reachable, anything(reachable))
    assert np.isnan(bounds).all()
    assert iterations.min() > 0


def test_planes_that_cut_flights_off_would_be_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The test above has teeth: with planes above the ellipsoid, reachable facets are called unreachable."""
    p, rows = solved("outside")
    monkeypatch.setattr(sides, "LEVEL", 1.5)
    reachable = rows["facet"][rows["verdict"] == Verdict.REACHABLE].astype(np.int64)
    assert (sides.bounds_around(p, reachable, anything(reachable))[0] > 1.0).sum() >= 3


def test_most_facets_that_the_ellipsoid_stops_are_proved() -> None:
    _, rows = solved("outside")
    stopped = (rows["verdict"] == Verdict.UNREACHABLE) & (rows["binding"] == Binding.ELLIPSOID)
    clearly = stopped & (rows["violation"] > 0.02)
    assert clearly.sum() >= 10
    assert rows["proved"][clearly].mean() > 0.9


def test_a_facet_is_proved_alone_as_in_company() -> None:
    p, rows = solved("outside")
    facets = rows["facet"][rows["verdict"] == Verdict.UNREACHABLE][::9].astype(np.int64)
    together, _ = sides.bounds_around(p, facets, anything(facets))
    alone = [
        sides.bounds_around(p, facets[k : k + 1], anything(facets[:1]))[0][0] for k in range(len(facets))
    ]
    np.testing.assert_array_equal(together, alone)


@pytest.mark.parametrize("table", ["bennu_800s", "bennu_900s", "bacchus", "eros"])
def test_no_proof_contradicts_direct_collocation(table: str) -> None:
    """On boundary facets, those where the ellipsoid binds above all."""
    for truth in read_table(table):
        case, facets = true_case(truth)
        bounds, _ = sides.bounds_around(prepare(case, survey(case)), facets, anything(facets))
        assert (truth.tau[bounds > 1.0] > 1.0).all()
        assert (bounds[bounds > 1.0] < truth.tau[bounds > 1.0]).all()
