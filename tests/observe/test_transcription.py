"""The least-energy transcription against closed forms, Pontryagin's principle, re-flight and its limits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from kernel_calls import from_python
from scipy.integrate import solve_ivp
from solver_samples import INNER_M, eros_case, miss_m, potato_case, reflown

from landing_cli.body.gravity.kernels import acceleration_and_gradient as acceleration_and_gradient_part
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.flight.linear_arcs import fly_linear_arcs
from landing_cli.flight.linearised_arcs import linearised_arcs
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.observe.energy_flight import (
    energy_flight,
    hermite_positions,
    inverse_dynamics,
    spline_positions,
)
from landing_cli.observe.observed import Path, Waypoints
from landing_cli.observe.path_values import control_energy
from landing_cli.observe.records import ObserveCase, SteeringOptions
from landing_cli.observe.transcription import least_energy_path
from landing_cli.observe.waypoints import waypoints_of

acceleration_and_gradient = from_python(acceleration_and_gradient_part)

TOF = 800.0


def steered(case: ObserveCase, count: int, nodes: int = 400) -> Path:
    return least_energy_path(case, TOF, passed(case, count), nodes)


def passed(case: ObserveCase, count: int) -> Waypoints:
    return waypoints_of(case, INNER_M, TOF, SteeringOptions(waypoints=count))


def waypoint_error_m(case: ObserveCase, count: int, positions: np.ndarray, times: np.ndarray) -> float:
    wanted = passed(case, count)
    at = [int(np.argmin(np.abs(times - t))) for t in wanted.t_s]
    np.testing.assert_allclose(times[at], wanted.t_s, rtol=1e-12, atol=0)
    return float(np.abs(case.frame.to_site(positions[at])[:, :2] - wanted.position_m).max())


# J of reference, and of indirect shooting (`shot_energy` on this mesh, DOP853 at 1e-12)
REFERENCE = {0: 0.0184867024262, 1: 0.0185891584837, 3: 0.0187677562541, 7: 0.0191260955544}
SHOT = {0: 0.018486701529407, 1: 0.018589157718077}


@pytest.fixture(scope="module")
def eros(reference_shapes) -> ObserveCase:
    return eros_case(reference_shapes)


@pytest.mark.parametrize("count", REFERENCE)
def test_eros_costs_what_is_known(eros: ObserveCase, count: int) -> None:
    """All four lie 4.0e-8 to 4.9e-8 below the reference figures, where 1e-8 was wanted.

    Shooting by Pontryagin's principle in the exact field agrees with ours to 3e-12, IPOPT in a B-spline of
    the field (``python -m bench observe``) to 3e-10, and the open-loop flight in the exact field meets the
    site for less than the reference: its figures are not those of this field. An error of 2e-8 in
    its gravity would explain them.
    """
    path = steered(eros, count, nodes=200)
    assert path.status == "planned", path.message
    assert path.performance_index_m2_s3 == pytest.approx(REFERENCE[count], rel=5e-8, abs=0)
    if count in SHOT:
        assert path.performance_index_m2_s3 == pytest.approx(SHOT[count], rel=1e-11, abs=0)
    if count:
        assert waypoint_error_m(eros, count, path.position_m, path.t_s) < 1e-6


@pytest.mark.parametrize("count", [0, 7])
def test_eros_is_landed_on_open_loop(eros: ObserveCase, count: int) -> None:
    flown = reflown(eros, steered(eros, count, nodes=80))
    assert np.linalg.norm(flown.position_m[-1] - eros.frame.origin_m) < 1e-6
    if count:
        assert waypoint_error_m(eros, count, flown.position_m, flown.t_s) < 1e-6


def shot_energy(case: ObserveCase, path: Path, count: int) -> float:
    """J by Pontryagin's principle: u = -lambda_v / 2, with lambda_r jumping at the waypoints; by shooting.

    In units of 100 m and t_f, from the transcription's own slopes of u; Newton's method by differences.
    """
    field, w, frame = case.asteroid.gravity, case.asteroid.rotation_rate_rad_s, case.frame
    length, wanted = 100.0, passed(case, count)
    coriolis = TOF * np.array([[0.0, 2.0 * w, 0.0], [-2.0 * w, 0.0, 0.0], [0.0] * 3])
    centrifugal = TOF**2 * np.diag([w * w, w * w, 0.0])

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        r = y[:3] * length + frame.origin_m
        gx, gy, gz, xx, yy, zz, xy, xz, yz = acceleration_and_gradient(field.kind, field.params, *r)
        slope = TOF**2 * np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) + centrifugal
        u = -0.5 * y[9:12]
        a = np.array([gx, gy, gz]) * TOF**2 / length + centrifugal @ r / length + coriolis @ y[3:6] + u
        return np.concatenate([y[3:6], a, -slope.T @ y[9:12], -y[6:9] - coriolis.T @ y[9:12], [u @ u]])

    def fly(z: np.ndarray) -> tuple[np.ndarray, float]:
        start = (case.position_m - frame.origin_m) / length, case.velocity_m_s * TOF / length
        y, misses = np.concatenate([*start, z[:6], [0.0]]), []
        edges = np.concatenate([[0.0], wanted.t_s / TOF, [1.0]])
        for k in range(count + 1):
            y = solve_ivp(rates, edges[k : k + 2], y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
            if k < count:
                misses.append((frame.axes @ y[:3])[:2] - wanted.position_m[k] / length)
                y[6:9] -= frame.axes[:2].T @ z[6 + 2 * k : 8 + 2 * k]
        return np.concatenate([*misses, y[:6]]), float(y[12]) * length**2 / TOF**3

    u, h = path.acceleration_m_s2 * TOF**2 / length, (path.t_s[1] - path.t_s[0]) / TOF
    forward = np.array([-25.0, 48.0, -36.0, 16.0, -3.0]) / (12.0 * h)
    jumps = [
        2.0 * frame.axes[:2] @ -(forward @ u[i : i + 5] + forward @ u[i : i - 5 : -1])
        for i in (int(np.argmin(np.abs(path.t_s - t))) for t in wanted.t_s)
    ]
    z = np.concatenate([2.0 * forward @ u[:5] + 2.0 * coriolis.T @ u[0], -2.0 * u[0], *jumps])
    for _ in range(6):
        miss, energy = fly(z)
        if np.abs(miss).max() < 1e-9:
            return energy
        steps = 1e-3 * np.eye(len(z))
        z = z - np.linalg.solve(np.array([(fly(z + step)[0] - miss) / 1e-3 for step in steps]).T, miss)
    raise AssertionError("the shooting does not converge")


@pytest.mark.parametrize("count", [0, 1])
def test_pontryagins_principle_gives_the_same_energy(count: int) -> None:
    case = potato_case(velocity_m_s=np.array([0.05, -0.02, 0.03]))
    path = steered(case, count)
    assert path.performance_index_m2_s3 == pytest.approx(shot_energy(case, path, count), rel=1e-9, abs=0)


def test_without_forces_the_spline_is_the_optimum() -> None:
    case = potato_case(velocity_m_s=np.array([0.05, -0.02, 0.03]))
    still = replace(case.asteroid, gravity=point_mass_field(1e-12), rotation_rate_rad_s=0.0)
    case = replace(case, asteroid=still)
    path = steered(case, 7)
    spline = spline_positions(energy_flight(case, TOF, passed(case, 7), 400))
    np.testing.assert_allclose(path.position_m, spline(path.t_s), rtol=0, atol=1e-8)
    np.testing.assert_allclose(path.acceleration_m_s2, spline(path.t_s, 2), rtol=0, atol=1e-11)


def test_the_spline_flown_by_inverse_dynamics_costs_a_little_more(eros: ObserveCase) -> None:
    """Known from elsewhere: 0.7e-4 to 1.3e-4 more than the optimum, exactly feasible."""
    case = eros
    for count in (0, 1, 3, 7):
        flight = energy_flight(case, TOF, passed(case, count), 200)
        spline, t = spline_positions(flight), flight.times_s
        u = inverse_dynamics(case, spline(t), spline(t, 1), spline(t, 2))
        extra = control_energy(t, u) / steered(case, count).performance_index_m2_s3 - 1.0
        assert 0.6e-4 < extra < 1.4e-4


def test_linearised_arcs_end_where_flown_ones_do() -> None:
    case = potato_case()
    path = steered(case, 1)
    field, w, site = case.asteroid.gravity, case.asteroid.rotation_rate_rad_s, case.frame.origin_m
    states = np.concatenate([path.position_m, path.velocity_m_s], axis=1)
    flown = fly_linear_arcs(field, w, path.t_s, states[:-1], path.acceleration_m_s2)
    positions = hermite_positions(path.t_s, path.position_m, path.velocity_m_s)
    arcs = linearised_arcs(field, w, path.t_s, positions, np.array([0.0, 400.0, 800.0]), site)
    offset = states[:-1] - np.append(site, np.zeros(3))
    u = path.acceleration_m_s2
    end = np.einsum("nij,nj->ni", arcs.by_state, offset) + arcs.drift
    end += np.einsum("nij,nj->ni", arcs.by_thrust_start, u[:-1])
    end += np.einsum("nij,nj->ni", arcs.by_thrust_end, u[1:])
    np.testing.assert_allclose(end[:, :3] + site, flown.end[:, :3], rtol=0, atol=1e-10)
    np.testing.assert_allclose(end[:, 3:], flown.end[:, 3:], rtol=0, atol=1e-12)
    by = np.concatenate([arcs.by_state, arcs.by_thrust_start, arcs.by_thrust_end], axis=2)
    # the ramps of the thrust cost an order; what they share, the mean thrust, does not
    np.testing.assert_allclose(by, flown.end_slope, rtol=0, atol=1e-6)
    mean = [x[:, :, 6:9] + x[:, :, 9:] for x in (by, flown.end_slope)]
    np.testing.assert_allclose(*mean, rtol=0, atol=5e-9)


def test_more_waypoints_never_cost_less() -> None:
    case = potato_case()
    costs = [steered(case, m, nodes=160).performance_index_m2_s3 for m in (0, 1, 3, 7, 15)]
    assert (np.diff(costs) > 0.0).all()


def test_matched_timing_costs_the_same_from_five_waypoints_on(eros: ObserveCase) -> None:
    costs = []
    for m in (5, 7, 15):
        wanted = waypoints_of(eros, INNER_M, TOF, SteeringOptions(waypoints=m, timing="velocity_matched"))
        costs.append(least_energy_path(eros, TOF, wanted, 160).performance_index_m2_s3)
    assert np.ptp(costs) < 1e-4 * min(costs)


def test_an_integrator_of_adaptive_step_lands_there_too() -> None:
    case = potato_case()
    assert miss_m(case, steered(case, 3, nodes=100), "dop853") < 1e-6


def test_the_number_of_nodes_is_no_matter() -> None:
    case = potato_case()
    costs = [steered(case, 1, nodes=n).performance_index_m2_s3 for n in (100, 400)]
    assert costs[0] == pytest.approx(costs[1], rel=1e-9, abs=0)


class TestLimits:
    """Where a limit binds, the cone program keeps it, and costs more than the optimum without it."""

    def bound(self, count: int, **changes: object) -> tuple[Path, Path, ObserveCase]:
        free, case = potato_case(), potato_case(**changes)
        return steered(free, count, nodes=200), steered(case, count, nodes=200), case

    def check(self, free: Path, path: Path, case: ObserveCase, count: int) -> None:
        assert path.status == "planned", path.message
        assert "without limits" in path.message
        assert path.performance_index_m2_s3 > free.performance_index_m2_s3 * (1 + 1e-7)
        assert miss_m(case, path) < 1e-6
        if count:
            assert waypoint_error_m(case, count, path.position_m, path.t_s) < 1e-6

    def test_thrust(self) -> None:
        free = steered(potato_case(), 1, nodes=200)
        limit = 0.97 * free.peak_thrust_n
        free, path, case = self.bound(1, spacecraft=Spacecraft(500.0, limit, 225.0))
        self.check(free, path, case, 1)
        assert path.peak_thrust_n == pytest.approx(limit, rel=2e-5, abs=0)

    def test_glide_slope(self) -> None:
        free = steered(potato_case(), 0, nodes=200)
        limit = free.glide_slope_max_rad - math.radians(2.0)
        free, path, case = self.bound(0, glide_slope_half_angle_rad=limit)
        self.check(free, path, case, 0)
        assert path.glide_slope_max_rad == pytest.approx(limit, abs=math.radians(0.05))

    def test_clearance(self) -> None:
        """The first node inside the ball keeps the clearance too: up to a node's way more than asked."""
        free = steered(potato_case(clearance_free_m=60.0), 0, nodes=200)
        wanted = free.clearance_min_m + 3.0
        _, path, case = self.bound(0, clearance_m=wanted, clearance_free_m=60.0)
        self.check(free, path, case, 0)
        assert wanted - 0.01 <= path.clearance_min_m < wanted + 0.5

    def test_too_weak_a_thruster_is_infeasible(self) -> None:
        _, path, _ = self.bound(0, spacecraft=Spacecraft(500.0, 0.1, 225.0))
        assert path.status == "infeasible"
        assert "the thruster gives 0.1 N" in path.message and "no path was found" in path.message
