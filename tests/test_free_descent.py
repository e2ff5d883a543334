from __future__ import annotations

import pickle
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gravity_helpers import read_obj_km
from landing_samples import GM_M3_S2, SPIN_RAD_S, asteroid, landing_case, rock
from numba import typeof

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.ellipsoid import least_volume_ellipsoid
from landing_cli.body.gravity.harmonics import harmonics_field
from landing_cli.body.mesh import Mesh, facet_centroids, facet_normals
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.free_descent import (
    PATH_COLUMNS,
    _ask,
    _by_margin,
    _deliver,
    _new_work,
    prepare,
    solve_facets,
    solve_prepared,
    survey,
)
from landing_cli.reach.free_flights import best_flights
from landing_cli.reach.records import Binding, FacetSolutions, LandingCase, Verdict

J = "performance_index_m2_s3"


@lru_cache
def answered(body: Asteroid | None = None, **changes: Any) -> tuple[LandingCase, FacetSolutions]:
    """A case over the whole rock (320 facets), and its answers."""
    case = landing_case(body or asteroid(), **changes)
    return case, solve_facets(case, np.arange(len(case.asteroid.mesh.faces)))


def reachable(solutions: FacetSolutions) -> np.ndarray:
    return np.asarray(solutions.rows["verdict"] == Verdict.REACHABLE)


def test_every_facet_gets_a_verdict_and_its_columns_go_with_it() -> None:
    _, solutions = answered()
    rows, good = solutions.rows, reachable(solutions)
    assert (rows["verdict"] != Verdict.UNRESOLVED).all()
    assert 80 < good.sum() < 240
    assert (rows["violation"][good] == 0.0).all()
    assert (rows["violation"][~good] > 0.0).all()
    for name in PATH_COLUMNS:
        assert np.isfinite(rows[name][good]).all(), name
        assert np.isnan(rows[name][~good]).all(), name
    assert (rows["proved"][good] == 0).all()
    assert (rows["thrust_nodes"][good] > 0).all()
    assert (rows["thrust_nodes"][~good] == 0).all()
    assert len(solutions.thrust_nodes_n) == rows["thrust_nodes"].sum()
    asked = np.isfinite(rows["thrust_margin"])
    assert ((rows["thrust_margin"] >= 0.0) == good)[asked].all()
    assert (rows["iterations"] > 0).all()


def test_a_flight_that_breaks_a_limit_does_not_take_the_place_of_a_good_one() -> None:
    """On the fine grid the least-thrust flight comes first, and the least-energy one may miss by a hair."""
    case = landing_case()
    prepared, facets = prepare(case, survey(case)), np.arange(0, 320, 20)
    work = _new_work(prepared, prepared.coarse, prepared.coarse_tube, facets)
    everything = np.arange(len(facets))
    _by_margin(prepared, work, everything)
    good = np.flatnonzero(work.rows["verdict"] == Verdict.REACHABLE)
    assert len(good) > 4
    flights, _ = best_flights(_ask(work, good, False))
    _deliver(prepared, work, good, flights._replace(thrust=1.2 * flights.thrust))
    assert (work.rows["violation"][good] == 0.0).all()


def test_answers_do_not_depend_on_company_or_order() -> None:
    case, together = answered()
    prepared = prepare(case, survey(case))
    chosen = np.random.default_rng(3).permutation(320)[:70]
    shuffled = solve_prepared(prepared, chosen)
    alone = [solve_prepared(prepared, chosen[k : k + 1]) for k in range(12)]
    for name in together.rows.dtype.names:
        np.testing.assert_array_equal(shuffled.rows[name], together.rows[name][chosen], err_msg=name)
        single = np.concatenate([a.rows[name] for a in alone])
        np.testing.assert_array_equal(single, together.rows[name][chosen[:12]], err_msg=name)
    for k, facet in enumerate(chosen):
        np.testing.assert_array_equal(shuffled.nodes_of(k), together.nodes_of(facet))
    empty = solve_prepared(prepared, np.zeros(0, dtype=np.int64))
    assert len(empty.rows) == 0
    assert empty.thrust_nodes_n.shape == (0, 3)


def test_a_case_sent_to_another_process_needs_no_other_kernels() -> None:
    """Else every worker compiles the whole solver again: numba tells read-only arrays from others."""
    case, _ = answered()
    prepared = prepare(case, survey(case))
    sent = pickle.loads(pickle.dumps(prepared))
    for name in ("coarse", "fine", "frame"):
        assert typeof(getattr(sent, name)) == typeof(getattr(prepared, name)), name
    assert typeof(sent.shared.surface) == typeof(prepared.shared.surface)


