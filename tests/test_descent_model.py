"""Every derivative of the linearised descent against differences of what it is the derivative of."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from conic_oracles import rows_on_thrust
from kernel_calls import from_python
from landing_samples import asteroid, landing_case, some_thrust
from scipy.integrate import quad

from landing_cli.body.gravity.field_values import accelerations
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.optimize.conic_records import Model, Point, new_model, new_point
from landing_cli.reach.descent_model import (
    Layout,
    fill_arc_cones as fill_arc_cones_part,
    fill_glide_cones as fill_glide_cones_part,
    fill_handover_rows as fill_handover_rows_part,
    layout as layout_part,
    refresh,
)
from landing_cli.reach.final_stage import ARC_SAMPLES, measure_arc as measure_arc_part
from landing_cli.reach.free_solve import basis_of
from landing_cli.reach.planes import Cuts, arc_weights, new_cuts
from landing_cli.reach.scaled_case import ScaledCase, ellipsoid_level as ellipsoid_level_part, scale_case
from landing_cli.reach.shooting import Path, new_path

ellipsoid_level = from_python(ellipsoid_level_part)

fill_arc_cones = from_python(fill_arc_cones_part)
fill_glide_cones = from_python(fill_glide_cones_part)
fill_handover_rows = from_python(fill_handover_rows_part)
layout = from_python(layout_part)
measure_arc = from_python(measure_arc_part)

N = 10
CUT_NODES = (4, 7, 10)
WALLS = ((5, 0.0), (0, 0.6))  # at a node, and at a fraction of the final arc
WALL_OFFSET = 0.3
STRONG = asteroid(gravity=6.0, spin=4.0)


class Problem:
    """A facet's problem at an arbitrary point, with every kind of row and cone."""

    def __init__(
        self, mass_flow: float | None = None, propellant_kg: float | None = 60.0, **changes: Any
    ) -> None:
        craft = Spacecraft(2000.0, 20.0, 30.0, propellant_kg)
        self.case = landing_case(STRONG, spacecraft=craft, **changes)
        self.scaled: ScaledCase = scale_case(self.case, N)
        if mass_flow is not None:
            self.scaled = self.scaled._replace(mass_flow=mass_flow)
        rng = np.random.default_rng(4)
        self.target_m = np.array([150.0, 180.0, 90.0])
        self.target = self.target_m / self.scaled.length_m
        normal = self.target + 0.02 * rng.normal(size=3)
        self.normal = normal / np.linalg.norm(normal)
        self.plan: Layout = layout(self.scaled, len(CUT_NODES) + len(WALLS), 0.7, True)
        sizes = N, self.plan.n_cones, self.plan.n_rows
        self.point: Point = new_point(*sizes)
        self.model: Model = new_model(*sizes, basis_of(self.scaled))
        self.path: Path = new_path(N)
        self.cuts: Cuts = new_cuts(N + 1)
        self.point.thrust[:] = some_thrust(N)
        self.point.y[:] = [1.1, *(0.5 * self.normal), *(-0.2 * self.normal)]
        self.point.y[1:] += 0.1 * rng.normal(size=6)
        self.point.multiplier[:] = 0.1 * rng.normal(size=self.plan.n_rows)
        self.point.multiplier[self.plan.n_equal :] = -rng.uniform(0.05, 0.1, sizes[2] - self.plan.n_equal)
        self.point.cone_dual[:] = 0.1 * rng.normal(size=(sizes[1], 4))
        self.point.cone_dual[:, 0] = 0.3
        for c in range(len(CUT_NODES)):
            self.cuts.node[c] = CUT_NODES[c]
            self.cuts.normal[c] = rng.normal(size=3)
            self.cuts.tangent[c], self.cuts.offset[c] = 1.0, 1.01
        for c, (node, fraction) in enumerate(WALLS, len(CUT_NODES)):
            self.cuts.node[c], self.cuts.fraction[c] = node, fraction
            self.cuts.normal[c], self.cuts.offset[c] = rng.normal(size=3), WALL_OFFSET
        fill_handover_rows(self.scaled, self.model)
        fill_arc_cones(self.scaled, self.model)
        fill_glide_cones(self.scaled, self.normal, self.model)
        self.energy, self.mass_costate = self.refresh()

    def refresh(self, retake: bool = False) -> tuple[float, float]:
        return refresh(
            self.scaled, self.target, self.plan, self.cuts, retake, self.point, self.path, self.model
        )

    def rows_at(self, thrust: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Values of the rows at another point."""
        self.point.thrust[:], self.point.y[:] = thrust, y
        self.refresh()
        return self.model.row_value.copy()

    def differences(self, step: float = 1e-6) -> tuple[np.ndarray, np.ndarray]:
        """Central differences of the rows by thrust (R, N, 3) and by y (R, 7)."""
        thrust, y = self.point.thrust.copy(), self.point.y.copy()
        by_thrust = np.zeros((self.plan.n_rows, *thrust.shape))
        by_y = np.zeros((self.plan.n_rows, 7))
        for index in np.ndindex(thrust.shape):
            d = np.zeros_like(thrust)
            d[index] = step
            by_thrust[:, *index] = (self.rows_at(thrust + d, y) - self.rows_at(thrust - d, y)) / (2 * step)
        for a in range(7):
            d = step * np.eye(7)[a]
            by_y[:, a] = (self.rows_at(thrust, y + d) - self.rows_at(thrust, y - d)) / (2 * step)
        self.rows_at(thrust, y)
        return by_thrust, by_y


def by_thrust_of(model: Model) -> np.ndarray:
    """Derivatives of the rows by thrust, (R, N, 3)."""
    return rows_on_thrust(model).reshape(-1, N, 3)


def test_the_arc_between_its_ends_has_the_acceleration_that_it_says() -> None:
    """Position and velocity of the weights, differentiated in time, give a*; both vanish at touchdown."""
    T, h = 0.37, 1e-4
    for sigma in (0.2, 0.7, 0.9):
        a_e, a_s, *_ = arc_weights(sigma, T)
        before, at, after = (np.array(arc_weights(s, T)) for s in (sigma + h, sigma, sigma - h))
        np.testing.assert_allclose((after[2:4] - before[2:4]) / (2 * h * T), at[4:6], rtol=0, atol=1e-8)
        np.testing.assert_allclose((after[4:6] - before[4:6]) / (2 * h * T), [a_e, a_s], rtol=0, atol=1e-8)
    assert arc_weights(0.0, T)[2:] == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("handover", ["outside", "on_ellipsoid"])
def test_rows_have_the_derivatives_of_their_values(handover: str) -> None:
    p = Problem(mass_flow=0.0, handover=handover)
    by_thrust, by_y = p.differences()
    for r in range(p.plan.n_rows):
        if r == p.plan.first_plane - 1:
            continue  # the propellant, which does not move without a mass flow
        derivative = by_thrust_of(p.model)[r]
        scale = np.abs(by_thrust[r]).max() + 0.01
        # gravity is held within an interval: h^2/8 of its gradient
        np.testing.assert_allclose(derivative, by_thrust[r], rtol=0, atol=1e-4 * scale, err_msg=f"row {r}")
    np.testing.assert_allclose(p.model.row_y, by_y, rtol=0, atol=1e-8)


def test_the_propellant_row_has_the_derivatives_of_the_fuel_left() -> None:
    p = Problem()
    by_thrust, by_y = p.differences()
    last = p.plan.first_plane - 1
    assert p.model.row_value[last] == pytest.approx(p.scaled.propellant - (1 - touchdown_mass(p)), abs=1e-3)
    touch = np.abs(by_thrust[last]).max()
    # the mass at touchdown is exponential in the arc's thrust; the row takes the descent's share linearly
    np.testing.assert_allclose(by_thrust_of(p.model)[last], by_thrust[last], rtol=0, atol=0.01 * touch)
    np.testing.assert_allclose(p.model.row_y[last], by_y[last], rtol=0, atol=0.05 * np.abs(by_y[last]).max())


def touchdown_mass(p: Problem) -> float:
    measured = measured_arc(p)[0]
    return measured.touchdown_mass_kg / p.case.spacecraft.mass_kg


def measured_arc(p: Problem) -> tuple[Any, np.ndarray, np.ndarray]:
    """The final arc of the point's y, measured in SI units; its measures, handover state and path."""
    scaled, T = p.scaled, p.scaled.final_time
    _, _, r_e, r_s, v_e, v_s = arc_weights(1.0, T)
    e, s = p.point.y[1:4], p.point.y[4:7]
    position = p.target_m + (r_e * e + r_s * s) * scaled.length_m
    speed = (v_e * e + v_s * s) * scaled.length_m / p.case.descent_s
    state, points = np.concatenate([position, speed]), np.zeros((ARC_SAMPLES + 1, 3))
    craft, field = p.case.spacecraft, p.case.asteroid.gravity
    measures = measure_arc(
        state,
        p.path.mass[-1] * craft.mass_kg,
        p.target_m,
        p.normal,
        p.case.final_stage_s,
        p.case.asteroid.rotation_rate_rad_s,
        craft.exhaust_velocity_m_s,
        field.kind,
        field.params,
        points,
    )
    return measures, state, points


def test_matching_rows_are_the_difference_of_two_states_in_inertial_axes() -> None:
    p = Problem()
    _, state, _ = measured_arc(p)
    w = np.array([0.0, 0.0, p.case.asteroid.rotation_rate_rad_s])
    position = state[:3] / p.scaled.length_m
    inertial = (state[3:] + np.cross(w, state[:3])) * p.case.descent_s / p.scaled.length_m
    np.testing.assert_allclose(p.model.row_value[:3], p.path.position[-1] - position, rtol=0, atol=1e-14)
    np.testing.assert_allclose(p.model.row_value[3:6], p.path.velocity[-1] - inertial, rtol=0, atol=1e-14)


@pytest.mark.parametrize("reading", ["compensated", "paper"])
def test_arc_cones_hold_the_thrust_that_the_final_stage_flies(reading: str) -> None:
    """At each fraction: the head is tau over the mass there, the tail the thrust per mass."""
    p = Problem(final_stage_thrust=reading)
    T, w = p.case.final_stage_s, np.array([0.0, 0.0, p.case.asteroid.rotation_rate_rad_s])
    a0, length = p.scaled.acceleration_m_s2, p.scaled.length_m

    def thrust_per_mass(to_go: float, flown: bool) -> np.ndarray:
        a_e, a_s, r_e, r_s, v_e, v_s = arc_weights(to_go / T, p.scaled.final_time)
        e, s = p.point.y[1:4], p.point.y[4:7]
        acceleration = (a_e * e + a_s * s) * a0
        r = p.target_m + (r_e * e + r_s * s) * length
        v = (v_e * e + v_s * s) * length / p.case.descent_s
        if flown:
            frame = 2 * np.cross(w, v) + np.cross(w, np.cross(w, r))
            acceleration = acceleration - accelerations(p.case.asteroid.gravity, r)[0] + frame
        return acceleration

    for j, fraction in enumerate(p.scaled.arc_fractions):
        cone = p.model.cone_map[j] @ p.point.y + p.model.cone_offset[j]
        expected = thrust_per_mass(fraction * T, reading == "compensated") / a0
        np.testing.assert_allclose(cone[1:], expected, rtol=0, atol=1e-13)
        # both readings consume what they hold: the paper's flies a* as if it were thrust
        used = quad(
            lambda s: float(np.linalg.norm(thrust_per_mass(s, reading == "compensated"))), fraction * T, T
        )[0]
        mass = p.path.mass[-1] * math.exp(-used / p.case.spacecraft.exhaust_velocity_m_s)
        assert cone[0] == pytest.approx(p.point.y[0] / mass, rel=2e-4)


def test_glide_cones_are_zero_exactly_on_the_slope() -> None:
    p = Problem()
    rng = np.random.default_rng(8)
    theta = p.case.glide_slope_half_angle_rad
    for _ in range(20):
        side = np.cross(p.normal, rng.normal(size=3))
        side /= np.linalg.norm(side)
        for angle, sign in ((theta - 1e-6, 1), (theta + 1e-6, -1)):
            at_touchdown = math.cos(angle) * p.normal + math.sin(angle) * side
            other = rng.normal(size=3)
            # at the handover the arc lies along 2 a_e + a_s
            for j, y in (
                (0, [1.0, *other, *(at_touchdown - 2 * other)]),
                (1, [1.0, *at_touchdown, *other]),
            ):
                cone = p.model.cone_map[len(p.scaled.arc_fractions) + j] @ y
                assert sign * (cone[0] - np.linalg.norm(cone[1:])) > 0.0
                assert abs(cone[0] - np.linalg.norm(cone[1:])) < 1e-5


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.3, 0.2, 0.93)])
def test_the_glide_cone_stands_on_any_normal(normal: tuple[float, float, float]) -> None:
    p = Problem()
    n = np.array(normal) / np.linalg.norm(normal)
    fill_glide_cones(p.scaled, n, p.model)
    map_e = p.model.cone_map[-1][:, 1:4]
    np.testing.assert_allclose(map_e[0], math.tan(p.case.glide_slope_half_angle_rad) * n, rtol=1e-14)
    across = map_e[1:3]
    np.testing.assert_allclose(across @ across.T, np.eye(2), rtol=0, atol=1e-14)
    np.testing.assert_allclose(across @ n, 0.0, rtol=0, atol=1e-15)


