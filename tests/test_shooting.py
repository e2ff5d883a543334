from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from kernel_calls import from_python
from landing_samples import asteroid, flown_by_dop853, landing_case, some_thrust, without_gravity

from landing_cli.body.gravity.field_values import gradients
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.records import LandingCase
from landing_cli.reach.scaled_case import ScaledCase, scale_case
from landing_cli.reach.shooting import (
    Path,
    fly,
    fly_accurately as fly_accurately_part,
    measure_defect as measure_defect_part,
    new_path,
    pull_back as pull_back_part,
)

fly_accurately = from_python(fly_accurately_part)
measure_defect = from_python(measure_defect_part)
pull_back = from_python(pull_back_part)

# Gravity, spin and mass flow well above Bennu's, so that no term hides.
STRONG = asteroid(gravity=8.0, spin=5.0)
THIRSTY = Spacecraft(2000.0, 20.0, 5.0)


def strong_case() -> LandingCase:
    return landing_case(STRONG, spacecraft=THIRSTY)


def flown(scaled: ScaledCase, thrust: np.ndarray) -> Path:
    path = new_path(len(thrust))
    fly(scaled, thrust, path)
    return path


def accurate(scaled: ScaledCase, thrust: np.ndarray, substeps: int) -> np.ndarray:
    samples = np.zeros((len(thrust) * substeps + 1, 7))
    fly_accurately(scaled, thrust, samples)
    return samples


def in_si_and_rotating(case: LandingCase, scaled: ScaledCase, end: np.ndarray) -> np.ndarray:
    w = np.array([0.0, 0.0, case.asteroid.rotation_rate_rad_s])
    position, speed = end[:3] * scaled.length_m, end[3:6] * scaled.length_m / case.descent_s
    return np.concatenate([position, speed - np.cross(w, position), [end[6] * case.spacecraft.mass_kg]])


def test_constant_acceleration_is_flown_exactly() -> None:
    scaled = without_gravity(scale_case(strong_case(), 12))._replace(mass_flow=0.0)
    force = np.array([0.3, -0.5, 0.2])
    path = flown(scaled, np.tile(force, (12, 1)))
    t = np.linspace(0, 1, 13)[:, None]
    position = scaled.position + t * scaled.velocity + 0.5 * t**2 * force
    np.testing.assert_allclose(path.position, position, rtol=0, atol=1e-14)
    np.testing.assert_allclose(path.velocity, scaled.velocity + t * force, rtol=0, atol=1e-14)


