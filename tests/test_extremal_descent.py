"""Facets by extremals: against direct collocation, against re-flight, and in what they promise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from truth.tables import landing_case, read_table

from landing_cli.flight.legs import CostateLeg, FinalArcLeg
from landing_cli.flight.replay import replay
from landing_cli.reach.extremal_descent import approximate_costates, solve_facets, solve_from
from landing_cli.reach.free_descent import prepare, survey
from landing_cli.reach.records import Binding, FacetSolutions, LandingCase, Verdict, blank_rows

# Near the edge of the domain the least energy is so steep that the truth's own tolerance shows.
ENERGY = 3e-4
REACHABLE, UNREACHABLE = Verdict.REACHABLE, Verdict.UNREACHABLE

BY_THRUST = [
    (table, number)
    for table, numbers in {
        "bennu_700s": (0, 1, 2),
        "bennu_paper_thrust": (0, 1, 2),
        "bennu_on_ellipsoid": (2,),
    }.items()
    for number in numbers
]


@pytest.mark.parametrize(("table", "number"), BY_THRUST)
def test_where_the_ellipsoid_does_not_bind_verdict_and_energy_are_those_of_collocation(
    table: str, number: int
) -> None:
    truth = read_table(table)[number]
    case, facets = landing_case(truth)
    rows = solve_facets(case, facets).rows
    clear = ~truth.ellipsoid_binds
    decided = clear & (np.abs(truth.tau - 1.0) > 5e-4)
    assert decided.sum() >= 6
    assert np.array_equal(rows["verdict"][decided] == REACHABLE, truth.tau[decided] < 1.0)
    both = clear & (rows["verdict"] == REACHABLE) & np.isfinite(truth.j)
    assert_allclose(rows["performance_index_m2_s3"][both], truth.j[both], rtol=ENERGY)
    assert not rows["proved"].any()


def test_where_the_ellipsoid_binds_extremals_cost_no_less_than_free_control() -> None:
    truth = read_table("bennu_900s")[0]
    case, facets = landing_case(truth)
    rows = solve_facets(case, facets).rows
    reached = rows["verdict"] == REACHABLE
    assert reached.sum() >= 20
    ratio = rows["performance_index_m2_s3"][reached] / truth.j[reached]
    assert ratio.min() > 1.0 - 1e-4
    assert ratio.max() > 1.05  # they do differ
    assert np.all(rows["ellipsoid_margin"][reached] > -1e-5)


@pytest.mark.parametrize("table", ["bennu_paper", "bacchus"])
def test_other_readings_and_bodies_give_no_false_landing(table: str) -> None:
    truth = read_table(table)[0]
    case, facets = landing_case(truth)
    rows = solve_facets(case, facets).rows
    reached = rows["verdict"] == REACHABLE
    assert reached.any()
    assert np.all(truth.tau[reached] < 1.0005)
    free_of_it = reached & ~truth.ellipsoid_binds
    assert_allclose(rows["performance_index_m2_s3"][free_of_it], truth.j[free_of_it], rtol=ENERGY)
    if case.handover == "on_ellipsoid":
        levels = (rows["handover_position_m"][reached] / case.ellipsoid_m) ** 2
        assert_allclose(levels.sum(axis=1), 1.0, rtol=0, atol=1e-5)


@pytest.fixture(scope="module")
def north_pole() -> tuple[LandingCase, np.ndarray, np.ndarray]:
    truth = read_table("bennu_900s")[0]
    case, facets = landing_case(truth)
    return case, facets[:8], solve_facets(case, facets[:8]).rows


def test_stored_costates_flown_again_by_dop853_land_and_keep_every_limit(
    north_pole: tuple[LandingCase, np.ndarray, np.ndarray],
) -> None:
    case, _, rows = north_pole
    craft, gravity = case.spacecraft, case.asteroid.gravity
    centroids = case.asteroid.mesh.corners.mean(axis=1)
    for row in rows[rows["verdict"] == REACHABLE][:3]:
        start = (case.position_m, case.velocity_m_s, craft.mass_kg)
        arrival = (row["handover_position_m"], row["handover_velocity_m_s"])
        legs = [
            CostateLeg(case.descent_s, row["costates"], *start, craft.thrust_max_n, gravity),
            FinalArcLeg(case.final_stage_s, *arrival, centroids[row["facet"]], gravity),
        ]
        flown = replay(
            *start,
            legs,
            rotation_rate_rad_s=case.asteroid.rotation_rate_rad_s,
            field=gravity,
            exhaust_velocity_m_s=craft.exhaust_velocity_m_s,
        )
        assert_allclose(flown.position_m[-1], centroids[row["facet"]], rtol=0, atol=1e-3)
        assert_allclose(flown.velocity_m_s[-1], 0.0, rtol=0, atol=1e-5)
        descent = flown.position_m[flown.t_s <= case.descent_s]
        assert ((descent / case.ellipsoid_m) ** 2).sum(axis=1).min() > 1.0 - 1e-5
        peak = np.linalg.norm(flown.thrust_n, axis=1).max() / craft.thrust_max_n
        assert_allclose(peak, row["peak_thrust_ratio"], rtol=0, atol=1e-3)
        assert_allclose(craft.mass_kg - flown.mass_kg[-1], row["fuel_kg"], rtol=1e-3)


def test_starts_of_the_caller_lead_to_the_same_optimum_in_fewer_rounds(
    north_pole: tuple[LandingCase, np.ndarray, np.ndarray],
) -> None:
    case, facets, rows = north_pole
    again = solve_facets(case, facets, rows["costates"]).rows
    found = rows["verdict"] == REACHABLE
    energy = "performance_index_m2_s3"
    assert_allclose(again[energy][found], rows[energy][found], rtol=1e-6)
    assert again["iterations"][found].sum() < 0.5 * rows["iterations"][found].sum()
    nothing = np.full((len(facets), 2, 7), np.nan)
    assert np.array_equal(solve_facets(case, facets, nothing).rows["costates"], rows["costates"], True)


def test_proofs_of_the_conic_solve_are_kept_and_its_other_facets_searched(
    north_pole: tuple[LandingCase, np.ndarray, np.ndarray],
) -> None:
    case, facets, rows = north_pole
    free = blank_rows(facets[:3])
    free["verdict"][0], free["proved"][0], free["violation"][0] = UNREACHABLE, 1, 0.25
    solved = solve_from(prepare(case, survey(case)), FacetSolutions(free, np.zeros((0, 3)))).rows
    assert solved["proved"].tolist() == [1, 0, 0]
    assert solved["violation"][0] == 0.25
    assert np.array_equal(solved["verdict"][1:], rows["verdict"][1:3])


def test_an_unreachable_facet_says_how_far_it_is_and_is_not_called_proved() -> None:
    truth = read_table("bennu_700s")[0]
    case, facets = landing_case(truth)
    far = np.argsort(truth.tau)[-4:]
    rows = solve_facets(case, facets[far]).rows
    assert np.all(rows["verdict"] == UNREACHABLE)
    assert not rows["proved"].any()
    assert np.all(rows["violation"] > 1e-3)
    assert np.all(np.isnan(rows["performance_index_m2_s3"]))
    assert np.all(rows["binding"] != Binding.NONE)


def test_a_propellant_bound_below_the_least_fuel_stops_a_facet_and_one_above_does_not(
    north_pole: tuple[LandingCase, np.ndarray, np.ndarray],
) -> None:
    case, facets, rows = north_pole
    place = int(np.flatnonzero(rows["verdict"] == REACHABLE)[0])
    fuel = rows["fuel_kg"][place]
    for bound, verdict in ((1.01 * fuel, REACHABLE), (0.5 * fuel, UNREACHABLE)):
        tight = replace(case, spacecraft=replace(case.spacecraft, propellant_kg=bound))
        solved = solve_facets(tight, facets[[place]]).rows[0]
        assert solved["verdict"] == verdict
        if verdict == UNREACHABLE:
            assert solved["binding"] == Binding.PROPELLANT


def test_terrain_in_the_way_is_refused_only_where_it_is_required_to_be_clear(
    north_pole: tuple[LandingCase, np.ndarray, np.ndarray],
) -> None:
    case, facets, rows = north_pole
    assert np.all(np.isfinite(rows["terrain_clearance_min_m"][rows["verdict"] == REACHABLE]))
    strict = solve_facets(replace(case, terrain="require"), facets).rows
    cuts = (rows["verdict"] == REACHABLE) & (rows["terrain_clearance_min_m"] < 0.0)
    assert np.array_equal(strict["verdict"] == REACHABLE, (rows["verdict"] == REACHABLE) & ~cuts)
    assert np.all(strict["binding"][cuts] == Binding.TERRAIN)


def test_approximate_costates_solve_the_gravity_free_landing() -> None:
    """Eq 13: thrust -lambda_v over the whole flight brings a point mass without gravity to rest on target."""
    case, facets = landing_case(read_table("bennu_700s")[2])
    case = replace(case, velocity_m_s=np.array([0.3, -0.2, 0.1]))
    target = case.asteroid.mesh.corners[facets[:1]].mean(axis=1)
    costates = approximate_costates(case, target)[0]
    tp = case.descent_s
    length = case.spacecraft.thrust_max_n / case.spacecraft.mass_kg * tp**2
    t = case.tof_s / tp
    pull = lambda s: -(costates[3:6] - s * costates[:3])  # noqa: E731
    s = np.linspace(0.0, t, 4001)
    force = np.array([pull(v) for v in s])
    speed = case.velocity_m_s * tp / length + np.trapezoid(force, s, axis=0)
    fallen = np.trapezoid((t - s)[:, None] * force, s, axis=0)
    arrived = case.position_m / length + t * case.velocity_m_s * tp / length + fallen
    assert_allclose(speed, 0.0, rtol=0, atol=1e-6)
    assert_allclose(arrived, target[0] / length, rtol=0, atol=1e-6)
