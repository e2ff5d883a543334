"""The solver against direct collocation: verdicts, thrust levels and energies of the tables in truth/."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pytest
from truth.tables import TruthCase, is_fitted, landing_case, read_table

from landing_cli.reach.facet_work import solve_items
from landing_cli.reach.free_descent import prepare, solve_facets, survey
from landing_cli.reach.records import Verdict

# Nearer to 1 than this, two discretisations may fall on different sides.
TAU_BAND = 5e-4


@dataclass(frozen=True)
class Agreement:
    """How large a table is, and how well J agrees: excess over the truth, 99th percentile and worst."""

    facets: int
    p99: float = 3e-3
    worst: float = 1e-2
    best: float = -1e-4  # a coarser control cannot cost less, beyond the truth's own error
    level: float = 4e-3
    energies: bool = True  # whether the truth says them


TABLES = {
    "bennu_700s": Agreement(102),
    "bennu_800s": Agreement(42, p99=6e-3),
    "bennu_900s": Agreement(78),
    "bennu_on_ellipsoid": Agreement(24, p99=6e-3),
    "bennu_paper_thrust": Agreement(24),
    "bennu_paper": Agreement(24, p99=6e-3),
    # head on, too fast to stop before the keep-out zone: reachable early, out of reach, reachable again; the
    # truth keeps the handover's mass on the final stage, which costs it J where tau is 0.994
    "bennu_approach": Agreement(24, best=-5e-4),
    "bacchus": Agreement(28),
    # one facet, stopped by the ellipsoid, passes it on another side: its level is 0.081 too high; others 4e-4
    "bacchus_boundary": Agreement(60, p99=1e-3, worst=2e-3, level=9e-2),
    # under the polyhedron itself; the solver flies in the field that is fitted to it
    "eros_boundary": Agreement(17, level=9e-2, energies=False),
    "eros_boundary_broadside": Agreement(24, level=9e-2, energies=False),
    "eros_boundary_oblique": Agreement(20, level=9e-2, energies=False),
    # far beyond the boundary the least level found lies above the truth's; the verdict is the same
    "eros_flown_mass": Agreement(24, p99=6e-3, best=-1e-3, level=0.3),
    # keeps the handover's mass on the long final stage, which costs it up to 0.4 % of thrust, and 4 % of J
    # just inside the boundary
    "eros": Agreement(24, p99=6e-3, best=-5e-2, level=0.3),
}


@dataclass(frozen=True)
class Answers:
    """The truth and the solver's rows of a whole table."""

    tau: np.ndarray
    j: np.ndarray
    ellipsoid_binds: np.ndarray
    rows: np.ndarray
    names: list[str]


@lru_cache
def answers(table: str) -> Answers:
    cases = read_table(table)
    if not all(is_fitted(truth.inputs["gravity"]) for truth in cases):
        pytest.skip("its field is not fitted yet: reach run eros.yaml --set body.gravity.model=interpolated")
    rows = [solve_facets(*landing_case(truth)).rows for truth in cases]
    return Answers(
        np.concatenate([c.tau for c in cases]),
        np.concatenate([c.j for c in cases]),
        np.concatenate([c.ellipsoid_binds for c in cases]),
        np.concatenate(rows),
        [f"{c.name} {facet}" for c in cases for facet in c.facets],
    )


def proved_rows(truth: TruthCase) -> np.ndarray:
    """The solver's rows of a case as `reach run` has them: with the proofs that it looks for afterwards."""
    case, facets = landing_case(truth)
    prepared = prepare(case, survey(case))
    return solve_items((prepared,), len(case.asteroid.mesh.faces), facets).rows


def named(a: Answers, wrong: np.ndarray) -> list[str]:
    return [a.names[k] for k in np.flatnonzero(wrong)]


@pytest.mark.parametrize("table", TABLES)
def test_a_table_has_the_facets_it_is_said_to_have(table: str) -> None:
    a = answers(table)
    assert len(a.rows) >= TABLES[table].facets
    assert np.isfinite(a.tau).all()
    assert not TABLES[table].energies or np.isfinite(a.j[a.tau < 1.0 - TAU_BAND]).all()