def test_gravity_is_taken_where_the_flight_is_in_the_middle_of_the_interval() -> None:
    case, thrust = strong_case(), some_thrust(6)
    scaled = scale_case(case, 6)._replace(mass_flow=0.0)
    weak = scaled.gravity_params * 1e-9  # too weak to bend the flight
    weak.setflags(write=scaled.gravity_params.flags.writeable)
    path = flown(scaled._replace(gravity_params=weak), thrust)
    middle = path.position[:-1] + path.velocity[:-1] / 12 + thrust / 288
    for k, x in enumerate(middle):
        angle = scaled.spin * ((k + 0.5) / 6 - 1.0)
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        expected = turn @ gradients(case.asteroid.gravity, turn.T @ x * scaled.length_m)[0] @ turn.T
        found = path.gradient[k] * 1e9 * scaled.acceleration_m_s2 / scaled.length_m
        upper = expected[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        np.testing.assert_allclose(found, upper, rtol=0, atol=1e-6 * np.abs(expected).max())


def test_mass_falls_with_the_thrust_used() -> None:
    scaled, thrust = scale_case(strong_case(), 12), some_thrust(12)
    used = scaled.mass_flow * np.cumsum(np.linalg.norm(thrust, axis=1)) / 12
    expected = np.append(1.0, 1.0 - used)
    np.testing.assert_allclose(flown(scaled, thrust).mass, expected, rtol=1e-14)
    np.testing.assert_allclose(accurate(scaled, thrust, 3)[::3, 6], expected, rtol=1e-14)
    assert expected[-1] < 0.95


def test_the_simple_flight_is_of_second_order() -> None:
    case, errors = strong_case(), []
    for n in (10, 20, 40, 80):
        scaled, thrust = scale_case(case, n), np.repeat(some_thrust(10), n // 10, axis=0)
        end = accurate(scaled, thrust, 40)[-1]
        path = flown(scaled, thrust)
        errors.append(np.linalg.norm(np.append(path.position[-1], path.velocity[-1]) - end[:6]))
    orders = [np.log2(a / b) for a, b in pairwise(errors)]
    assert errors[0] > 1e-6
    assert 1.8 < min(orders) < max(orders) < 2.2


def test_the_accurate_flight_is_of_fourth_order_towards_dop853() -> None:
    case, thrust = strong_case(), some_thrust(5)
    scaled = scale_case(case, 5)
    truth = flown_by_dop853(case, thrust * case.spacecraft.thrust_max_n)[-1]
    errors = []
    for substeps in (1, 2, 4, 8):
        end = in_si_and_rotating(case, scaled, accurate(scaled, thrust, substeps)[-1])
        errors.append(np.linalg.norm(end[:3] - truth[:3]))
        assert end[6] == pytest.approx(truth[6], rel=1e-13)
    orders = [np.log2(a / b) for a, b in pairwise(errors)]
    assert 3.8 < min(orders) < max(orders) < 4.3
    assert errors[-1] < 1e-6


def test_two_steps_an_interval_land_within_ten_nanometres_around_bennu() -> None:
    case, thrust = landing_case(), some_thrust(40)
    scaled = scale_case(case, 40)
    truth = flown_by_dop853(case, thrust * case.spacecraft.thrust_max_n)[-1]
    end = in_si_and_rotating(case, scaled, accurate(scaled, thrust, 2)[-1])
    np.testing.assert_allclose(end[:3], truth[:3], rtol=0, atol=1e-8)
    np.testing.assert_allclose(end[3:6], truth[3:6], rtol=0, atol=1e-10)


def test_samples_lie_on_the_same_flight_whatever_their_number() -> None:
    scaled, thrust = scale_case(landing_case(), 8), some_thrust(8)
    few, many = accurate(scaled, thrust, 4), accurate(scaled, thrust, 20)
    np.testing.assert_allclose(few, many[::5], rtol=0, atol=1e-10)
    np.testing.assert_array_equal(few[0], [*scaled.position, *scaled.velocity, 1.0])


def test_the_defect_makes_the_simple_flight_end_where_the_accurate_one_does() -> None:
    scaled, thrust = scale_case(strong_case(), 10), some_thrust(10)
    path = new_path(10)
    path.defect[:] = 7.0  # of an earlier flight
    measure_defect(scaled, thrust, path)
    raw = flown(scaled, thrust)
    assert np.linalg.norm(path.defect) > 1e-6
    fly(scaled, thrust, path)
    end = accurate(scaled, thrust, 1)[-1]
    np.testing.assert_allclose(path.position[-1], end[:3], rtol=0, atol=1e-15)
    np.testing.assert_allclose(path.velocity[-1], end[3:6], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(path.position[:-1], raw.position[:-1])


# The weights are pulled back with gravity held within an interval, which leaves out h^2/8 of its gradient.
PULL_TOLERANCE = 5e-5


@pytest.mark.parametrize("end", [1, 7, 20])
def test_pulled_back_weights_are_derivatives_of_the_flight(end: int) -> None:
    rng = np.random.default_rng(end)
    scaled, thrust = scale_case(strong_case(), 20)._replace(mass_flow=0.0), some_thrust(20)
    p, q = rng.normal(size=3), rng.normal(size=3)

    def value(forces: np.ndarray, at: ScaledCase = scaled) -> float:
        path = flown(at, forces)
        return float(p @ path.position[end] + q @ path.velocity[end])

    row = np.full((20, 3), 9.0)
    back = np.array(pull_back(flown(scaled, thrust), end, *p, *q, row))
    step = 1e-5
    for k in range(20):
        for i in range(3):
            up, down = thrust.copy(), thrust.copy()
            up[k, i] += step
            down[k, i] -= step
            slope = (value(up) - value(down)) / (2 * step)
            if k < end:
                assert row[k, i] == pytest.approx(slope, abs=PULL_TOLERANCE * np.abs(row[:end]).max())
            else:
                assert slope == 0.0
                assert row[k, i] == 9.0  # left alone
    for i in range(6):
        shift = step * np.eye(6)[i]
        up = scaled._replace(position=scaled.position + shift[:3], velocity=scaled.velocity + shift[3:])
        down = scaled._replace(position=scaled.position - shift[:3], velocity=scaled.velocity - shift[3:])
        slope = (value(thrust, up) - value(thrust, down)) / (2 * step)
        assert back[i] == pytest.approx(slope, abs=PULL_TOLERANCE * np.abs(back).max())


def test_pulled_back_weights_become_exact_as_intervals_shrink() -> None:
    errors = []
    for n in (10, 20, 40):
        scaled, thrust = scale_case(strong_case(), n)._replace(mass_flow=0.0), some_thrust(n)
        row, step = np.zeros((n, 3)), np.zeros((n, 3))
        pull_back(flown(scaled, thrust), n, 1.0, 0.3, -0.5, 0.2, 0.7, -0.4, row)
        step[:, 1] = 1e-5

        def value(forces: np.ndarray, at: ScaledCase = scaled) -> float:
            path = flown(at, forces)
            return float(path.position[-1] @ [1.0, 0.3, -0.5] + path.velocity[-1] @ [0.2, 0.7, -0.4])

        slope = (value(thrust + step) - value(thrust - step)) / 2e-5
        errors.append(abs(row[:, 1].sum() - slope))
    assert errors[0] / errors[2] > 10.0


def test_pulling_back_through_a_thinning_mass_divides_by_the_mean_mass() -> None:
    scaled, thrust = without_gravity(scale_case(strong_case(), 10)), some_thrust(10)
    path, row = flown(scaled, thrust), np.zeros((10, 3))
    pull_back(path, 10, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, row)
    np.testing.assert_allclose(row[:, 1], 0.1 / (0.5 * (path.mass[1:] + path.mass[:-1])), rtol=1e-14)
    np.testing.assert_array_equal(row[:, [0, 2]], 0.0)
