"""Lambert arcs against Kepler's problem flown forwards, and against lamberthub's solvers."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import from_python
from numpy.testing import assert_allclose

from landing_cli.flight.astronomy import AU_M, DAY_S, GM_SUN_M3_S2
from landing_cli.flight.elements import elements_of_catalogue, states_of
from landing_cli.flight.kepler import propagate_kepler
from landing_cli.tour.lambert import lambert_arcs, solve_lambert
from landing_cli.tour.lambert_time import (
    least_time as least_time_part,
    solve_x as solve_x_part,
    time_of_flight as time_of_flight_part,
)

time_of_flight = from_python(time_of_flight_part)

least_time = from_python(least_time_part)
solve_x = from_python(solve_x_part)

MU = GM_SUN_M3_S2
ARCS = 10_000


def random_orbits(n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """States on prograde orbits, and their periods."""
    rng = np.random.default_rng(seed)
    a_au, e, inclination = rng.uniform(0.6, 3.0, n), rng.uniform(0.0, 0.9, n), rng.uniform(0.0, 89.0, n)
    elements = elements_of_catalogue(
        2_459_000.5, a_au, e, inclination, *(rng.uniform(0.0, 360.0, n) for _ in range(3))
    )
    return states_of(elements), 2.0 * np.pi * np.sqrt(elements.a_m**3 / MU)


def sine_of_angle(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    cross = np.linalg.norm(np.cross(first, second), axis=1)
    return cross / (np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1))


def velocity_error(start: np.ndarray, end: np.ndarray, tof: np.ndarray, turns: int) -> np.ndarray:
    """Distance of the nearer of the two arcs from the velocities that were flown, m/s."""
    errors = []
    for right in (False, True):
        first, second = solve_lambert(start[:, :3], end[:, :3], tof, MU, turns, right)
        one = np.linalg.norm(first - start[:, 3:], axis=1)
        errors.append(np.hypot(one, np.linalg.norm(second - end[:, 3:], axis=1)))
    return np.fmin(*errors)


@pytest.mark.parametrize("turns", [0, 1, 2])
def test_flown_arcs_are_recovered(turns: int) -> None:
    start, period = random_orbits(ARCS, 10 + turns)
    tof = (turns + np.random.default_rng(turns).uniform(0.01, 0.99, ARCS)) * period
    end = propagate_kepler(start, tof, MU)
    error = velocity_error(start, end, tof, turns) * sine_of_angle(start[:, :3], end[:, :3])
    assert error.max() < 1e-6
    assert np.median(error) < 1e-10


@pytest.mark.parametrize("turns", [0, 1, 2])
def test_near_180_degrees(turns: int) -> None:
    """Within 0.01 degrees of opposition, either side; the plane is worth 1/sin less."""
    start, period = random_orbits(ARCS, 20 + turns)
    rng = np.random.default_rng(turns)
    off = np.radians(rng.uniform(1e-5, 0.01, ARCS)) * rng.choice([-1.0, 1.0], ARCS)
    # the time at which the true anomaly has grown by 180 degrees + off
    r, v = start[:, :3], start[:, 3:]
    momentum = np.cross(r, v)
    h = np.linalg.norm(momentum, axis=1)
    distance = np.linalg.norm(r, axis=1)
    eccentricity = np.cross(v, momentum) / MU - r / distance[:, None]
    e = np.linalg.norm(eccentricity, axis=1)
    ahead = np.cross(momentum, eccentricity) / h[:, None]
    nu = np.arctan2(np.einsum("ij,ij->i", r, ahead), np.einsum("ij,ij->i", r, eccentricity))

    def mean(anomaly: np.ndarray) -> np.ndarray:
        turn = 2.0 * np.arctan2(
            np.sqrt(1.0 - e) * np.sin(anomaly / 2.0), np.sqrt(1.0 + e) * np.cos(anomaly / 2.0)
        )
        return turn - e * np.sin(turn)

    share = np.remainder(mean(nu + np.pi + off) - mean(nu), 2.0 * np.pi) / (2.0 * np.pi)
    tof = (turns + share) * period
    end = propagate_kepler(start, tof, MU)
    sine = sine_of_angle(r, end[:, :3])
    assert sine.max() < np.sin(np.radians(0.0101))
    error = velocity_error(start, end, tof, turns)
    assert (error * sine).max() < 1e-6
    assert np.median(error * sine) < 1e-10
    # the size of the velocity does not depend on the plane
    sizes = [
        np.abs(
            np.linalg.norm(solve_lambert(r, end[:, :3], tof, MU, turns, right)[0], axis=1)
            - np.linalg.norm(v, axis=1)
        )
        for right in (False, True)
    ]
    assert np.quantile(np.fmin(*sizes), 0.99) < 1e-8


def test_hyperbolic_and_parabolic_arcs() -> None:
    start, _ = random_orbits(3000, 31)
    escape = np.sqrt(2.0 * MU / np.linalg.norm(start[:, :3], axis=1))
    size = np.random.default_rng(5).choice([1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1.01, 1.3, 3.0], 3000) * escape
    start[:, 3:] *= (size / np.linalg.norm(start[:, 3:], axis=1))[:, None]
    tof = np.random.default_rng(6).uniform(1.0, 900.0, 3000) * DAY_S
    end = propagate_kepler(start, tof, MU)
    error = velocity_error(start, end, tof, 0) * sine_of_angle(start[:, :3], end[:, :3])
    assert error.max() < 1e-6


def hub_cases() -> list[tuple[np.ndarray, np.ndarray, float]]:
    rng = np.random.default_rng(7)
    first = rng.normal(size=(300, 3)) * [AU_M, AU_M, 0.1 * AU_M]
    second = rng.normal(size=(300, 3)) * [AU_M, AU_M, 0.1 * AU_M]
    days = np.exp(rng.uniform(np.log(20.0), np.log(900.0), 300))
    return list(zip(first, second, days * DAY_S, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["gooding1990", "izzo2015"])
def test_against_lamberthub(solver: str) -> None:
    lamberthub = pytest.importorskip("lamberthub")
    solve = getattr(lamberthub, solver)
    for first, second, tof in hub_cases():
        theirs = solve(MU, first, second, tof, maxiter=100, atol=1e-13, rtol=1e-13)
        ours = solve_lambert(first, second, tof, MU)
        for v, w in zip(ours, theirs[:2], strict=True):
            assert_allclose(v[0], w, rtol=0, atol=1e-9 * np.linalg.norm(w))


def test_both_branches_against_lamberthub() -> None:
    lamberthub = pytest.importorskip("lamberthub")
    compared = 0
    for first, second, tof in hub_cases()[:100]:
        for right in (False, True):
            ours = solve_lambert(first, second, 3.0 * tof, MU, 1, right)[0][0]
            if np.isnan(ours).any():
                continue
            theirs = [
                lamberthub.izzo2015(
                    MU, first, second, 3.0 * tof, M=1, low_path=low, maxiter=100, atol=1e-13, rtol=1e-13
                )[0]
                for low in (False, True)
            ]
            assert min(np.linalg.norm(ours - w) for w in theirs) < 1e-8 * np.linalg.norm(ours)
            compared += 1
    assert compared > 50


def test_both_branches_arrive_and_differ() -> None:
    start, period = random_orbits(1000, 41)
    tof = 1.6 * period
    end = propagate_kepler(start, tof, MU)
    left = solve_lambert(start[:, :3], end[:, :3], tof, MU, 1, False)[0]
    right = solve_lambert(start[:, :3], end[:, :3], tof, MU, 1, True)[0]
    for first in (left, right):
        arrived = propagate_kepler(np.hstack([start[:, :3], first]), tof, MU)[:, :3]
        # a multi-revolution arc close to the Sun turns the last digit of v into kilometres
        assert np.quantile(np.linalg.norm(arrived - end[:, :3], axis=1), 0.99) < 1e-7 * AU_M
    assert (np.linalg.norm(left - right, axis=1) > 1e-3).all()


def test_an_arc_exists_exactly_above_the_least_time() -> None:
    rng = np.random.default_rng(9)
    for lam in rng.uniform(-0.999, 0.999, 200):
        rest = 1.0 - lam * lam
        for turns in (1, 2, 5):
            x, least = least_time(lam, rest, turns)
            nearby = [time_of_flight(lam, rest, turns, x + dx) for dx in (-1e-3, 1e-3)]
            assert min(nearby) > least
            assert np.isnan(solve_x(lam, rest, least * (1.0 - 1e-9), turns, False))
            for right in (False, True):
                found = solve_x(lam, rest, least * (1.0 + 1e-6), turns, right)
                assert (found > x) == right
                assert_allclose(time_of_flight(lam, rest, turns, found), least * (1.0 + 1e-6), rtol=1e-12)


def test_time_of_flight_meets_its_series() -> None:
    """The closed form and Battin's series agree where one hands over to the other; mpmath-free."""
    for lam in (-0.9, -0.3, 0.0, 0.4, 0.95):
        rest = 1.0 - lam * lam
        x = np.linspace(0.3, 3.0, 40_001)
        t = np.array([time_of_flight(lam, rest, 0, value) for value in x])
        jumps = np.abs(np.diff(t, 4)) / t[4:]
        assert jumps.max() < 1e-13


def test_all_arcs_at_once() -> None:
    start, period = random_orbits(200, 51)
    out = np.zeros((7, 6))
    for state, t in zip(start, 2.7 * period, strict=True):
        end = propagate_kepler(state, t, MU)[0]
        rows = lambert_arcs(MU, *state[:3], *end[:3], t, 3, out)
        assert rows in (5, 7)
        for row in range(rows):
            turns, right = (row + 1) // 2, row % 2 == 0
            first, second = solve_lambert(state[:3], end[:3], t, MU, turns, right)
            assert_allclose(out[row], np.concatenate([first[0], second[0]]), rtol=0, atol=0)
        missing = solve_lambert(state[:3], end[:3], t, MU, 3, False)[0]
        assert np.isnan(missing).any() == (rows == 5)


def test_positions_on_one_line_have_no_plane() -> None:
    first, _ = solve_lambert([AU_M, 0.0, 0.0], [-AU_M, 0.0, 0.0], 100.0 * DAY_S, MU)
    assert np.isnan(first).all()
