"""The transcription with free thrust against closed forms of the double integrator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from planning_samples import lumpy_case

from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.optimize.cone_program import ConeOptions, solve_cone_program
from landing_cli.plan.free_flight import SPENT, FreeFlight, free_flight_program, packed, unpacked
from landing_cli.plan.records import MassModel, Objective, PlanCase, TerminalConditions
from landing_cli.plan.starting_paths import boundary_cubic

DISTANCE_M, TOF_S = 30_000.0, 1500.0
TIGHT = ConeOptions(progress_tol=1e-9)


@pytest.fixture(scope="module")
def drifting() -> PlanCase:
    """From rest to rest over 30 km, with next to no gravity and no rotation."""
    case = lumpy_case(landing_velocity_m_s=np.zeros(3), velocity_m_s=np.zeros(3), tof_s=TOF_S)
    asteroid = replace(case.asteroid, rotation_rate_rad_s=0.0, gravity=point_mass_field(1e-6), gm_m3_s2=1e-6)
    start = case.site.position_m + np.array([0.6, 0.0, 0.8]) * DISTANCE_M
    return replace(case, asteroid=asteroid, position_m=start)


def solved(
    case: PlanCase, objective: Objective, nodes: int = 151, terminal: TerminalConditions = "rest"
) -> tuple[FreeFlight, np.ndarray]:
    times = np.linspace(0.0, case.tof_s, nodes)
    flight = FreeFlight(case, times, np.inf, 0, 1, objective, terminal)
    start = packed(flight, boundary_cubic(case, times), np.zeros((nodes, 3)))
    solution = solve_cone_program(free_flight_program(flight), start, TIGHT)
    assert solution.status == "converged"
    return flight, solution.x


def test_least_energy_is_a_linear_thrust(drifting: PlanCase) -> None:
    """u = 6 d (1 - 2 t/T) / T^2 from rest to rest."""
    strong = replace(drifting, spacecraft=replace(drifting.spacecraft, thrust_max_n=200.0))
    flight, x = solved(strong, "energy", 21)
    _, u, _ = unpacked(flight, x)
    towards = strong.site.position_m - strong.position_m
    ideal = 6.0 / TOF_S**2 * (1.0 - 2.0 * flight.times_s[:, None] / TOF_S) * towards
    assert_allclose(u, ideal, rtol=0, atol=2e-5 * np.abs(ideal).max())


def test_least_fuel_is_full_thrust_at_both_ends(drifting: PlanCase) -> None:
    """Bang-off-bang: a t1 (T - t1) = d, and the velocity increment is 2 a t1; a linear hold costs more."""
    flight, x = solved(drifting, "fuel")
    a = drifting.spacecraft.thrust_max_n / drifting.spacecraft.mass_kg
    ideal = a * (TOF_S - np.sqrt(TOF_S**2 - 4.0 * DISTANCE_M / a))
    spent = x[flight.columns[-1, SPENT]] * a * TOF_S
    assert ideal <= spent * (1 + 1e-6)
    assert_allclose(spent, ideal, rtol=2e-3)


def test_too_little_time_tells_the_thrust_that_it_takes(drifting: PlanCase) -> None:
    """From rest to rest over d in T, no less than 4 d / T^2 will do."""
    tof = 900.0
    _, x = solved(replace(drifting, tof_s=tof), "fuel")
    a = drifting.spacecraft.thrust_max_n / drifting.spacecraft.mass_kg
    assert_allclose(1.0 + x[-1], 4.0 * DISTANCE_M / tof**2 / a, rtol=1e-2)  # switching takes one arc


@pytest.mark.parametrize("mass_model", ["constant", "variable"])
def test_thrust_keeps_its_bound_on_the_flown_mass(drifting: PlanCase, mass_model: MassModel) -> None:
    flight, x = solved(replace(drifting, mass_model=mass_model), "fuel")
    _, u, _ = unpacked(flight, x)
    craft = drifting.spacecraft
    size = np.linalg.norm(u, axis=1)
    middle = np.linalg.norm(0.5 * (u[1:] + u[:-1]), axis=1)
    spent = np.append(0.0, np.cumsum(np.diff(flight.times_s) * (size[1:] + 4.0 * middle + size[:-1]) / 6.0))
    mass = craft.mass_kg * np.exp(-spent / craft.exhaust_velocity_m_s)
    thrust = size * (mass if mass_model == "variable" else craft.mass_kg)
    assert_allclose(thrust.max(), craft.thrust_max_n, rtol=2e-6)
    assert np.isclose(thrust, craft.thrust_max_n, rtol=1e-5).sum() > 20


def test_landing_as_in_equation_4(drifting: PlanCase) -> None:
    """At touchdown no acceleration, and the jerk along -n_f."""
    flight, x = solved(drifting, "fuel", 81, "paper")
    _, u, _ = unpacked(flight, x)
    normal = drifting.site.normal
    assert_allclose(u[-1], 0.0, atol=1e-8)
    jerk = u[-1] - u[-2]
    assert jerk @ normal < 0.0
    assert_allclose(jerk / np.linalg.norm(jerk), -normal, rtol=0, atol=1e-5)


def test_propellant_is_a_bound(drifting: PlanCase) -> None:
    """Least energy burns more than least fuel; with less on board it has to make do."""
    flight, free = solved(drifting, "energy")
    scale = flight.acceleration_m_s2 * TOF_S
    wanted = drifting.spacecraft.mass_kg * free[flight.columns[-1, SPENT]] * scale
    wanted /= drifting.spacecraft.exhaust_velocity_m_s
    short = replace(drifting, spacecraft=replace(drifting.spacecraft, propellant_kg=0.9 * wanted))
    flight, x = solved(short, "energy")
    used = drifting.spacecraft.mass_kg * x[flight.columns[-1, SPENT]] * scale
    assert_allclose(used / drifting.spacecraft.exhaust_velocity_m_s, 0.9 * wanted, rtol=1e-6)
