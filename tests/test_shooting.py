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
    fly as fly_part,
    fly_accurately as fly_accurately_part,
    measure_defect as measure_defect_part,
    new_path,
    pull_back as pull_back_part,
)

fly = from_python(fly_part)

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
    measure_defect(scaled, thrust, path, True)
    raw = flown(scaled, thrust)
    assert np.linalg.norm(path.defect) > 1e-6
    fly(scaled, thrust, path)
    end = accurate(scaled, thrust, 1)[-1]
    np.testing.assert_allclose(path.position[-1], end[:3], rtol=0, atol=1e-15)
    np.testing.assert_allclose(path.velocity[-1], end[3:6], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(path.position[:-1], raw.position[:-1])


# The weights are pulled back with gravity held within an interval, which leaves out h^2/8 of its gradient.
PULL_TOLERANCE = 5e-5


def pulled_back(path: Path, p: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of p . r + q . v at the end by the intervals' thrust, and by the state at the start."""
    basis, weights = np.zeros((len(path.gradient), 6, 3)), np.concatenate([p, q])
    pull_back(path, basis)
    return np.einsum("b,kbi->ki", weights, basis), weights @ path.to_start


def test_pulled_back_weights_are_derivatives_of_the_flight() -> None:
    rng = np.random.default_rng(20)
    scaled, thrust = scale_case(strong_case(), 20)._replace(mass_flow=0.0), some_thrust(20)
    p, q = rng.normal(size=3), rng.normal(size=3)

    def value(forces: np.ndarray, at: ScaledCase = scaled) -> float:
        path = flown(at, forces)
        return float(p @ path.position[-1] + q @ path.velocity[-1])

    row, back = pulled_back(flown(scaled, thrust), p, q)
    step = 1e-5
    for k in range(20):
        for i in range(3):
            up, down = thrust.copy(), thrust.copy()
            up[k, i] += step
            down[k, i] -= step
            slope = (value(up) - value(down)) / (2 * step)
            assert row[k, i] == pytest.approx(slope, abs=PULL_TOLERANCE * np.abs(row).max())
    for i in range(6):
        shift = step * np.eye(6)[i]
        up = scaled._replace(position=scaled.position + shift[:3], velocity=scaled.velocity + shift[3:])
        down = scaled._replace(position=scaled.position - shift[:3], velocity=scaled.velocity - shift[3:])
        slope = (value(thrust, up) - value(thrust, down)) / (2 * step)
        assert back[i] == pytest.approx(slope, abs=PULL_TOLERANCE * np.abs(back).max())


@pytest.mark.parametrize("node", [1, 7, 20])
def test_levers_are_derivatives_of_the_end_by_a_kick_at_a_node(node: int) -> None:
    scaled, thrust = scale_case(strong_case(), 20)._replace(mass_flow=0.0), some_thrust(20)
    path, basis = flown(scaled, thrust), np.zeros((20, 6, 3))
    pull_back(path, basis)

    def end(forces: np.ndarray) -> np.ndarray:
        path = flown(scaled, forces)
        return np.concatenate([path.position[-1], path.velocity[-1]])

    # a kick at a node is the mean of a push before it and one after it, less what the two do to each other
    step, lever = 1e-5, path.lever[node].reshape(6, 3)
    for i in range(3):
        push = np.zeros((20, 3))
        push[node - 1 : node + 1, i] = 0.5 * step * 20 if node < 20 else step * 20
        slope = (end(thrust + push) - end(thrust - push)) / (2 * step)
        late = 0.0 if node < 20 else 0.5 / 20 * np.eye(6)[i]  # the last push is made half an interval early
        np.testing.assert_allclose(slope - late, lever[:, i], rtol=0, atol=3e-3 * np.abs(lever).max())


def test_pulled_back_weights_become_exact_as_intervals_shrink() -> None:
    errors = []
    for n in (10, 20, 40):
        scaled, thrust = scale_case(strong_case(), n)._replace(mass_flow=0.0), some_thrust(n)
        step = np.zeros((n, 3))
        row, _ = pulled_back(flown(scaled, thrust), np.array([1.0, 0.3, -0.5]), np.array([0.2, 0.7, -0.4]))
        step[:, 1] = 1e-5

        def value(forces: np.ndarray, at: ScaledCase = scaled) -> float:
            path = flown(at, forces)
            return float(path.position[-1] @ [1.0, 0.3, -0.5] + path.velocity[-1] @ [0.2, 0.7, -0.4])

        slope = (value(thrust + step) - value(thrust - step)) / 2e-5
        errors.append(abs(row[:, 1].sum() - slope))
    assert errors[0] / errors[2] > 10.0


def test_pulling_back_through_a_thinning_mass_divides_by_the_mean_mass() -> None:
    scaled, thrust = without_gravity(scale_case(strong_case(), 10)), some_thrust(10)
    path = flown(scaled, thrust)
    row, _ = pulled_back(path, np.zeros(3), np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(row[:, 1], 0.1 / (0.5 * (path.mass[1:] + path.mass[:-1])), rtol=1e-14)
    np.testing.assert_array_equal(row[:, [0, 2]], 0.0)