def zonal(mesh: Mesh) -> Asteroid:
    """A body whose field has an axis and a plane of symmetry."""
    field = harmonics_field(2 * GM_M3_S2, 246.0, c20=-0.05, c22=0.0)
    return Asteroid("zonal", mesh, 2 * SPIN_RAD_S, field, 2 * GM_M3_S2)


def same_answers(one: FacetSolutions, other: FacetSolutions) -> None:
    np.testing.assert_array_equal(one.rows["verdict"], other.rows["verdict"])
    good = reachable(one)
    assert 0.2 < good.mean() < 0.9
    for name, rtol in ((J, 1e-5), ("fuel_kg", 1e-4)):
        np.testing.assert_allclose(one.rows[name][good], other.rows[name][good], rtol=rtol)


def test_turning_everything_about_the_spin_axis_changes_nothing() -> None:
    mesh, ellipsoid = rock(1), np.array([285.0, 285.0, 245.0])
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    turned = Mesh(mesh.vertices @ turn.T, mesh.faces)
    here = landing_case(zonal(mesh), ellipsoid_m=ellipsoid, tof_s=760.0)
    there = landing_case(
        zonal(turned),
        ellipsoid_m=ellipsoid,
        tof_s=760.0,
        position_m=turn @ here.position_m,
        velocity_m_s=turn @ here.velocity_m_s,
    )
    facets = np.arange(80)
    same_answers(solve_facets(here, facets), solve_facets(there, facets))


def test_the_mirror_image_in_the_equator_has_the_same_answers() -> None:
    """The spin is along +z in both: a mirror in its equator leaves a rotation as it is."""
    mesh, mirror = rock(1), np.diag([1.0, 1.0, -1.0])
    mirrored = Mesh(mesh.vertices @ mirror, mesh.faces[:, ::-1])
    here = landing_case(zonal(mesh), tof_s=760.0)
    there = landing_case(
        zonal(mirrored),
        tof_s=760.0,
        position_m=mirror @ here.position_m,
        velocity_m_s=mirror @ here.velocity_m_s,
    )
    facets = np.arange(80)
    same_answers(solve_facets(here, facets), solve_facets(there, facets))


def test_without_spin_a_round_body_is_as_symmetric_as_its_mesh() -> None:
    mesh = rock(2, (260.0, 260.0, 260.0))
    body = Asteroid("ball", mesh, 1e-12, harmonics_field(GM_M3_S2, 246.0, 0.0, 0.0), GM_M3_S2)
    at_rest = np.zeros(3)
    case = landing_case(body, position_m=np.array([0.0, 0.0, 800.0]), velocity_m_s=at_rest, tof_s=690.0)
    solutions = solve_facets(case, np.arange(320))
    centroids = facet_centroids(mesh)
    for mirror in (np.array([-1.0, 1, 1]), np.array([1.0, -1, 1])):
        distance = np.linalg.norm(centroids[:, None] * mirror - centroids[None], axis=2)
        partner = np.argmin(distance, axis=1)
        assert distance.min(axis=1).max() < 1e-9
        same_answers(solutions, FacetSolutions(solutions.rows[partner], solutions.thrust_nodes_n))
    height = centroids[:, 2]
    # the farther round, the dearer: the facets that are reached form a cap
    good = reachable(solutions)
    assert height[good].min() > height[~good].max() - 25.0
    order = np.argsort(-height[good])
    ranks = np.argsort(np.argsort(solutions.rows[J][good][order]))
    assert np.corrcoef(ranks, np.arange(len(ranks)))[0, 1] > 0.99


def test_facets_behind_the_body_are_proved_out_of_reach() -> None:
    case, solutions = answered()
    normals = facet_normals(case.asteroid.mesh)
    behind = normals @ case.position_m / np.linalg.norm(case.position_m) < -0.8
    rows = solutions.rows[behind]
    assert len(rows) >= 20
    assert (rows["verdict"] == Verdict.UNREACHABLE).all()
    assert (rows["proved"] == 1).all()
    assert (rows["binding"] == Binding.THRUST).all()


def test_more_thrust_and_more_time_lose_no_facet_and_cost_no_more_energy() -> None:
    _, base = answered()
    kept = reachable(base)
    stronger = answered(spacecraft=Spacecraft(2000.0, 21.0, 400.0))[1]
    longer = answered(tof_s=730.0)[1]
    for more in (stronger, longer):
        assert reachable(more)[kept].all()
        assert reachable(more).sum() > kept.sum()
        ratio = more.rows[J][kept] / base.rows[J][kept]
        assert ratio.max() < 1.0 + 1e-3


