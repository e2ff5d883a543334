"""The program of the information objective: its slopes, its splines, its limits."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from information_samples import sensor, small_case
from numpy.testing import assert_allclose

from landing_cli.body.clearance import signed_distances
from landing_cli.flight.legs import LinearAccelerationLeg
from landing_cli.observe.first_order_hold import first_order_hold
from landing_cli.observe.information_program import (
    SplineFlight,
    energy,
    held_along,
    information_program,
    mean_sigma,
    spline_flight,
    thrust_along,
    thrust_with_slopes,
)
from landing_cli.observe.records import ObserveCase
from landing_cli.observe.spline_path import spline_samples


def flight_of(knots: int = 4, **changes: Any) -> tuple[SplineFlight, np.ndarray]:
    """A spline on the small case, and knots that wander off the straight line."""
    case: ObserveCase = small_case(**changes)
    flight = spline_flight(case, 600.0, knots)
    share = (flight.knot_s / 600.0)[:, None]
    line = case.position_m + share * (case.frame.origin_m - case.position_m)
    return flight, line + 8.0 * np.random.default_rng(3).normal(size=line.shape)


def central(function: Any, knots: np.ndarray, step: float) -> np.ndarray:
    """Differences of a number by the knots, fourth order."""
    slope = np.zeros(knots.size)
    for k in range(knots.size):
        along = np.zeros(knots.size)
        along[k] = step
        along = along.reshape(knots.shape)
        near, far = (function(knots + c * along) - function(knots - c * along) for c in (1, 2))
        slope[k] = (8.0 * near - far) / (12.0 * step)
    return slope


def test_the_spline_is_clamped_and_passes_its_knots() -> None:
    knots = np.random.default_rng(1).normal(size=(3, 3))
    times = np.array([0.0, 10.0, 20.0, 30.0, 40.0])
    v0, start, end = np.array([1.0, -2.0, 0.5]), np.array([5.0, 6.0, 7.0]), np.array([-1.0, 0.0, 1.0])
    r, v, a = spline_samples(times, times[1:4], 40.0, start, v0, end).at(knots)
    assert_allclose(r, np.concatenate([[start], knots, [end]]), rtol=0, atol=1e-13)
    assert_allclose(v[0], v0, rtol=0, atol=1e-14)
    assert_allclose(v[-1], 0.0, rtol=0, atol=1e-14)
    inner = spline_samples(np.array([15.0 - 1e-3, 15.0, 15.0 + 1e-3]), times[1:4], 40.0, start, v0, end)
    r, v, a = inner.at(knots)
    assert_allclose((r[2] - 2 * r[1] + r[0]) / 1e-6, a[1], rtol=1e-6)


def test_the_energy_is_the_integral_of_the_thrust_squared() -> None:
    from scipy.integrate import simpson

    flight, knots = flight_of()
    J, _, _ = energy(flight, thrust_with_slopes(flight, knots))
    fine = np.linspace(0.0, 600.0, 20001)
    u = thrust_along(flight, flight.samples(fine), knots)
    assert_allclose(J, simpson((u * u).sum(axis=1), x=fine), rtol=1e-9)


@pytest.mark.parametrize("boresight", ["nadir", "site"])
def test_slopes_by_the_knots_are_exact(boresight: Any) -> None:
    flight, knots = flight_of(sensor=sensor(boresight=boresight))
    held = held_along(flight, knots, 0.2)
    _, slope, _ = energy(flight, thrust_with_slopes(flight, knots))
    differences = central(lambda k: energy(flight, thrust_with_slopes(flight, k))[0], knots, 1e-2)
    assert_allclose(slope, differences, rtol=0, atol=1e-8 * np.abs(slope).max())
    _, slope = mean_sigma(flight, held, knots)
    differences = central(lambda k: mean_sigma(flight, held, k)[0], knots, 1e-2)
    assert_allclose(slope, differences, rtol=0, atol=1e-8 * np.abs(slope).max())


def test_the_curvature_of_the_energy_is_its_own_without_a_field_gradient() -> None:
    """Gauss-Newton leaves out what the field's third derivatives add: 1e-3 here."""
    flight, knots = flight_of()
    _, _, curvature = energy(flight, thrust_with_slopes(flight, knots))

    def slope(k: np.ndarray) -> np.ndarray:
        return energy(flight, thrust_with_slopes(flight, k))[1]

    along = np.random.default_rng(0).normal(size=knots.shape)
    change = (slope(knots + 0.1 * along) - slope(knots - 0.1 * along)) / 0.2
    assert_allclose(curvature @ along.ravel(), change, rtol=0, atol=5e-3 * np.abs(change).max())


