"""Motion in the rotating frame: against closed forms, invariants and the scheme's order."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import from_python
from numpy.testing import assert_allclose

from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.harmonics import harmonics_field
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.flight.dynamics import (
    about_z,
    fly_nodes as fly_nodes_part,
    jacobi_constant,
    natural_acceleration,
    to_inertial,
    to_rotating,
)

fly_nodes = from_python(fly_nodes_part)

GM = 4.892  # Bennu, m3/s2
SPIN = 2.0 * np.pi / (4.288 * 3600.0)  # rad/s
EXHAUST = 400.0 * 9.80665  # m/s


def bennu_field() -> GravityField:
    return harmonics_field(GM, 246.0, -0.03922, 0.003742)


def fly(field: GravityField, start: np.ndarray, duration: float, nodes: np.ndarray, steps: int) -> np.ndarray:
    states = np.zeros((len(nodes) * steps + 1, 7))
    states[0] = start
    fly_nodes(field.kind, field.params, SPIN, EXHAUST, duration, nodes, steps, states)
    return states


def kepler_state(a: float, e: float, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Planar ellipse from periapsis on +x, tilted by 40 degrees about x."""
    mean = np.sqrt(GM / a**3) * t
    E = mean
    for _ in range(50):
        E -= (E - e * np.sin(E) - mean) / (1.0 - e * np.cos(E))
    b = a * np.sqrt(1.0 - e * e)
    rate = np.sqrt(GM / a**3) / (1.0 - e * np.cos(E))
    tilt = np.array([[1.0, 0.0], [0.0, np.cos(0.7)], [0.0, np.sin(0.7)]])
    r = tilt @ [a * (np.cos(E) - e), b * np.sin(E)]
    v = tilt @ [-a * np.sin(E) * rate, b * np.cos(E) * rate]
    return r, v


def test_free_flight_about_a_point_mass_follows_the_kepler_ellipse() -> None:
    a, e, t = 600.0, 0.3, 9000.0
    r0, v0 = to_rotating(0.0, *kepler_state(a, e, 0.0), SPIN)
    states = fly(point_mass_field(GM), np.r_[r0, v0, 2000.0], t, np.zeros((1, 3)), 4000)
    r, v = to_inertial(t, states[-1, :3], states[-1, 3:6], SPIN)
    r_true, v_true = kepler_state(a, e, t)
    assert_allclose(r, r_true, rtol=0, atol=1e-7)
    assert_allclose(v, v_true, rtol=0, atol=1e-10)


def test_free_flight_conserves_the_jacobi_constant() -> None:
    field = bennu_field()
    start = np.array([350.0, 40.0, 120.0, 0.01, -0.03, 0.05, 2000.0])
    states = fly(field, start, 20000.0, np.zeros((1, 3)), 8000)
    constants = jacobi_constant(field, SPIN, states[:, :3], states[:, 3:6])
    assert np.ptp(states[:, 0]) > 100.0  # it moved
    assert_allclose(constants, constants[0], rtol=1e-10, atol=0)


def test_rk4_converges_with_order_four() -> None:
    field = bennu_field()
    rng = np.random.default_rng(3)
    start = np.array([0.0, 300.0, 400.0, 0.2, 0.0, -0.5, 2000.0])
    nodes = rng.normal(size=(4, 3)) * 8.0
    truth = fly(field, start, 2000.0, nodes, 400)[-1, :6]
    errors = [np.linalg.norm(fly(field, start, 2000.0, nodes, n)[-1, :6] - truth) for n in (8, 16, 32)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert_allclose(orders, 4.0, rtol=0, atol=0.2)


def test_mass_falls_by_thrust_over_exhaust_velocity() -> None:
    nodes = np.array([[3.0, 0.0, 4.0], [0.0, 0.0, 0.0], [0.0, -12.0, 5.0]])
    states = fly(bennu_field(), np.array([0, 0, 800.0, 0, 0, 0, 2000.0]), 300.0, nodes, 2)
    assert_allclose(states[-1, 6], 2000.0 - 100.0 * (5.0 + 13.0) / EXHAUST, rtol=1e-14)


def test_inertial_thrust_pushes_along_a_line_that_is_fixed_at_the_end_of_the_leg() -> None:
    """Without gravity, constant inertial thrust gives a parabola in the axes of the end of the leg."""
    field = point_mass_field(1e-30)
    force, duration, mass = np.array([[6.0, -3.0, 2.0]]), 900.0, 1e9
    r0, v0 = np.array([700.0, 100.0, 50.0]), np.array([0.1, 0.2, -0.3])
    end = fly(field, np.r_[r0, v0, mass], duration, force, 200)[-1]
    r0_in, v0_in = to_inertial(0.0, r0, v0, SPIN, epoch_s=duration)
    r_in = r0_in + duration * v0_in + 0.5 * duration**2 * force[0] / mass
    r_end, _ = to_inertial(duration, end[:3], end[3:6], SPIN, epoch_s=duration)
    assert_allclose(r_end, r_in, rtol=0, atol=1e-9)
    assert_allclose(end[:3], r_end, rtol=0, atol=1e-12)


def test_natural_acceleration_is_gravity_minus_coriolis_minus_centrifugal() -> None:
    field = bennu_field()
    r, v, w = np.array([210.0, -90.0, 260.0]), np.array([0.4, -0.2, 0.7]), np.array([0.0, 0.0, SPIN])
    still = np.array(natural_acceleration(field.kind, field.params, 0.0, *r, *v))
    got = np.array(natural_acceleration(field.kind, field.params, SPIN, *r, *v))
    fictitious = -2.0 * np.cross(w, v) - np.cross(w, np.cross(w, r))
    assert_allclose(got, still + fictitious, rtol=1e-14)


@pytest.mark.parametrize("epoch_s", [0.0, 700.0])
def test_rotating_and_inertial_axes_are_inverse_and_coincide_at_the_epoch(epoch_s: float) -> None:
    rng = np.random.default_rng(0)
    t, r, v = rng.uniform(0, 2000, 5), rng.normal(size=(5, 3)) * 300, rng.normal(size=(5, 3))
    back = to_rotating(t, *to_inertial(t, r, v, SPIN, epoch_s), SPIN, epoch_s)
    assert_allclose(back[0], r, rtol=0, atol=1e-11)
    assert_allclose(back[1], v, rtol=0, atol=1e-14)
    assert_allclose(to_inertial(epoch_s, r[0], v[0], SPIN, epoch_s)[0], r[0], rtol=1e-15)


def test_turning_about_z_is_counter_clockwise() -> None:
    assert_allclose(about_z(np.pi / 2, [1.0, 0.0, 3.0]), [0.0, 1.0, 3.0], rtol=0, atol=1e-15)