def test_planes_touch_the_ellipsoid_at_their_node_when_they_are_retaken() -> None:
    p = Problem()
    p.refresh(retake=True)
    for c, k in enumerate(CUT_NODES):
        n, x = p.cuts.normal[c], p.path.position[k]
        level = ellipsoid_level(p.scaled, p.scaled.node_cos[k], p.scaled.node_sin[k], *x)
        assert p.model.row_value[p.plan.first_plane + c] == pytest.approx(level - 1.01, abs=1e-14)
        # a tangent plane of the unit sphere in xi: no point of the plane is inside the ellipsoid
        rng = np.random.default_rng(k)
        for point in rng.normal(size=(50, 3)):
            on_plane = point / (n @ point)
            assert (
                ellipsoid_level(p.scaled, p.scaled.node_cos[k], p.scaled.node_sin[k], *on_plane) > 1 - 1e-12
            )
        assert n @ (x / level) == pytest.approx(1.0, rel=1e-13)


def test_a_wall_holds_at_its_node_or_at_its_point_of_the_final_arc() -> None:
    p = Problem()
    first = p.plan.first_plane + len(CUT_NODES)
    T, e, s = p.scaled.final_time, p.point.y[1:4], p.point.y[4:7]
    node, fraction = WALLS[0][0], WALLS[1][1]
    togo = fraction * T
    arc = p.target + togo**2 * (0.5 * e + (s - e) / (6.0 * T) * togo)  # s^2 (A + B s)
    normals = p.cuts.normal[len(CUT_NODES) : len(CUT_NODES) + 2]
    expected = np.array([normals[0] @ p.path.position[node], normals[1] @ arc]) - WALL_OFFSET
    np.testing.assert_allclose(p.model.row_value[first : first + 2], expected, rtol=0, atol=1e-14)
    p.refresh(retake=True)  # moves tangent planes only
    np.testing.assert_array_equal(p.cuts.normal[len(CUT_NODES) : len(CUT_NODES) + 2], normals)
    np.testing.assert_allclose(p.model.row_value[first : first + 2], expected, rtol=0, atol=1e-14)