def test_the_tables_cover_the_boundary_and_the_ellipsoid() -> None:
    early, late = answers("bennu_700s"), answers("bennu_900s")
    assert np.sum(np.abs(early.tau - 1.0) < 0.05) >= 60
    assert late.ellipsoid_binds.sum() >= 60
    assert min((early.tau > 1.0).sum(), (early.tau < 1.0).sum()) >= 30


@pytest.mark.parametrize("table", TABLES)
def test_no_verdict_is_false(table: str) -> None:
    a = answers(table)
    reachable, unreachable = a.tau < 1.0 - TAU_BAND, a.tau > 1.0 + TAU_BAND
    assert named(a, reachable & (a.rows["verdict"] != Verdict.REACHABLE)) == []
    assert named(a, unreachable & (a.rows["verdict"] == Verdict.REACHABLE)) == []


@pytest.mark.parametrize("table", TABLES)
def test_hardly_a_facet_is_left_unresolved(table: str) -> None:
    a = answers(table)
    assert len(named(a, a.rows["verdict"] == Verdict.UNRESOLVED)) <= 1


@pytest.mark.parametrize("table", TABLES)
def test_no_proof_contradicts_the_truth(table: str) -> None:
    a = answers(table)
    proved = a.rows["proved"] == 1
    assert named(a, proved & (a.tau < 1.0)) == []
    assert named(a, proved & (a.rows["verdict"] != Verdict.UNREACHABLE)) == []


def test_facets_are_out_of_reach_between_two_times_that_reach_them_and_it_is_proved() -> None:
    cases = read_table("bennu_approach")
    assert [truth.inputs["tof"] for truth in cases] == [425.0, 500.0, 650.0, 800.0]
    early, soon, late, last = (proved_rows(truth) for truth in cases)
    assert (early["verdict"] == Verdict.REACHABLE).all()
    assert (last["verdict"] == Verdict.REACHABLE).sum() == 4
    for rows, truth in ((soon, cases[1]), (late, cases[2])):
        assert (truth.tau > 1.01).all()
        assert (rows["proved"] == 1).all()


def test_most_facets_beyond_the_boundary_are_proved_where_thrust_stops_them() -> None:
    a = answers("bennu_700s")
    beyond = a.tau > 1.002
    assert beyond.sum() >= 30
    assert (a.rows["proved"][beyond] == 1).mean() > 0.9


KNOWN = {"eros_flown_mass": "two flights around Eros lead another way, at 2 and 4 % more energy"}


def with_known_faults(table: str):
    marks = [pytest.mark.xfail(strict=True, reason=KNOWN[table])] if table in KNOWN else []
    return pytest.param(table, marks=marks)


@pytest.mark.parametrize("table", [with_known_faults(table) for table in TABLES if TABLES[table].energies])
def test_energies_agree(table: str) -> None:
    a, limit = answers(table), TABLES[table]
    both = (a.rows["verdict"] == Verdict.REACHABLE) & np.isfinite(a.j)
    excess = a.rows["performance_index_m2_s3"][both] / a.j[both] - 1.0
    names = [name for name, kept in zip(a.names, both, strict=True) if kept]
    far = [
        f"{name}: {x:+.1e}" for name, x in zip(names, excess, strict=True) if not limit.best < x < limit.worst
    ]
    assert far == []
    assert np.quantile(excess, 0.99) < limit.p99


@pytest.mark.parametrize("table", TABLES)
def test_least_thrust_levels_agree_where_they_were_asked_for(table: str) -> None:
    a = answers(table)
    level = 1.0 - a.rows["thrust_margin"]
    asked = np.isfinite(level)
    assert named(a, asked & (np.abs(level - a.tau) > TABLES[table].level)) == []


@pytest.mark.parametrize("table", TABLES)
def test_what_is_delivered_keeps_every_limit(table: str) -> None:
    rows = answers(table).rows
    rows = rows[rows["verdict"] == Verdict.REACHABLE]
    assert rows["violation"].max() == 0.0
    assert rows["peak_thrust_ratio"].max() < 1.0 + 2e-5
    assert rows["ellipsoid_margin"].min() > -2e-5
    assert rows["glide_slope_margin_deg"].min() > np.degrees(-2e-5)