def test_a_handover_on_the_ellipsoid_is_a_narrower_way_to_land() -> None:
    case, outside = answered(tof_s=800.0)
    _, on_it = answered(tof_s=800.0, handover="on_ellipsoid")
    good = reachable(on_it)
    assert 20 < good.sum() < reachable(outside).sum()
    assert reachable(outside)[good].all()
    level = np.sum((on_it.rows["handover_position_m"][good] / case.ellipsoid_m) ** 2, axis=1)
    np.testing.assert_allclose(level, 1.0, rtol=0, atol=2e-5)
    assert (outside.rows[J][good] < on_it.rows[J][good] * (1 + 2e-3)).all()


def test_how_the_final_thrust_is_read_matters_only_where_it_binds() -> None:
    heavy = asteroid(gravity=10.0)
    _, flown = answered(heavy, final_stage_s=120.0)
    _, planned = answered(heavy, final_stage_s=120.0, final_stage_thrust="paper")
    both = reachable(flown) & reachable(planned)
    peaks = flown.rows["peak_thrust_ratio_final"], planned.rows["peak_thrust_ratio_final"]
    slack = both & (peaks[0] < 0.99) & (peaks[1] < 0.99)
    tight = both & (peaks[0] > 0.999) & (peaks[1] > 0.999)
    assert min(slack.sum(), tight.sum()) > 30
    ratio = planned.rows[J] / flown.rows[J]
    np.testing.assert_allclose(ratio[slack], 1.0, rtol=0, atol=1e-4)
    assert np.median(np.abs(ratio[tight] - 1.0)) > 1e-4


def test_a_bound_on_the_propellant_is_kept_and_takes_facets_away() -> None:
    _, free = answered(tof_s=760.0)
    good = reachable(free)
    bound = float(np.quantile(free.rows["fuel_kg"][good], 0.6))
    _, tight = answered(tof_s=760.0, spacecraft=Spacecraft(2000.0, 20.0, 400.0, bound))
    kept = reachable(tight)
    assert kept.sum() < good.sum()
    assert good[kept].all()
    assert tight.rows["fuel_kg"][kept].max() < bound * (1 + 1e-4)
    frugal = good & (free.rows["fuel_kg"] < 0.98 * bound)
    assert kept[frugal].all()
    np.testing.assert_allclose(tight.rows[J][frugal], free.rows[J][frugal], rtol=1e-5)
    pressed = kept & (free.rows["fuel_kg"] > 1.002 * bound)
    assert pressed.sum() > 3
    assert (tight.rows[J][pressed] > free.rows[J][pressed]).all()


def test_a_facet_that_only_the_propellant_keeps_away_says_so() -> None:
    _, free = answered(tof_s=760.0)
    bound = float(np.quantile(free.rows["fuel_kg"][reachable(free)], 0.3))
    _, tight = answered(tof_s=760.0, spacecraft=Spacecraft(2000.0, 20.0, 400.0, bound))
    lost = reachable(free) & ~reachable(tight)
    assert lost.sum() > 20
    assert (tight.rows["binding"][lost] == Binding.PROPELLANT).all()
    needed = bound * (1.0 + tight.rows["violation"][lost])
    np.testing.assert_allclose(needed, free.rows["fuel_kg"][lost], rtol=0.05)
    assert needed.min() > bound
    beyond = ~reachable(free)
    np.testing.assert_array_equal(tight.rows["verdict"][beyond], free.rows["verdict"][beyond])


@pytest.mark.parametrize("position", [(0.0, 0.0, 800.0), (800.0, 0.0, 0.0), (600.0, 0.0, 500.0)])
def test_over_bennu_nearly_every_unreachable_facet_is_proved(
    position: tuple[float, float, float], project_root: Path
) -> None:
    mesh = read_obj_km(project_root / "shapes" / "bennu.obj")
    field = harmonics_field(GM_M3_S2, 246.0, c20=-0.0392, c22=0.00374, s22=-8.3e-6)
    case = landing_case(
        Asteroid("bennu", mesh, SPIN_RAD_S, field, GM_M3_S2),
        position_m=np.array(position),
        velocity_m_s=np.zeros(3),
        ellipsoid_m=least_volume_ellipsoid(mesh.vertices),
    )
    rows = solve_facets(case, np.arange(len(mesh.faces))).rows
    beyond = rows["verdict"] == Verdict.UNREACHABLE
    assert (rows["verdict"] != Verdict.UNRESOLVED).all()
    assert 1000 < beyond.sum() < 1600
    assert rows["proved"][beyond].mean() >= 0.99
