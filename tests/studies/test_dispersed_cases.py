"""A sample's case: GM in every gravity model, axes, no deviation, and verdicts as the full solve has them."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from dispersion_samples import drawing, spread
from landing_samples import GM_M3_S2, SPIN_RAD_S, asteroid, landing_case, rock
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import norm

from landing_cli.body.gravity.boxed import Box, boxed_field
from landing_cli.body.gravity.dipole import dipole_field
from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.field_values import accelerations, gradients
from landing_cli.body.gravity.harmonics import harmonics_field
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.body.gravity.scaled_field import scaled_field
from landing_cli.body.gravity.surrounding import surrounding_field
from landing_cli.errors import InputRefused
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.certificate import gravity_bounds
from landing_cli.reach.free_descent import prepare, solve_prepared, solve_verdicts, survey
from landing_cli.reach.margin import thrust_levels
from landing_cli.reach.records import LandingCase, Verdict
from landing_cli.studies.disperse.axes import state_axes
from landing_cli.studies.disperse.dispersed import dispersed_case, prepare_dispersed
from landing_cli.studies.disperse.draws import deviations, standard_normals
from landing_cli.studies.disperse.pair_work import PairWork, in_chunks, verdicts_of
from landing_cli.studies.disperse.statistics import facet_rows

SMALL = rock(1)
NOTHING = np.zeros(9)


def field(model: str, gm: float) -> GravityField:
    if model == "point_mass":
        return point_mass_field(gm)
    if model == "harmonics":
        return harmonics_field(gm, 246.0, c20=-0.04, c22=0.01, s22=-0.006, c21=0.003, s21=-0.004)
    if model == "dipole":
        return dipole_field(gm, 0.6, 150.0, 0.3)
    exact = polyhedron_field(SMALL.vertices, SMALL.faces, gm)
    if model == "polyhedron":
        return exact
    if model == "interpolated":
        return surrounding_field(exact).field
    box = Box(
        np.array([0.0, 0.0, 300.0]), np.eye(3), np.array([-80.0, -80.0, 0.0]), np.array([80.0, 80.0, 120.0])
    )
    return boxed_field(exact, box, 1e-4, 1).field


@pytest.mark.parametrize(
    "model", ["point_mass", "harmonics", "dipole", "polyhedron", "boxed", "interpolated"]
)
def test_every_gravity_model_scales_as_if_it_were_made_with_another_gm(model: str) -> None:
    points = np.array([[0.0, 10.0, 350.0], [400.0, -100.0, 30.0], [-20.0, 30.0, 310.0], [0.0, 2e3, 2e3]])
    nominal = field(model, GM_M3_S2)
    heavier, known = scaled_field(nominal, 1.07), field(model, 1.07 * GM_M3_S2)
    rtol = 1e-6 if model == "boxed" else 1e-12  # its pieces may be others
    assert_allclose(accelerations(heavier, points), accelerations(known, points), rtol=rtol, atol=1e-17)
    assert_allclose(accelerations(heavier, points), 1.07 * accelerations(nominal, points), rtol=1e-12)
    assert_allclose(gradients(heavier, points), 1.07 * gradients(nominal, points), rtol=1e-9, atol=1e-16)
    assert heavier.kind == nominal.kind
    assert_array_equal(scaled_field(nominal, 1.0).params, nominal.params)
    with pytest.raises(InputRefused, match="factor of GM"):
        scaled_field(nominal, 0.0)


def test_a_deviation_goes_where_it_belongs() -> None:
    case = landing_case()
    deviation = np.array([1.0, -2.0, 3.0, 0.01, 0.02, -0.03, 5.0, -0.5, 0.25])
    drawn = dispersed_case(case, np.eye(3), deviation)
    assert_allclose(drawn.position_m - case.position_m, deviation[:3], rtol=1e-12)
    assert_allclose(drawn.velocity_m_s - case.velocity_m_s, deviation[3:6], rtol=1e-12)
    assert (drawn.spacecraft.mass_kg, drawn.spacecraft.thrust_max_n) == (2005.0, 19.5)
    assert drawn.asteroid.gm_m3_s2 == GM_M3_S2 + 0.25
    known = asteroid(gravity=(GM_M3_S2 + 0.25) / GM_M3_S2).gravity
    assert_allclose(drawn.asteroid.gravity.params, known.params, rtol=1e-14)
    assert drawn.asteroid.mesh is case.asteroid.mesh
    assert drawn.ellipsoid_m is case.ellipsoid_m
    same = dispersed_case(case, np.eye(3), NOTHING)
    assert_array_equal(same.position_m, case.position_m)
    assert_array_equal(same.asteroid.gravity.params, case.asteroid.gravity.params)
    assert same.spacecraft == case.spacecraft


def test_radial_along_and_cross_follow_the_inertial_motion() -> None:
    case = landing_case()
    radial, along, cross = state_axes(case, "radial_along_cross")
    r = case.position_m
    inertial = case.velocity_m_s + np.cross([0.0, 0.0, SPIN_RAD_S], r)
    assert_allclose(radial, r / np.linalg.norm(r), rtol=1e-15)
    assert along @ inertial > 0.0
    assert_allclose(cross @ inertial, 0.0, atol=1e-15)
    turn = np.stack([radial, along, cross])
    assert_allclose(turn @ turn.T, np.eye(3), atol=1e-14)
    assert_allclose(np.linalg.det(turn), 1.0, rtol=1e-14)
    drawn = dispersed_case(case, turn, np.array([2.0, 0, 0, 0, 0.1, 0, 0, 0, 0]))
    assert_allclose(drawn.position_m - r, 2.0 * radial, atol=1e-12)
    assert_allclose(drawn.velocity_m_s - case.velocity_m_s, 0.1 * along, atol=1e-15)
    at_rest = landing_case(position_m=np.array([0.0, 0.0, 800.0]), velocity_m_s=np.zeros(3))
    with pytest.raises(InputRefused, match="it has no along and no cross; take body axes"):
        state_axes(at_rest, "radial_along_cross")


def test_bounds_of_gravity_scale_with_the_field() -> None:
    case = landing_case(asteroid(SMALL))
    nominal = prepare(case, survey(case))
    drawn = dispersed_case(case, np.eye(3), np.array([0.0] * 8 + [0.4]))
    prepared = prepare_dispersed(nominal, drawn)
    known = gravity_bounds(drawn.asteroid, drawn.ellipsoid_m)
    assert_allclose(prepared.shared.bounds.outside_m_s2, known.outside_m_s2, rtol=1e-12)
    assert_allclose(prepared.shared.bounds.on_arcs_m_s2, known.on_arcs_m_s2, rtol=1e-12)


WEAK = Spacecraft(2000.0, 12.0, 400.0)
READINGS = [
    pytest.param({}, id="free"),
    pytest.param({"tof_s": 900.0, "spacecraft": WEAK}, id="around the ellipsoid"),
    pytest.param({"handover": "on_ellipsoid"}, id="handover on the ellipsoid"),
    pytest.param({"final_stage_thrust": "paper"}, id="the paper's thrust"),
    pytest.param({"spacecraft": Spacecraft(2000.0, 20.0, 400.0, 2.6)}, id="scarce propellant"),
    pytest.param({"terrain": "require", "tof_s": 800.0}, id="no path through rock"),
]


def compared(case: LandingCase, deviation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Verdicts alone, and those of the full solve of a case surveyed on its own."""
    drawn = dispersed_case(case, np.eye(3), deviation)
    facets = np.arange(0, 320, 3)
    quick = verdicts_of(prepare_dispersed(prepare(case, survey(case)), drawn), facets)
    return quick, solve_prepared(prepare(drawn, survey(drawn)), facets).rows["verdict"]


