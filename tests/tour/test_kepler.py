"""Kepler's problem against closed forms, its own reversal, the invariants and scipy's DOP853."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import from_python
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from landing_cli.flight.astronomy import AU_M, DAY_S, GM_SUN_M3_S2
from landing_cli.flight.elements import (
    OrbitElements,
    elements_of,
    elements_of_catalogue,
    states_at,
    states_of,
)
from landing_cli.flight.kepler import propagate_kepler, stumpff_g as stumpff_g_part

stumpff_g = from_python(stumpff_g_part)

MU = GM_SUN_M3_S2
YEAR_S = 365.25 * DAY_S


def random_states(n: int, seed: int, speed: tuple[float, float]) -> np.ndarray:
    """States 0.3 to 5 au from the Sun; speeds in units of the local escape speed."""
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=(2, n, 3))
    direction /= np.linalg.norm(direction, axis=2)[..., None]
    r = AU_M * np.exp(rng.uniform(np.log(0.3), np.log(5.0), n))
    v = rng.uniform(*speed, n) * np.sqrt(2.0 * MU / r)
    return np.hstack([r[:, None] * direction[0], v[:, None] * direction[1]])


@pytest.mark.parametrize("speed", [(0.1, 0.99), (0.999, 1.001), (1.01, 3.0)], ids=["ellipse", "near", "open"])
def test_there_and_back_again(speed: tuple[float, float]) -> None:
    states = random_states(4000, 1, speed)
    dt = np.random.default_rng(2).uniform(-3.0, 3.0, len(states)) * YEAR_S
    there = propagate_kepler(states, dt, MU)
    back = propagate_kepler(there, -dt, MU)
    # near the Sun the state is worth less: a fixed error in r and v moves the period by r_far/q
    off = np.linalg.norm((back - states)[:, 3:], axis=1) / np.linalg.norm(states[:, 3:], axis=1)
    assert np.isfinite(off).all()
    assert np.median(off) < 1e-14
    assert np.quantile(off, 0.99) < 1e-10


@pytest.mark.parametrize("speed", [(0.4, 0.95), (1.05, 2.0)], ids=["ellipse", "open"])
def test_against_dop853(speed: tuple[float, float]) -> None:
    for state in random_states(6, 3, speed):
        flown = solve_ivp(
            lambda t, y: np.concatenate([y[3:], -MU * y[:3] / np.linalg.norm(y[:3]) ** 3]),
            (0.0, YEAR_S),
            state,
            method="DOP853",
            rtol=1e-13,
            atol=[1e-3] * 3 + [1e-10] * 3,
        ).y[:, -1]
        ours = propagate_kepler(state, YEAR_S, MU)[0]
        assert_allclose(ours[:3], flown[:3], rtol=0, atol=1e-9 * np.linalg.norm(flown[:3]))
        assert_allclose(ours[3:], flown[3:], rtol=0, atol=1e-9 * np.linalg.norm(flown[3:]))


def test_energy_and_momentum_stay() -> None:
    states = random_states(3000, 5, (0.2, 2.0))
    flown = propagate_kepler(states, 2.3 * YEAR_S, MU)

    def invariants(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        r, v = rows[:, :3], rows[:, 3:]
        potential = MU / np.linalg.norm(r, axis=1)
        return 0.5 * (v**2).sum(axis=1) - potential, np.cross(r, v), potential

    (e0, h0, u0), (e1, h1, u1) = invariants(states), invariants(flown)
    assert (np.abs(e1 - e0) / np.maximum(u0, u1)).max() < 1e-12
    arm = sum(
        np.linalg.norm(rows[:, :3], axis=1) * np.linalg.norm(rows[:, 3:], axis=1) for rows in (states, flown)
    )
    assert (np.linalg.norm(h1 - h0, axis=1) / arm).max() < 1e-12


def test_whole_revolutions_return() -> None:
    a = 1.3 * AU_M
    elements = elements_of_catalogue(2_459_000.5, [1.3], [0.5], [10.0], [20.0], [30.0], [40.0])
    state = states_of(elements)
    period = 2.0 * np.pi * np.sqrt(a**3 / MU)
    for turns in (1, 2, -3):
        flown = propagate_kepler(state, turns * period, MU)
        assert_allclose(flown[0, :3], state[0, :3], rtol=0, atol=1e-12 * a)


def test_no_time_changes_nothing() -> None:
    state = random_states(1, 8, (0.5, 0.6))
    assert_allclose(propagate_kepler(state, 0.0, MU), state, rtol=0, atol=0)


def test_rectilinear_fall() -> None:
    """Free fall from rest for a known time: t = sqrt(a^3/mu) (pi - E + e sin E) with e = 1."""
    a, anomaly = 0.5 * AU_M, 2.0  # from apoapsis 2a at E = pi down to E = 2
    t = np.sqrt(a**3 / MU) * (np.pi - (anomaly - np.sin(anomaly)))
    fallen = propagate_kepler([2.0 * a, 0.0, 0.0, 0.0, 0.0, 0.0], t, MU)[0]
    assert_allclose(fallen[0], a * (1.0 - np.cos(anomaly)), rtol=1e-13)


@pytest.mark.parametrize("psi", [0.4999, 0.5001, -0.4999, -0.5001, 1e-12, 30.0, -30.0])
def test_stumpff_functions(psi: float) -> None:
    """Against their power series summed with exact integers."""
    from fractions import Fraction
    from math import factorial

    exact = [float(sum(Fraction(-psi) ** k / factorial(2 * k + n) for k in range(60))) for n in range(4)]
    assert_allclose(stumpff_g(psi, 1.0), exact, rtol=0, atol=3e-15 * max(1.0, exact[0]))


def test_elements_round_trip() -> None:
    rng = np.random.default_rng(4)
    n = 2000
    elements = elements_of_catalogue(
        rng.uniform(2.45e6, 2.46e6, n),
        rng.uniform(0.6, 4.0, n),
        rng.uniform(0.001, 0.97, n),
        rng.uniform(0.01, 179.0, n),
        *(rng.uniform(0.0, 360.0, n) for _ in range(3)),
    )
    back = elements_of(states_of(elements), elements.epoch_t_s)
    assert_allclose(back.a_m, elements.a_m, rtol=1e-11)
    assert_allclose(back.e, elements.e, rtol=0, atol=1e-12)
    assert_allclose(back.inclination_rad, elements.inclination_rad, rtol=0, atol=1e-12)
    for name in ("node_rad", "argument_rad", "mean_anomaly_rad"):
        turn = getattr(back, name) - getattr(elements, name)
        # the argument is as sharp as the eccentricity is large, the node as the inclination
        weight = np.minimum(elements.e, np.sin(elements.inclination_rad))
        assert np.abs(weight * np.sin(0.5 * turn)).max() < 1e-13, name


def test_hyperbolic_elements_round_trip() -> None:
    states = random_states(500, 6, (1.1, 2.0))
    assert_allclose(states_of(elements_of(states, 0.0)), states, rtol=0, atol=1e-10 * AU_M)
    speeds = states_of(elements_of(states, 0.0))[:, 3:] - states[:, 3:]
    assert np.linalg.norm(speeds, axis=1).max() < 1e-5


def test_a_known_orbit() -> None:
    """A quarter past perihelion of a circle, by hand: x = -a sin, along the ecliptic's y at longitude 90."""
    circle = elements_of_catalogue(2_451_545.0, [1.0], [0.0], [0.0], [0.0], [0.0], [90.0])
    speed = np.sqrt(MU / AU_M)
    assert_allclose(states_of(circle)[0], [0.0, AU_M, 0.0, -speed, 0.0, 0.0], rtol=0, atol=1e-15 * AU_M)
    tilted = elements_of_catalogue(2_451_545.0, [1.0], [0.0], [90.0], [90.0], [0.0], [90.0])
    assert_allclose(states_of(tilted)[0, :3], [0.0, 0.0, AU_M], rtol=0, atol=1e-15 * AU_M)


def test_states_at_another_time_are_the_same_orbit() -> None:
    elements = elements_of_catalogue(
        2_458_666.5, [1.9, 1.2], [0.5, 0.3], [5.0, 6.0], [168, 10], [147, 81], [78, 95]
    )
    later = states_at(elements, 6.7e8)
    again = elements_of(later, 6.7e8)
    assert_allclose(again.a_m, elements.a_m, rtol=1e-12)
    motion = np.sqrt(MU / elements.a_m**3)
    expected = elements.mean_anomaly_rad + motion * (6.7e8 - elements.epoch_t_s)
    assert_allclose(np.sin(again.mean_anomaly_rad - expected), 0.0, atol=1e-11)


def test_rows_of_elements() -> None:
    elements = elements_of_catalogue(
        [2_458_666.5, 2_459_000.5], [1.9, 1.2], [0.5, 0.3], [5, 6], [1, 2], [3, 4], [5, 6]
    )
    second = elements.rows([1])
    assert isinstance(second, OrbitElements)
    assert_allclose([second.a_m[0], second.epoch_t_s[0]], [1.2 * AU_M, 7455.5 * DAY_S], rtol=1e-15)
