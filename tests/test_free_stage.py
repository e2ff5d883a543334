"""The final stage's duration chosen for each facet: the lattice search, and the flights that it finds."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from landing_samples import asteroid, landing_case

from landing_cli.reach.consistency import faults_of
from landing_cli.reach.facet_work import solve_items
from landing_cli.reach.free_descent import PreparedCase, prepare, solve_prepared, survey
from landing_cli.reach.free_stage import LATTICE, ask_first_steps, refine
from landing_cli.reach.margin import thrust_levels
from landing_cli.reach.records import FacetSolutions, FreeFinalStage, Verdict
from landing_cli.reach.stored import CaseResult
from landing_cli.reach.summary import summarise
from landing_cli.reach.verify import verify_run

J = "performance_index_m2_s3"
FREE = FreeFinalStage(60.0, 380.0, 200.0)
CHOSEN = np.arange(0, 320, 5)


@lru_cache
def answered(margin: bool = False, **changes: Any) -> tuple[PreparedCase, FacetSolutions]:
    case = landing_case(asteroid(), free_final_stage=FREE, margin=margin, **changes)
    prepared = prepare(case, survey(case))
    return prepared, solve_items((prepared,), 320, CHOSEN)


def at(prepared: PreparedCase, duration_s: float) -> PreparedCase:
    return prepare(prepared.case.with_final_stage(duration_s), prepared.shared)


@pytest.mark.parametrize("valley", [[0.0, 37.2], [64.0, 64.0], [128.0, 91.5]])
def test_the_lattice_search_finds_the_lowest_of_two_valleys(valley: list[float]) -> None:
    """Two parabolas side by side: the deeper one is not where the first steps are lowest."""
    deep, shallow = np.array(valley)[:, None]

    def ask(step: int, places: np.ndarray) -> np.ndarray:
        values = np.minimum(0.01 * (step - deep) ** 2, 0.5 + 0.001 * (step - shallow) ** 2)
        return np.asarray(values[places])

    known = refine(ask, ask_first_steps(ask, 1))
    assert np.nanmin(known) == pytest.approx(0.0, abs=0.01 * 0.5**2)
    assert np.isfinite(known).sum() < 30


def test_the_lattice_search_asks_nothing_beyond_its_ends_and_nothing_twice() -> None:
    asked: list[int] = []

    def ask(step: int, places: np.ndarray) -> np.ndarray:
        asked.append(step)
        return np.full(len(places), float(step))

    known = refine(ask, ask_first_steps(ask, 2))
    assert known[:, 0].tolist() == [0.0, 0.0]
    assert len(set(asked)) == len(asked)
    assert 0 <= min(asked) <= max(asked) <= LATTICE


def test_the_search_is_no_worse_than_any_fixed_duration() -> None:
    """Against the whole solver at seven durations, on and off the lattice."""
    prepared, found = answered()
    rows = found.rows
    reachable, cost = rows["verdict"] == Verdict.REACHABLE, rows[J]
    for duration_s in (61.0, 80.0, 120.0, 170.0, 200.0, 290.0, 380.0):
        fixed = solve_prepared(at(prepared, duration_s), CHOSEN).rows
        also = fixed["verdict"] == Verdict.REACHABLE
        assert reachable[also].all()
        assert (cost[also] <= fixed[J][also] * (1.0 + 1e-3)).all()
        if duration_s == FREE.compared_s:
            assert (rows["compared_verdict"] == fixed["verdict"]).all()
            assert (cost[also] <= fixed[J][also]).all()
            assert reachable.sum() > also.sum()
            gained = summarise(prepared.case.asteroid.mesh, found)["gained_by_free_stage"]
            assert gained["facets"] == reachable.sum() - also.sum()
            assert gained["area_m2"] > 0.0


def test_what_is_unreachable_needs_more_than_full_thrust_at_every_duration() -> None:
    prepared, found = answered()
    rows = found.rows
    lost = rows["verdict"] == Verdict.UNREACHABLE
    assert lost.sum() > 5
    assert (rows["proved"] == 0).all()
    assert (rows["violation"][lost] > 0.0).all()
    for duration_s in np.linspace(FREE.shortest_s, FREE.longest_s, 11):
        assert (thrust_levels(at(prepared, float(duration_s)), CHOSEN[lost]).level > 1.0).all()


def test_the_margin_is_that_of_the_best_duration() -> None:
    prepared, found = answered(margin=True)
    rows = found.rows
    _, without = answered()
    assert (rows["verdict"] == without.rows["verdict"]).all()
    level = 1.0 - rows["thrust_margin"]
    assert np.isfinite(level).all()
    assert ((level <= 1.0) == (rows["verdict"] == Verdict.REACHABLE)).all()
    for duration_s in (70.0, 130.0, 200.0, 330.0):
        assert (level <= thrust_levels(at(prepared, duration_s), CHOSEN).level + 7e-3).all()
    assert np.isnan(rows["thrust_level_bound"]).all()
    assert rows["thrust_level_flown"] == pytest.approx(level, abs=2e-3)


def test_a_facets_answer_does_not_depend_on_its_company() -> None:
    prepared, found = answered()
    alone = solve_items((prepared,), 320, CHOSEN[7:8])
    assert alone.rows.tobytes() == found.rows[7:8].tobytes()
    assert (alone.thrust_nodes_n == found.nodes_of(7)).all()


def test_every_flight_is_verified_with_its_own_duration() -> None:
    """And a flight whose duration is changed by 2 s misses."""
    prepared, _ = answered()
    whole = solve_items((prepared,), 320, np.arange(0, 320))
    case, mesh = prepared.case, prepared.case.asteroid.mesh
    result = CaseResult(case, "start", whole, summarise(mesh, whole))
    assert faults_of(result) == ()
    (report,) = verify_run((result,))
    assert report.verified, report.reason
    durations = whole.rows["final_stage_s"][whole.rows["verdict"] == Verdict.REACHABLE]
    assert np.ptp(durations) > 50.0
    spoiled = FacetSolutions(whole.rows.copy(), whole.thrust_nodes_n)
    spoiled.rows["final_stage_s"] += 2.0
    (report,) = verify_run((CaseResult(case, "start", spoiled, summarise(mesh, spoiled)),))
    assert report.worst["touchdown_miss_m"].failing == report.flown