@pytest.mark.parametrize("changes", READINGS)
def test_verdicts_alone_are_those_of_the_full_solve(changes: dict[str, Any]) -> None:
    case = landing_case(**changes)
    sigmas = spread(
        state_factor=np.diag([15.0] * 3 + [0.02] * 3),
        mass_sigma_kg=20.0,
        thrust_sigma_n=0.8,
        gm_sigma_m3_s2=0.2,
    )
    for deviation in deviations(sigmas, standard_normals(1, 2)):
        quick, full = compared(case, deviation)
        assert_array_equal(quick, full)
        assert {Verdict.REACHABLE} < set(full.tolist())


def test_a_start_inside_the_ellipsoid_reaches_nothing() -> None:
    case = landing_case(asteroid(SMALL), position_m=np.array([0.0, 0.0, 235.0]))
    prepared, facets = prepare(case, survey(case)), np.arange(0, 80, 5)
    assert set(solve_prepared(prepared, facets).rows["verdict"].tolist()) == {Verdict.UNREACHABLE}
    for height in (235.0, 1.0):
        inside = replace(prepared, case=replace(case, position_m=np.array([0.0, 0.0, height])))
        assert set(verdicts_of(inside, facets).tolist()) == {Verdict.UNREACHABLE}


def test_verdicts_of_extremals_are_those_of_a_reach_run() -> None:
    from landing_cli.reach.facet_work import solve_items

    case = landing_case(asteroid(SMALL), descent="extremal")
    prepared, facets = prepare(case, survey(case)), np.arange(20)
    assert_array_equal(verdicts_of(prepared, facets), solve_items((prepared,), 80, facets).rows["verdict"])


