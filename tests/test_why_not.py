"""The least relaxations: searched on made-up ladders, and confirmed by solving changed cases from scratch."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from landing_samples import asteroid, landing_case, rock
from truth.tables import landing_case as true_case, read_table

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.mesh import facet_centroids
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach import why_not as searching
from landing_cli.reach.free_descent import Surroundings, prepare, solve_facets, solve_prepared, survey
from landing_cli.reach.records import Binding, LandingCase, Verdict
from landing_cli.reach.relaxation_story import relaxation_facts, tell_relaxations
from landing_cli.reach.relaxations import (
    Kind,
    Ladder,
    with_more_propellant,
    with_more_thrust,
    with_more_time,
    with_smaller_ellipsoid,
    with_wider_glide_slope,
)
from landing_cli.reach.why_not import WhyNot, why_not

CHANGED = {
    Kind.THRUST: with_more_thrust,
    Kind.TIME: with_more_time,
    Kind.GLIDE_SLOPE: with_wider_glide_slope,
    Kind.ELLIPSOID: with_smaller_ellipsoid,
    Kind.PROPELLANT: with_more_propellant,
}

CASES: dict[str, dict[str, Any]] = {
    "by thrust": {},
    "by the ellipsoid": {"tof_s": 800.0, "position_m": np.array([300.0, 100.0, 650.0])},
    "on the ellipsoid": {"handover": "on_ellipsoid"},
    "narrow": {"glide_slope_half_angle_rad": np.radians(15.0), "tof_s": 780.0},
    "by propellant": {"tof_s": 900.0, "spacecraft": Spacecraft(2000.0, 20.0, 400.0, 1.9)},
}


@lru_cache
def unreachable(name: str, count: int = 3) -> tuple[LandingCase, np.ndarray]:
    """A case, and some of its rows that are not reachable, from the nearest to the boundary on."""
    case = landing_case(asteroid(gravity=2.0, spin=2.0), **CASES[name])
    rows = solve_facets(case, np.arange(len(case.asteroid.mesh.faces))).rows
    short = rows[rows["verdict"] != Verdict.REACHABLE]
    order = np.argsort(short["violation"])[np.linspace(0, 0.6 * len(short), count).astype(int)]
    return case, short[np.sort(order)]


@lru_cache
def explained(name: str) -> WhyNot:
    return why_not(*unreachable(name))


@lru_cache
def surroundings(name: str) -> Surroundings:
    return survey(unreachable(name)[0])


def reached(name: str, kind: Kind, change: float, facet: int) -> bool:
    """Solve the changed case with proofs and all."""
    case = CHANGED[kind](unreachable(name)[0], change)
    shared = survey(case) if kind is Kind.ELLIPSOID else surroundings(name)
    return bool(
        solve_prepared(prepare(case, shared), np.array([facet])).rows["verdict"][0] == Verdict.REACHABLE
    )


@pytest.mark.parametrize("name", CASES)
def test_a_relaxation_is_reachable_and_a_step_less_is_not(name: str) -> None:
    rows, why, told = unreachable(name)[1], explained(name), 0
    for facet, changes in zip(rows["facet"], why.changes, strict=True):
        for searched, change in zip(why.searched, changes, strict=True):
            if np.isnan(change):
                continue
            told += 1
            assert searched.lowest <= change <= searched.highest
            assert reached(name, searched.kind, change, facet), (facet, searched.kind)
            less = change - np.sign(change) * searched.step
            if abs(less) > 0.5 * searched.step:
                assert not reached(name, searched.kind, less, facet), (facet, searched.kind)
    assert told >= 2 * len(rows)


@pytest.mark.parametrize("name", ["by the ellipsoid", "narrow"])
def test_where_no_relaxation_helps_the_largest_does_not(name: str) -> None:
    rows, why = unreachable(name)[1], explained(name)
    for facet, changes in zip(rows["facet"], why.changes, strict=True):
        for searched, change in zip(why.searched, changes, strict=True):
            if np.isnan(change):
                assert not reached(name, searched.kind, searched.highest, facet)


def test_a_facet_has_the_same_answer_alone() -> None:
    case, rows = unreachable("by the ellipsoid")
    together = explained("by the ellipsoid").changes
    for k in range(len(rows)):
        np.testing.assert_array_equal(why_not(case, rows[k : k + 1]).changes[0], together[k])


def test_more_thrust_is_what_the_least_thrust_level_says() -> None:
    """Against direct collocation: tau T_max is the least thrust."""
    for truth in read_table("bennu_700s")[:2]:
        case, facets = true_case(truth)
        beyond = np.flatnonzero((truth.tau > 1.01) & (truth.tau < 1.3))[:4]
        why = why_not(case, solve_facets(case, facets[beyond]).rows)
        assert why.searched[0].kind is Kind.THRUST
        level = 1.0 + why.changes[:, 0] / case.spacecraft.thrust_max_n
        np.testing.assert_allclose(level, truth.tau[beyond], rtol=0, atol=4e-3)


def test_mirrored_facets_have_equal_relaxations() -> None:
    """Over a sphere under a point mass that does not turn, from a start in the plane x = 0."""
    body = Asteroid("ball", rock(2, (250.0, 250.0, 250.0)), 0.0, point_mass_field(10.0), 10.0)
    case = landing_case(body, position_m=np.array([0.0, 300.0, 600.0]), velocity_m_s=np.zeros(3), tof_s=760.0)
    centroids = facet_centroids(body.mesh)
    rows = solve_facets(case, np.arange(len(centroids))).rows
    short = np.flatnonzero((rows["verdict"] == Verdict.UNREACHABLE) & (centroids[:, 0] > 20.0))[::6]
    mirror = np.array([-1.0, 1.0, 1.0])
    twins = [int(np.argmin(np.linalg.norm(centroids - mirror * centroids[k], axis=1))) for k in short]
    assert len(short) >= 3
    np.testing.assert_allclose(centroids[twins], mirror * centroids[short], rtol=0, atol=1e-9)
    here = why_not(case, rows[short])
    there = np.concatenate([why_not(case, rows[twin : twin + 1]).changes for twin in twins])
    steps = np.array([searched.step for searched in here.searched])
    np.testing.assert_array_equal(np.isnan(here.changes), np.isnan(there))
    assert np.nanmax(np.abs(here.changes - there) / steps) <= 1.5


def made_up(monkeypatch: pytest.MonkeyPatch, nested: bool, good: Any) -> Ladder:
    """A ladder of 1000 steps up and 200 down where facet f is reachable where good(f, step) says so."""
    monkeypatch.setattr(
        searching,
        "_reached",
        lambda ladder, facets, steps: np.array([good(f, s) for f, s in zip(facets, steps, strict=True)]),
    )
    return Ladder(Kind.TIME, 1.0, 0 if nested else -200, 1000, 1.0, nested, lambda step: None)  # type: ignore[arg-type,return-value]


@pytest.mark.parametrize("first", [1, 3, 250, 999, 1000])
def test_bisection_finds_the_least_step_from_any_guess(first: int, monkeypatch: pytest.MonkeyPatch) -> None:
    least = np.array([1, 2, 3, 31, 250, 251, 999, 1000, 1001])
    ladder = made_up(monkeypatch, True, lambda facet, step: step >= least[facet])
    found = searching._least_nested(ladder, np.arange(9), np.full(9, first))
    np.testing.assert_array_equal(found, np.where(least <= 1000, least, 0))


def test_the_nearest_time_is_found_either_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """Up, down, the nearer of both, an island that is wide enough, and nothing at all."""
    intervals = [
        [(100, 1000)],
        [(-200, -40)],
        [(50, 1000), (-200, -45)],
        [(-200, -62), (33, 1000)],
        [(300, 340)],
        [],
    ]
    ladder = made_up(
        monkeypatch, False, lambda facet, step: any(low <= step <= high for low, high in intervals[facet])
    )
    np.testing.assert_array_equal(searching._nearest(ladder, np.arange(6)), [100, -40, -45, 33, 300, 0])


def test_rock_on_the_way_is_told_by_its_depth() -> None:
    """Facets whose free flight cuts rock are reachable through so much of it."""
    body = asteroid(rock(3, (280.0, 260.0, 240.0)))
    case = landing_case(body, tof_s=1000.0, ellipsoid_m=np.array([150.0, 150.0, 150.0]))
    every = np.arange(0, len(body.mesh.faces), 5)
    free = solve_facets(case, every).rows
    strict = replace(case, terrain="require")
    rows = solve_facets(strict, every).rows
    cut = np.flatnonzero(rows["binding"] == Binding.TERRAIN)[:3]
    assert len(cut) == 3
    why = why_not(strict, rows[cut])
    depth = why.changes[:, [s.kind for s in why.searched].index(Kind.TERRAIN)]
    np.testing.assert_allclose(depth, -free["terrain_clearance_min_m"][cut], rtol=1e-9)


def test_the_sentence_begins_with_the_easiest_and_names_what_does_not_help() -> None:
    case, rows = unreachable("by the ellipsoid")
    why = WhyNot(
        rows["facet"][:1],
        explained("by the ellipsoid").searched,
        np.array([[2.0, -16.0, np.nan, np.nan]]),
    )
    told = tell_relaxations(case, why)
    assert told.startswith(
        "it would be reachable with a flight 16 s shorter, or 2 N more thrust; no glide slope"
    )
    assert told.endswith("alone help")
    facts = relaxation_facts(why)
    assert facts["easiest"] == "time"
    assert facts["thrust"]["change_n"] == 2.0
    assert np.isnan(facts["ellipsoid"]["change_m"])
    nothing = replace(why, changes=np.full((1, 4), np.nan))
    assert tell_relaxations(case, nothing).startswith("no thrust up to 100 N and no time of flight from")
    assert relaxation_facts(nothing)["easiest"] is None
