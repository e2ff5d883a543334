"""Re-flight: two independent integrators, closed forms and the planned arcs."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from shape_helpers import box

from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.harmonics import harmonics_field
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.flight import control, replay as replay_module
from landing_cli.flight.extremal import extremal_rates, extremal_scale, scaled_start, thrust_ratio
from landing_cli.flight.gauss import GAUSS_A, GAUSS_B, GAUSS_C
from landing_cli.flight.legs import CostateLeg, FinalArcLeg, Leg, ThrustNodesLeg
from landing_cli.flight.replay import replay, replay_many
from landing_cli.flight.trajectory import Trajectory

SPIN = 2.0 * np.pi / (4.288 * 3600.0)
EXHAUST = 400.0 * 9.80665
FIELD = harmonics_field(4.892, 246.0, -0.03922, 0.003742)
START, REST, MASS = np.array([0.0, 0.0, 800.0]), np.zeros(3), 2000.0

NODES = ThrustNodesLeg(500.0, np.random.default_rng(5).normal(size=(40, 3)) * 6.0)
COSTATES = CostateLeg(500.0, np.array([0.3, -0.4, 1.9, 0.2, -0.1, 1.1, 0.5]), START, REST, MASS, 20.0, FIELD)


def fly(legs: list[Leg], integrator: str, field: GravityField = FIELD) -> Trajectory:
    return replay(
        START,
        REST,
        MASS,
        legs,
        rotation_rate_rad_s=SPIN,
        field=field,
        exhaust_velocity_m_s=EXHAUST,
        integrator=integrator,  # type: ignore[arg-type]
    )


def arc_after(leg: Leg) -> FinalArcLeg:
    end = fly([leg], "gauss")
    target = end.position_m[-1] + 100.0 * end.velocity_m_s[-1] + [5.0, -3.0, -40.0]
    return FinalArcLeg(200.0, end.position_m[-1], end.velocity_m_s[-1], target, FIELD)


@pytest.mark.parametrize("leg", [NODES, COSTATES], ids=["nodes", "costates"])
def test_both_integrators_agree_and_land_on_the_target(leg: Leg) -> None:
    legs = [leg, arc_after(leg)]
    slow, fast = fly(legs, "dop853"), fly(legs, "gauss")
    assert slow.t_s[-1] == pytest.approx(700.0) == fast.t_s[-1]
    assert_allclose(fast.position_m[-1], slow.position_m[-1], rtol=0, atol=1e-6)
    assert_allclose(fast.velocity_m_s[-1], slow.velocity_m_s[-1], rtol=0, atol=1e-8)
    assert_allclose(fast.mass_kg[-1], slow.mass_kg[-1], rtol=1e-9)
    assert_allclose(fast.position_m[-1], legs[1].target_m, rtol=0, atol=1e-6)
    assert_allclose(fast.velocity_m_s[-1], 0.0, rtol=0, atol=1e-8)


@pytest.mark.parametrize("leg", [NODES, COSTATES], ids=["nodes", "costates"])
def test_halving_the_steps_of_the_fast_integrator_changes_nothing(
    leg: Leg, monkeypatch: pytest.MonkeyPatch
) -> None:
    legs = [leg, arc_after(leg)]
    coarse = fly(legs, "gauss")
    monkeypatch.setattr(replay_module, "FACETS_STEP_MAX_S", 500.0 / 40 / 2)
    monkeypatch.setattr(replay_module, "_OF_FACETS", tuple(GravityKind))
    for name in ("_EXTREMAL_STEPS", "_ARC_STEPS"):
        monkeypatch.setattr(control, name, 2 * getattr(control, name))
    fine = fly(legs, "gauss")
    assert len(fine.t_s) > 1.8 * len(coarse.t_s)
    assert_allclose(fine.position_m[-1], coarse.position_m[-1], rtol=0, atol=1e-8)
    assert_allclose(fine.velocity_m_s[-1], coarse.velocity_m_s[-1], rtol=0, atol=1e-10)


def test_the_gauss_method_meets_the_order_conditions_up_to_eight() -> None:
    for k in range(1, 9):
        assert_allclose(GAUSS_B @ GAUSS_C ** (k - 1), 1.0 / k, rtol=1e-13)
    for k in range(1, 5):
        assert_allclose(GAUSS_A @ GAUSS_C ** (k - 1), GAUSS_C**k / k, rtol=1e-12)


@pytest.mark.parametrize("integrator", ["dop853", "gauss"])
def test_without_gravity_and_spin_constant_thrust_obeys_the_rocket_equation(integrator: str) -> None:
    leg = ThrustNodesLeg(600.0, np.tile([0.0, 16.0, 12.0], (10, 1)))
    flown = replay(
        START,
        REST,
        MASS,
        [leg],
        rotation_rate_rad_s=0.0,
        field=point_mass_field(1e-30),
        exhaust_velocity_m_s=EXHAUST,
        integrator=integrator,  # type: ignore[arg-type]
    )
    speed = EXHAUST * np.log(MASS / flown.mass_kg[-1])
    assert_allclose(flown.mass_kg[-1], MASS - 600.0 * 20.0 / EXHAUST, rtol=1e-13)
    assert_allclose(flown.velocity_m_s[-1], [0.0, 0.8 * speed, 0.6 * speed], rtol=0, atol=1e-11)


def test_the_fast_integrator_splits_steps_where_the_thrust_saturates() -> None:
    sampled = control.sampled_control(COSTATES, SPIN, EXHAUST)
    ratio = np.linalg.norm(sampled.knots, axis=1) / 20.0
    kinks = np.flatnonzero(np.diff(np.isclose(ratio, 1.0, rtol=0, atol=1e-12).astype(int)))
    assert len(sampled.steps_s) > 64  # it does saturate, and steps were split
    assert len(kinks) >= 1
    assert ratio.max() <= 1.0 + 1e-12
    assert_allclose(sampled.steps_s.sum(), 500.0, rtol=1e-13)


def test_the_extremal_conserves_its_hamiltonian() -> None:
    """H = u^2/2 + lambda . f is constant: the costate equations belong to the state equations."""
    scale = extremal_scale(20.0, MASS, EXHAUST, 500.0, SPIN)
    kind, params = FIELD.kind, FIELD.params

    def hamiltonian(y: np.ndarray) -> float:
        rate = np.zeros(14)
        saturated = thrust_ratio(scale.flow, False, y)[0] > 1.0
        extremal_rates(kind, params, scale, saturated, y, rate)
        u = 1.0 if saturated else thrust_ratio(scale.flow, False, y)[0]
        return 0.5 * u * u + y[7:14] @ rate[:7]

    y0 = scaled_start(scale, [100.0, 200.0, 500.0], [0.1, 0.2, -0.1], COSTATES.costates)

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        out = np.zeros(14)
        extremal_rates(kind, params, scale, thrust_ratio(scale.flow, False, y)[0] > 1.0, y, out)
        return out

    flown = solve_ivp(rates, (0.0, 1.0), y0, method="DOP853", rtol=1e-11, atol=1e-13, max_step=0.01)
    values = [hamiltonian(y) for y in flown.y.T]
    assert np.ptp([thrust_ratio(scale.flow, False, y)[0] for y in flown.y.T]) > 0.5
    assert_allclose(values, values[0], rtol=1e-9)


def test_the_extremal_control_minimises_the_hamiltonian() -> None:
    """Among admissible thrusts, eqs 9-11 give the least u^2/2 + lambda_v . thrust/m - lambda_m flow u."""
    scale = extremal_scale(20.0, MASS, EXHAUST, 500.0, SPIN)
    rng = np.random.default_rng(2)
    for size in (0.5, 3.0):
        y = np.r_[rng.normal(size=6), 0.9, size * rng.normal(size=7)]
        y[13] = abs(y[13])

        def cost(thrust: np.ndarray, y: np.ndarray = y) -> float:
            u = np.linalg.norm(thrust)
            return float(0.5 * u * u + y[10:13] @ thrust / y[6] - y[13] * scale.flow * u)

        best = np.zeros(3)
        control.scaled_thrust(scale, bool(thrust_ratio(scale.flow, False, y)[0] > 1.0), y, best)
        others = rng.normal(size=(3000, 3))
        others *= (rng.uniform(size=3000) ** (1 / 3) / np.linalg.norm(others, axis=1))[:, None]
        others = np.concatenate([others, best + 0.01 * rng.normal(size=(500, 3))])
        others = others[np.linalg.norm(others, axis=1) <= 1.0]
        assert cost(best) <= min(cost(o) for o in others)


def test_under_another_field_the_stored_thrust_stays_as_planned() -> None:
    legs = [COSTATES, arc_after(COSTATES)]
    heavier = harmonics_field(1.05 * 4.892, 246.0, -0.03922, 0.003742)
    planned, slow, fast = fly(legs, "gauss"), fly(legs, "dop853", heavier), fly(legs, "gauss", heavier)
    assert_allclose(fast.position_m[-1], slow.position_m[-1], rtol=0, atol=1e-6)
    assert np.linalg.norm(fast.position_m[-1] - planned.position_m[-1]) > 0.1
    assert_allclose(fast.thrust_n, planned.thrust_n, rtol=1e-12, atol=1e-12)
    assert_allclose(fast.mass_kg, planned.mass_kg, rtol=1e-14)


def test_many_flights_equal_single_ones() -> None:
    flights = [[NODES], [COSTATES]]
    many = replay_many(
        START, REST, MASS, flights, rotation_rate_rad_s=SPIN, field=FIELD, exhaust_velocity_m_s=EXHAUST
    )
    for legs, flown in zip(flights, many, strict=True):
        assert np.array_equal(flown.position_m, fly(list(legs), "gauss").position_m)


def test_thrust_nodes_are_flown_in_steps_as_short_as_is_asked() -> None:
    nodes = ThrustNodesLeg(1200.0, np.ones((40, 3)))
    assert control.sampled_control(nodes, SPIN, EXHAUST).steps_s.tolist() == [30.0] * 40
    sampled = control.sampled_control(nodes, SPIN, EXHAUST, 7.0)
    assert sampled.steps_s.tolist() == [6.0] * 200
    np.testing.assert_array_equal(
        sampled.knots[5::5], control.sampled_control(nodes, SPIN, EXHAUST).knots[1:]
    )


def test_flights_over_facets_take_short_steps_and_others_their_nodes() -> None:
    shape = box((100.0, 100.0, 100.0), (-50.0, -50.0, -50.0))
    nodes = ThrustNodesLeg(1200.0, np.zeros((40, 3)))
    longest = [
        np.diff(fly([nodes], "gauss", field).t_s).max()
        for field in (FIELD, polyhedron_field(shape.vertices, shape.faces, 5.0))
    ]
    assert_allclose(longest, [30.0, 6.0], rtol=1e-12)