def pair_work(case: LandingCase, drawn: np.ndarray) -> PairWork:
    return PairWork((prepare(case, survey(case)),), (np.eye(3),), drawn)


def test_without_dispersion_every_sample_is_the_reach_run() -> None:
    case = landing_case(asteroid(SMALL))
    work = pair_work(case, deviations(spread(), standard_normals(1, 3)))
    known = solve_prepared(prepare(case, survey(case)), np.arange(80)).rows["verdict"]
    assert_array_equal(work(range(240)).verdicts.reshape(3, 80), [known] * 3)


def test_a_pair_depends_on_nothing_but_the_pair() -> None:
    """However the work is cut, and after a trip to another process."""
    case = landing_case(asteroid(SMALL))
    first, second = prepare(case, survey(case)), prepare(replace(case, tof_s=600.0), survey(case))
    drawn = deviations(spread(thrust_sigma_n=1.0), standard_normals(1, 2))
    work = PairWork((first, second), (np.eye(3), np.eye(3)), drawn)
    assert work.pairs == 320
    whole = work(range(320)).verdicts
    assert (whole.reshape(2, 2, 80)[0] != whole.reshape(2, 2, 80)[1]).any()
    pieces = [pickle.loads(pickle.dumps(work))(part) for part in (range(190, 320), range(190))]
    assert [piece.first for piece in pieces] == [190, 0]
    assert_array_equal(np.concatenate([pieces[1].verdicts, pieces[0].verdicts]), whole)
    assert [(c.start, c.stop) for c in in_chunks(2500)] == [(0, 1024), (1024, 2048), (2048, 2500)]


def test_with_the_thrust_dispersed_alone_the_margin_tells_each_verdict_and_the_probability() -> None:
    """A facet is reachable where the thrust drawn is at least tau of the nominal: P = Phi((1-tau)/sigma)."""
    case, sigma, samples = landing_case(), 0.03, 120
    nominal = prepare(case, survey(case))
    level = thrust_levels(nominal, np.arange(320)).level
    facets = np.flatnonzero(np.abs(level - 1.0) < 3.0 * sigma)
    assert len(facets) > 25
    sigmas = drawing(samples, seed=4, confidence=0.9995, thrust_sigma_n=20.0 * sigma)
    drawn = deviations(sigmas.spread, standard_normals(sigmas.seed, samples))
    work = pair_work(case, drawn)
    verdicts = np.stack([solve_verdicts(work.prepared(0, k), facets) for k in range(samples)])
    needed, given = level[facets], 1.0 + drawn[:, 7:8] / 20.0
    clear = np.abs(given - needed) > 2e-3  # of the time grid
    assert_array_equal((verdicts == Verdict.REACHABLE)[clear], (given > needed)[clear])
    assert clear.mean() > 0.9
    rows = facet_rows(verdicts, sigmas, drawn)
    probability = norm.cdf((1.0 - needed) / sigma)
    assert ((rows["probability_low"] <= probability) & (probability <= rows["probability_high"])).all()
    assert np.abs(rows["probability"] - probability).max() < 4.5 * np.sqrt(0.25 / samples)
    assert set(rows["driver"][rows["driver"] > 0].tolist()) == {14}  # nothing but the thrust was drawn
