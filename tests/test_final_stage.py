from __future__ import annotations

import math

import numpy as np
import pytest
from kernel_calls import from_python
from landing_samples import asteroid
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from landing_cli.body.gravity.field_values import accelerations
from landing_cli.reach.final_stage import (
    ARC_SAMPLES,
    ArcMeasures,
    arc_state as arc_state_part,
    end_accelerations as end_accelerations_part,
    measure_arc as measure_arc_part,
)

arc_state = from_python(arc_state_part)
end_accelerations = from_python(end_accelerations_part)
measure_arc = from_python(measure_arc_part)

T = 200.0
BODY = asteroid(gravity=5.0, spin=3.0)
SPIN = np.array([0.0, 0.0, BODY.rotation_rate_rad_s])
EXHAUST_M_S, MASS_KG = 900.0, 1950.0
TARGET = np.array([180.0, 120.0, 140.0])
NORMAL = np.array([0.6, 0.48, 0.64])


def handovers(count: int = 6, seed: int = 2) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [
        np.concatenate(
            [TARGET + 90 * NORMAL + 25 * rng.normal(size=3), -0.6 * NORMAL + 0.2 * rng.normal(size=3)]
        )
        for _ in range(count)
    ]


def ends(state: np.ndarray) -> np.ndarray:
    """Accelerations at touchdown and at handover, (6,)."""
    return np.array(end_accelerations(*(state[:3] - TARGET), *state[3:], T))


def measured(state: np.ndarray) -> tuple[ArcMeasures, np.ndarray]:
    points = np.zeros((ARC_SAMPLES + 1, 3))
    field = BODY.gravity
    arc = measure_arc(
        state, MASS_KG, TARGET, NORMAL, T, SPIN[2], EXHAUST_M_S, field.kind, field.params, points
    )
    return arc, points


def printed_acceleration(state: np.ndarray, t: float) -> np.ndarray:
    """Zhao 2022, eq 14, reading t_pf for t_f and r_c for r_f; t runs from the handover."""
    r_p, v_p, r_c = state[:3], state[3:], TARGET
    growth = 6 * (T * v_p + 2 * r_p - 2 * r_c) / T**3
    return growth * t - 2 * (2 * T * v_p + 3 * r_p - 3 * r_c) / T**2


def thrust_per_mass(state: np.ndarray, t: float) -> np.ndarray:
    """What must be flown so that gravity and the rotating frame leave a*."""
    s = T - t
    found = np.array(arc_state(tuple(ends(state)), TARGET, T, s))
    r, v = found[:3], found[3:]
    frame = 2 * np.cross(SPIN, v) + np.cross(SPIN, np.cross(SPIN, r))
    return printed_acceleration(state, t) - accelerations(BODY.gravity, r)[0] + frame


def test_the_accelerations_are_those_of_the_paper() -> None:
    for state in handovers():
        a = ends(state)
        np.testing.assert_allclose(a[3:], printed_acceleration(state, 0.0), rtol=1e-13, atol=1e-16)
        np.testing.assert_allclose(a[:3], printed_acceleration(state, T), rtol=1e-13, atol=1e-16)


def test_eq_13_has_the_costates_of_that_acceleration() -> None:
    """a* = -lambda_v, where lambda_v = lambda_v0 - lambda_r0 t."""
    for state in handovers():
        r_p, v_p = state[:3] - TARGET, state[3:]
        lambda_r = 6 * (T * v_p + 2 * r_p) / T**3
        lambda_v = 2 * (2 * T * v_p + 3 * r_p) / T**2
        a = ends(state)
        np.testing.assert_allclose(a[3:], -lambda_v, rtol=1e-13, atol=1e-16)
        np.testing.assert_allclose(a[:3], lambda_r * T - lambda_v, rtol=1e-12, atol=1e-16)


def test_the_arc_joins_the_handover_to_rest_at_the_touchdown() -> None:
    for state in handovers():
        a = tuple(ends(state))
        np.testing.assert_allclose(arc_state(a, TARGET, T, T), state, rtol=1e-12)
        np.testing.assert_allclose(arc_state(a, TARGET, T, 0.0), [*TARGET, 0.0, 0.0, 0.0], rtol=0, atol=0)


