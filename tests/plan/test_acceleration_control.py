"""Thrust acceleration at any time and its re-flight: against curve, polynomials, another integrator."""

from __future__ import annotations

import numpy as np
import pytest
from planning_samples import lumpy_case

from landing_cli.flight import acceleration_control
from landing_cli.flight.acceleration_control import thrust_accelerations
from landing_cli.flight.bezier_curve import curve_states, first_control_points, last_control_points
from landing_cli.flight.legs import AccelerationLeg, BezierLeg, GaussAccelerationLeg, LinearAccelerationLeg
from landing_cli.flight.replay import replay
from landing_cli.plan.records import PlanCase
from landing_cli.plan.sampled_flight import sampled_flight

CASE = lumpy_case()
SPIN = CASE.asteroid.rotation_rate_rad_s


def bezier_leg(case: PlanCase = CASE) -> BezierLeg:
    first = first_control_points(7, case.tof_s, case.position_m, case.velocity_m_s, case.acceleration_m_s2)
    last = last_control_points(7, case.tof_s, case.site.position_m, np.zeros(3), np.zeros(3))
    guides = [[-9000.0, 17000.0, 500.0], case.site.position_m + 4000.0 * case.site.normal]
    return BezierLeg(case.tof_s, np.concatenate([first, guides, last]), case.asteroid.gravity)


def flown(legs: tuple[AccelerationLeg, ...], integrator: str):
    return replay(
        CASE.position_m,
        CASE.velocity_m_s,
        CASE.spacecraft.mass_kg,
        legs,
        rotation_rate_rad_s=SPIN,
        field=CASE.asteroid.gravity,
        exhaust_velocity_m_s=CASE.spacecraft.exhaust_velocity_m_s,
        integrator=integrator,
    )


def some_legs() -> dict[str, tuple[AccelerationLeg, ...]]:
    """The Bezier curve's thrust in three forms, and two legs in a row."""
    leg = bezier_leg()
    times = np.linspace(0.0, leg.duration_s, 41)
    nodes = 0.5 * leg.duration_s * (np.polynomial.legendre.leggauss(24)[0] + 1.0)
    gauss = GaussAccelerationLeg(
        np.array([0.0, leg.duration_s]), thrust_accelerations(leg, nodes, SPIN)[None]
    )
    linear = LinearAccelerationLeg(times, thrust_accelerations(leg, times, SPIN))
    half = LinearAccelerationLeg(times[:21], linear.acceleration_m_s2[:21])
    rest = LinearAccelerationLeg(times[20:] - times[20], linear.acceleration_m_s2[20:])
    return {"bezier": (leg,), "linear": (linear,), "gauss": (gauss,), "two": (half, rest)}


LEGS = some_legs()


@pytest.mark.parametrize("kind", LEGS)
@pytest.mark.parametrize("integrator", ["dop853", "gauss"])
def test_both_integrators_fly_a_leg_to_the_same_end(kind: str, integrator: str) -> None:
    other = flown(LEGS[kind], "gauss" if integrator == "dop853" else "dop853")
    path = flown(LEGS[kind], integrator)
    assert np.linalg.norm(path.position_m[-1] - other.position_m[-1]) < 1e-5
    assert path.mass_kg[-1] == pytest.approx(other.mass_kg[-1], rel=1e-8)


def test_the_thrust_of_a_curve_flies_the_curve() -> None:
    leg = LEGS["bezier"][0]
    assert isinstance(leg, BezierLeg)
    path = flown((leg,), "dop853")
    r, v, _ = curve_states(leg.points_m, leg.duration_s, path.t_s / leg.duration_s)
    assert np.abs(path.position_m - r).max() < 1e-5
    assert np.abs(path.velocity_m_s - v).max() < 1e-8


def test_two_legs_in_a_row_are_the_whole() -> None:
    whole, parts = flown(LEGS["linear"], "gauss"), flown(LEGS["two"], "gauss")
    assert np.linalg.norm(whole.position_m[-1] - parts.position_m[-1]) < 1e-7


@pytest.mark.parametrize("nodes", [1, 2, 5, 40])
def test_polynomials_through_gauss_nodes_are_exact_up_to_their_degree(nodes: int) -> None:
    rng = np.random.default_rng(nodes)
    edges = np.array([0.0, 30.0, 100.0])
    coefficients = rng.normal(size=(2, 3, nodes))
    x, _ = np.polynomial.legendre.leggauss(nodes)
    values = np.stack(
        [np.stack([np.polynomial.legendre.legval(x, c) for c in own], axis=1) for own in coefficients]
    )
    leg = GaussAccelerationLeg(edges, values)
    t = np.concatenate([np.linspace(0.0, 29.99, 50), np.linspace(30.0, 100.0, 50)])
    own = (t >= 30.0).astype(int)
    local = 2.0 * (t - edges[own]) / np.diff(edges)[own] - 1.0
    expected = [
        [np.polynomial.legendre.legval(s, c) for c in coefficients[k]]
        for s, k in zip(local, own, strict=True)
    ]
    np.testing.assert_allclose(thrust_accelerations(leg, t, 0.0), expected, rtol=1e-11, atol=1e-11)


def test_a_gauss_leg_answers_at_its_own_nodes() -> None:
    x, _ = np.polynomial.legendre.leggauss(7)
    values = np.arange(21.0).reshape(1, 7, 3)
    leg = GaussAccelerationLeg(np.array([0.0, 2.0]), values)
    np.testing.assert_allclose(thrust_accelerations(leg, x + 1.0, 0.0), values[0], rtol=1e-12)


@pytest.mark.parametrize("kind", LEGS)
def test_halving_the_steps_moves_the_end_by_less_than_a_tenth_of_a_micrometre(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = flown(LEGS[kind], "gauss").position_m[-1]
    for name in ("_BEZIER_STEPS", "_STEPS_PER_INTERVAL", "_STEPS_PER_GAUSS_NODE"):
        monkeypatch.setattr(acceleration_control, name, 2 * getattr(acceleration_control, name))
    assert np.linalg.norm(flown(LEGS[kind], "gauss").position_m[-1] - usual) < 1e-7


@pytest.mark.parametrize("kind", LEGS)
def test_samples_lie_on_the_flight(kind: str) -> None:
    sampled, spent = sampled_flight(CASE, LEGS[kind])
    exact = flown(LEGS[kind], "dop853")
    at = np.searchsorted(sampled.t_s, exact.t_s[1:-1:7])
    ours = np.stack([np.interp(sampled.t_s[at], exact.t_s, c) for c in exact.position_m.T], axis=1)
    on_grid = np.abs(sampled.t_s[at] - exact.t_s[1:-1:7]) < 1e-9
    assert on_grid.sum() > 10
    assert np.abs(ours - sampled.position_m[at])[on_grid].max() < 1e-3
    assert spent == pytest.approx(
        CASE.spacecraft.exhaust_velocity_m_s * np.log(CASE.spacecraft.mass_kg / exact.mass_kg[-1]), rel=1e-6
    )