def lagrangian(p: Problem, thrust: np.ndarray, y: np.ndarray) -> float:
    """What the stationarity residual is the gradient of, nodes' own cones aside, from the values alone."""
    p.point.thrust[:], p.point.y[:] = thrust, y
    energy, _ = p.refresh()
    arc = p.model.cone_map @ y + p.model.cone_offset
    cones = np.sum(p.point.cone_dual * arc)
    rows = p.point.multiplier @ p.model.row_value
    return float(p.plan.energy_weight * energy + y[0] + rows - cones)


def gradient_of_the_lagrangian(p: Problem) -> tuple[np.ndarray, np.ndarray]:
    thrust, y, step = p.point.thrust.copy(), p.point.y.copy(), 1e-6
    by_thrust, by_y = np.zeros_like(thrust), np.zeros(7)
    for index in np.ndindex(thrust.shape):
        d = np.zeros_like(thrust)
        d[index] = step
        by_thrust[index] = (lagrangian(p, thrust + d, y) - lagrangian(p, thrust - d, y)) / (2 * step)
    for a in range(7):
        d = step * np.eye(7)[a]
        by_y[a] = (lagrangian(p, thrust, y + d) - lagrangian(p, thrust, y - d)) / (2 * step)
    lagrangian(p, thrust, y)
    return by_thrust, by_y