def test_the_compensated_thrust_flies_the_arc_in_the_rotating_frame() -> None:
    """DOP853 in gravity, Coriolis and centrifugal acceleration arrives, with the fuel and peak measured."""
    for state in handovers(3):

        def rates(t: float, y: np.ndarray, state: np.ndarray = state) -> np.ndarray:
            r, v = y[:3], y[3:6]
            thrust = thrust_per_mass(state, t)
            frame = 2 * np.cross(SPIN, v) + np.cross(SPIN, np.cross(SPIN, r))
            acceleration = accelerations(BODY.gravity, r)[0] + thrust - frame
            return np.concatenate([v, acceleration, [np.linalg.norm(thrust)]])

        times = np.linspace(0, T, ARC_SAMPLES + 1)
        flown = solve_ivp(rates, (0, T), np.append(state, 0.0), "DOP853", times, rtol=1e-11, atol=1e-10)
        arc, points = measured(state)
        np.testing.assert_allclose(flown.y[:3].T, points, rtol=0, atol=1e-6)
        np.testing.assert_allclose(flown.y[3:6, -1], 0.0, rtol=0, atol=1e-8)
        assert arc.delta_v_m_s == pytest.approx(flown.y[6, -1], rel=5e-4)
        mass = MASS_KG * np.exp(-flown.y[6] / EXHAUST_M_S)
        assert arc.touchdown_mass_kg == pytest.approx(mass[-1], rel=1e-6)
        thrust = np.array([np.linalg.norm(thrust_per_mass(state, t)) for t in times])
        planned = np.array([np.linalg.norm(printed_acceleration(state, t)) for t in times])
        assert arc.peak_thrust_n == pytest.approx((mass * thrust).max(), rel=1e-6)
        assert arc.peak_planned_thrust_n == pytest.approx((mass * planned).max(), rel=1e-6)


def test_without_compensation_the_arc_misses_by_metres() -> None:
    """Why both readings are offered: a* flown as thrust does not arrive."""
    state = handovers(1)[0]

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        frame = 2 * np.cross(SPIN, y[3:]) + np.cross(SPIN, np.cross(SPIN, y[:3]))
        return np.concatenate(
            [y[3:], accelerations(BODY.gravity, y[:3])[0] + printed_acceleration(state, t) - frame]
        )

    end = solve_ivp(rates, (0, T), state, "DOP853", rtol=1e-10, atol=1e-9).y[:3, -1]
    assert np.linalg.norm(end - TARGET) > 1.0


def test_the_energy_is_half_the_integral_of_the_square() -> None:
    for state in handovers():
        nodes, weights = np.polynomial.legendre.leggauss(4)
        square = [np.sum(printed_acceleration(state, 0.5 * T * (1 + x)) ** 2) for x in nodes]
        arc, _ = measured(state)
        assert arc.energy_m2_s3 == pytest.approx(0.25 * T * weights @ square, rel=1e-13)


def test_the_arc_is_the_one_of_least_energy() -> None:
    """Any other motion between the same ends costs more, by the energy of the difference."""
    state = handovers(1)[0]
    arc, _ = measured(state)
    t = np.linspace(0, T, 4001)
    a = np.array([printed_acceleration(state, at) for at in t])
    for power in (2, 3, 4):
        # t^p (T - t)^2 leaves both ends alone
        bump = np.gradient(np.gradient((t / T) ** power * (1 - t / T) ** 2, t), t)[:, None] * np.array(
            [3.0, -1, 2]
        )
        cost = 0.5 * np.trapezoid(np.sum((a + bump) ** 2, axis=1), t)
        more = 0.5 * np.trapezoid(np.sum(bump**2, axis=1), t)
        assert cost > arc.energy_m2_s3
        assert cost == pytest.approx(arc.energy_m2_s3 + more, rel=2e-3)


def glide_angle(state: np.ndarray, s: float) -> float:
    r = np.array(arc_state(tuple(ends(state)), TARGET, T, s))[:3] - TARGET
    return math.acos(np.clip(r @ NORMAL / np.linalg.norm(r), -1.0, 1.0))


def test_no_point_of_an_arc_leaves_the_cone_that_holds_both_its_ends() -> None:
    rng = np.random.default_rng(6)
    steep = 0
    for _ in range(200):
        side = rng.normal(size=3)
        state = np.concatenate([TARGET + 80 * NORMAL + 40 * side, 1.5 * rng.normal(size=3) - 0.5 * NORMAL])
        arc, _ = measured(state)
        inside = max(glide_angle(state, s) for s in np.linspace(0.01, 1.0, 50) * T)
        assert inside <= arc.glide_angle_rad + 1e-9 or arc.glide_angle_rad > math.pi / 2
        steep += arc.glide_angle_rad < math.pi / 2
    assert steep > 20


def test_the_glide_angle_is_reached_at_one_of_the_ends() -> None:
    for state in handovers():
        arc, _ = measured(state)
        last = printed_acceleration(state, T)  # the arc comes in along it
        at_touchdown = math.acos(last @ NORMAL / np.linalg.norm(last))
        assert glide_angle(state, 0.5) == pytest.approx(at_touchdown, abs=0.02)
        assert arc.glide_angle_rad == pytest.approx(max(glide_angle(state, T), at_touchdown), rel=1e-12)


def test_samples_of_the_thrust_hardly_miss_its_peak() -> None:
    for state in handovers():
        arc, _ = measured(state)

        def thrust(t: float, state: np.ndarray = state) -> float:
            return -float(np.linalg.norm(thrust_per_mass(state, t)))

        best = minimize_scalar(thrust, bounds=(0, T), method="bounded", options={"xatol": 1e-6})
        peak = MASS_KG * max(-best.fun, -thrust(0.0), -thrust(T))
        assert 0.985 * peak < arc.peak_thrust_n < peak * (1 + 1e-12)