def test_slopes_of_the_limits_are_exact() -> None:
    changes = {"clearance_m": 60.0, "clearance_free_m": 40.0, "glide_slope_half_angle_rad": 1.2}
    flight, knots = flight_of(**changes)
    program = information_program(flight, held_along(flight, knots, 0.2), knots, 1e-2, 0.1)
    x = np.zeros(knots.size)
    rows, along = program.smooth(x), np.random.default_rng(4).normal(size=knots.size)
    assert (rows.inequality < 0.0).any() and (rows.inequality > 0.0).any()
    step = 1e-6
    change = (program.smooth(x + step * along).inequality - program.smooth(x - step * along).inequality) / (
        2.0 * step
    )
    assert_allclose(rows.inequality_slope @ along, change, rtol=0, atol=1e-6 * np.abs(change).max())
    moved = program.smooth(x + 0.1 * np.sign(along))
    assert (rows.inequality - moved.inequality <= rows.fall + 1e-12).all()


def test_the_room_to_the_terrain_is_that_of_the_distance() -> None:
    flight, knots = flight_of(clearance_m=60.0, clearance_free_m=40.0)
    program = information_program(flight, held_along(flight, knots, 0.2), knots, 1e-2, 0.1)
    rows = program.smooth(np.zeros(knots.size))
    position = flight.check.at(knots)[0]
    distance = signed_distances(flight.case.surface, position)
    away = np.linalg.norm(position - flight.case.frame.origin_m, axis=1)
    asked = np.where(away > 40.0 - 1.5 * flight.length_m / 600.0, distance - 60.0, distance)
    kept = rows.inequality[len(flight.thrust.t_s) :] >= 0.0
    worst = np.append(asked, np.full(-len(asked) % 15, np.inf)).reshape(-1, 15).min(axis=1)
    clear = np.abs(worst) > 0.02
    assert (kept == (worst >= 0.0))[clear].all() and not kept.all() and kept.any()


def test_a_spline_held_linear_lands_exactly() -> None:
    """By the independent integrator of the replay, and with hardly more energy than the spline."""
    from landing_cli.flight.replay import replay

    flight, knots = flight_of()
    case, nodes = flight.case, np.linspace(0.0, 600.0, 121)
    r, v, _ = flight.samples(nodes).at(knots)
    wanted = thrust_along(flight, flight.samples(nodes), knots)
    states, u, gap = first_order_hold(case.asteroid, nodes, np.concatenate([r, v], axis=1), wanted)
    assert gap < 1e-9
    landed = replay(
        case.position_m,
        case.velocity_m_s,
        case.spacecraft.mass_kg,
        [LinearAccelerationLeg(nodes, u)],
        rotation_rate_rad_s=case.asteroid.rotation_rate_rad_s,
        field=case.asteroid.gravity,
        exhaust_velocity_m_s=case.spacecraft.exhaust_velocity_m_s,
        integrator="gauss",
    )
    assert_allclose(landed.position_m[-1], case.frame.origin_m, rtol=0, atol=1e-6)
    assert_allclose(landed.velocity_m_s[-1], 0.0, rtol=0, atol=1e-8)
    assert_allclose(u, wanted, rtol=0, atol=1e-4 * np.abs(wanted).max())
    assert np.abs(states[:, :3] - r).max() < 0.05


def test_a_weight_of_zero_leaves_the_energy() -> None:
    flight, knots = flight_of()
    held = replace(held_along(flight, knots, 0.2))
    program = information_program(flight, held, knots, 2.0, 0.0)
    J, slope, _ = energy(flight, thrust_with_slopes(flight, knots))
    found = program.objective(np.zeros(knots.size))
    assert_allclose(found.value, J / 2.0, rtol=1e-14)
    assert_allclose(found.slope, slope * flight.length_m / 2.0, rtol=1e-13, atol=1e-16)