def test_the_thrust_gradient_is_that_of_the_lagrangian_mass_included() -> None:
    p = Problem(propellant_kg=None)
    p.point.cone_dual[:, 0] = 0.02  # so that the mass matters for the descent above all
    p.refresh()
    held = p.plan.energy_weight / N * p.point.thrust + p.model.row_pull
    found = p.model.thrust_gradient + p.model.row_pull
    truth, _ = gradient_of_the_lagrangian(p)
    through_mass = np.abs(truth - held).max()
    assert through_mass > 0.003 * np.abs(truth).max()
    np.testing.assert_allclose(found, truth, rtol=0, atol=0.01 * through_mass)


def test_without_mass_flow_both_gradients_are_those_of_the_lagrangian() -> None:
    p = Problem(mass_flow=0.0, handover="on_ellipsoid", final_stage_thrust="paper")
    by_thrust, by_y = gradient_of_the_lagrangian(p)
    on_thrust = p.model.thrust_gradient + p.model.row_pull
    on_y = p.model.y_gradient + p.model.row_y.T @ p.point.multiplier
    on_y -= np.einsum("jia,ji->a", p.model.cone_map, p.point.cone_dual)
    np.testing.assert_allclose(on_thrust, by_thrust, rtol=0, atol=1e-4 * np.abs(by_thrust).max())
    np.testing.assert_allclose(on_y, by_y, rtol=0, atol=1e-8)


