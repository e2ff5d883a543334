"""The least thrust level of facets and points, and its certified bound."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from landing_samples import asteroid, landing_case
from truth.tables import landing_case as truth_case, read_table

from landing_cli.reach.free_descent import DOUBTFUL_LEVEL, PreparedCase, prepare, solve_prepared, survey
from landing_cli.reach.margin import ThrustLevels, bound_beyond_full, thrust_levels, thrust_levels_at
from landing_cli.reach.records import Verdict


@lru_cache
def asked(**changes: Any) -> tuple[PreparedCase, ThrustLevels]:
    """The rock's case, and the level of every facet."""
    case = landing_case(asteroid(), **changes)
    prepared = prepare(case, survey(case))
    return prepared, thrust_levels(prepared, np.arange(320))


@pytest.mark.parametrize("changes", [{}, {"tof_s": 900.0}, {"handover": "on_ellipsoid"}])
def test_a_facet_is_reachable_exactly_where_its_level_is_at_most_1(changes: dict[str, Any]) -> None:
    prepared, levels = asked(**changes)
    rows = solve_prepared(prepared, np.arange(320)).rows
    assert levels.solved.all()
    assert ((levels.level <= 1.0) == (rows["verdict"] == Verdict.REACHABLE)).all()
    assert (levels.bound <= levels.level).all()
    assert not (levels.bound[rows["verdict"] == Verdict.REACHABLE] > 1.0).any()


def test_a_level_depends_on_its_facet_alone() -> None:
    prepared, levels = asked()
    chosen = np.array([319, 5, 77, 200])
    alone = thrust_levels(prepared, chosen)
    for name in ("level", "bound", "solved"):
        assert (getattr(alone, name) == getattr(levels, name)[chosen]).all()


def test_points_may_lie_anywhere_on_the_surface() -> None:
    prepared, levels = asked()
    shared = prepared.shared
    corners = prepared.case.asteroid.mesh.vertices[prepared.case.asteroid.mesh.faces[7]]
    nearly = 0.999 * shared.centroids_m[7] + 0.001 * corners[0]
    found = thrust_levels_at(prepared, nearly[None], shared.normals[[7]])
    assert found.level[0] == pytest.approx(levels.level[7], rel=1e-3)


@pytest.mark.parametrize("table", ["bennu_700s", "bennu_900s", "bacchus"])
def test_bound_and_level_enclose_the_truth(table: str) -> None:
    """Against direct collocation; the level's bias is that of its time grid."""
    for truth in read_table(table):
        case, facets = truth_case(truth)
        levels = thrust_levels(prepare(case, survey(case)), facets)
        assert levels.solved.all()
        assert (levels.bound < truth.tau * (1.0 + 5e-4)).all()
        near = np.abs(truth.tau - 1.0) < 0.3
        assert levels.level[near] == pytest.approx(truth.tau[near], abs=DOUBTFUL_LEVEL - 1.0)
        nearer = np.abs(truth.tau - 1.0) < 2e-3
        assert levels.level[nearer] == pytest.approx(truth.tau[nearer], abs=1e-3)


def test_a_bound_beyond_full_thrust_holds_for_more_thrust_too() -> None:
    """A craft with T times the thrust has 1 / T of the level: its own certificates say no less."""
    prepared, levels = asked()
    far = np.flatnonzero(levels.bound > 1.05)
    assert len(far) > 10
    craft = prepared.case.spacecraft
    stronger = landing_case(
        asteroid(), spacecraft=type(craft)(craft.mass_kg, 1.5 * craft.thrust_max_n, craft.isp_s)
    )
    again = thrust_levels(prepare(stronger, survey(stronger)), far)
    assert (levels.bound[far] <= 1.5 * again.level).all()
    assert levels.bound[far] == pytest.approx(1.5 * again.bound, rel=2e-2)


def test_a_bound_up_to_full_thrust_stays_and_one_beyond_stays_beyond() -> None:
    prepared, _ = asked()
    bound = np.array([-0.5, 0.3, 1.0, 1.001, 1.2, 3.0])
    sound = bound_beyond_full(prepared.coarse, prepared.shared.bounds, bound)
    assert (sound[:3] == bound[:3]).all()
    assert (sound[3:] >= 1.0).all()
    assert (sound[3:] < bound[3:]).all()
    assert sound[4:] == pytest.approx(bound[4:], rel=3e-2)