def test_the_hessian_in_y_is_that_of_the_energy_and_of_a_pressing_handover() -> None:
    p = Problem(mass_flow=0.0, handover="on_ellipsoid")
    for multiplier in (-0.3, 0.4):
        p.point.multiplier[6] = multiplier
        p.refresh()
        y, step, expected = p.point.y.copy(), 1e-6, np.zeros((7, 7))
        hessian = p.model.y_hessian.copy()
        for a in range(7):
            d = step * np.eye(7)[a]
            sides = []
            for moved in (y + d, y - d):
                p.rows_at(p.point.thrust.copy(), moved)
                bend = max(multiplier, 0.0) * p.model.row_y[6]
                sides.append(p.model.y_gradient + bend)
            expected[:, a] = (sides[0] - sides[1]) / (2 * step)
        p.rows_at(p.point.thrust.copy(), y)
        np.testing.assert_allclose(hessian, expected, rtol=0, atol=1e-8)
        assert np.linalg.eigvalsh(hessian[1:, 1:]).min() > 0.0


def test_energy_is_that_of_the_two_stages() -> None:
    p = Problem()
    T = p.scaled.final_time
    e, s = p.point.y[1:4], p.point.y[4:7]
    final = quad(lambda f: 0.5 * T * float(np.sum(((1 - f) * e + f * s) ** 2)), 0.0, 1.0)[0]
    assert p.energy == pytest.approx(0.5 * np.sum(p.point.thrust**2) / N + final, rel=1e-12)


def test_layout_counts_the_rows_that_are_filled() -> None:
    p = Problem(handover="on_ellipsoid")
    assert (p.plan.n_equal, p.plan.first_plane, p.plan.n_rows) == (7, 9, 14)
    assert p.plan.n_cones == len(p.scaled.arc_fractions) + 2
    assert p.model.row_end.tolist() == [N] * 6 + [0, 0, N, *CUT_NODES, 5, 0]
