"""What is delivered, computed again from the stored thrust by other means."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from landing_samples import asteroid, flown_by_dop853, landing_case
from scipy.spatial import Delaunay

from landing_cli.body.gravity.field_values import accelerations
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.delivery import LIMIT_TOLERANCE, VALUE_COLUMNS, deliver_many, new_deliveries
from landing_cli.reach.free_descent import PreparedCase, prepare, solve_prepared, survey
from landing_cli.reach.records import FacetSolutions, LandingCase, Verdict

SAMPLES = 20  # an interval


@lru_cache
def solved(**changes: Any) -> tuple[PreparedCase, FacetSolutions, np.ndarray]:
    """A case, its answers for every tenth facet, and the rows that are reachable."""
    p = prepare(case := landing_case(asteroid(gravity=3.0, spin=2.0), tof_s=800.0, **changes), survey(case))
    solutions = solve_prepared(p, np.arange(0, 320, 10))
    return p, solutions, np.flatnonzero(solutions.rows["verdict"] == Verdict.REACHABLE)


def final_arc(case: LandingCase, state: np.ndarray, target: np.ndarray, count: int = 2001) -> dict[str, Any]:
    """Zhao 2022, eqs 13-14, by numpy: samples of path, a*, and flown thrust per mass."""
    T, t = case.final_stage_s, np.linspace(0.0, case.final_stage_s, count)[:, None]
    r, v = state[:3] - target, state[3:6]
    a = 6 * (T * v + 2 * r) / T**3 * t - 2 * (2 * T * v + 3 * r) / T**2
    jerk, first = 6 * (T * v + 2 * r) / T**3, -2 * (2 * T * v + 3 * r) / T**2
    velocity = v + first * t + 0.5 * jerk * t**2
    position = state[:3] + v * t + first * t**2 / 2 + jerk * t**3 / 6
    w = np.array([0.0, 0.0, case.asteroid.rotation_rate_rad_s])
    frame = 2 * np.cross(w, velocity) + np.cross(w, np.cross(w, position))
    thrust = np.linalg.norm(a - accelerations(case.asteroid.gravity, position) + frame, axis=1)
    used = np.concatenate([[0.0], np.cumsum(0.5 * (thrust[1:] + thrust[:-1]) * np.diff(t[:, 0]))])
    mass = state[6] * np.exp(-used / case.spacecraft.exhaust_velocity_m_s)
    return {
        "energy": 0.5 * np.trapezoid(np.sum(a**2, axis=1), t[:, 0]),
        "position": position,
        "mass": mass,
        "thrust": mass * thrust,
        "planned": mass * np.linalg.norm(a, axis=1),
    }


@pytest.mark.parametrize("reading", ["compensated", "paper"])
def test_every_column_is_that_of_an_independent_flight(reading: str) -> None:
    p, solutions, reachable = solved(final_stage_thrust=reading)
    case = p.case
    assert len(reachable) >= 8
    for row in reachable[::5]:
        found, nodes = solutions.rows[row], solutions.nodes_of(row)
        target, normal = p.shared.centroids_m[found["facet"]], p.shared.normals[found["facet"]]
        flown = flown_by_dop853(case, nodes)
        end = flown[-1]
        np.testing.assert_allclose(found["handover_position_m"], end[:3], rtol=0, atol=1e-6)
        np.testing.assert_allclose(found["handover_velocity_m_s"], end[3:6], rtol=0, atol=1e-8)
        assert found["handover_mass_kg"] == pytest.approx(end[6], rel=1e-12)
        arc = final_arc(case, end, target)
        np.testing.assert_allclose(arc["position"][-1], target, rtol=0, atol=1e-9)
        sizes = np.linalg.norm(nodes, axis=1)
        j1 = 0.5 * np.sum((sizes / case.spacecraft.mass_kg) ** 2) * case.descent_s / len(nodes)
        assert found["performance_index_m2_s3"] == pytest.approx(j1 + arc["energy"], rel=5e-7)
        fuel = case.spacecraft.mass_kg - arc["mass"][-1]
        assert found["fuel_kg"] == pytest.approx(fuel, rel=3e-4)
        speed = -case.spacecraft.isp_s * 9.80665 * math.log(1 - fuel / case.spacecraft.mass_kg)
        assert found["delta_v_m_s"] == pytest.approx(speed, rel=3e-4)
        bound = case.spacecraft.thrust_max_n
        assert found["peak_thrust_ratio_descent"] == pytest.approx(sizes.max() / bound, rel=1e-12)
        peak = arc["thrust" if reading == "compensated" else "planned"].max() / bound
        assert found["peak_thrust_ratio_final"] == pytest.approx(peak, rel=1e-4)
        assert found["peak_thrust_ratio"] == max(
            found["peak_thrust_ratio_descent"], found["peak_thrust_ratio_final"]
        )
        ways = end[:3] - target, arc["position"][-2] - target
        angles = [math.acos(way @ normal / np.linalg.norm(way)) for way in ways]
        margin = np.degrees(case.glide_slope_half_angle_rad - max(angles))
        assert found["glide_slope_margin_deg"] == pytest.approx(margin, abs=0.05)


def dense_margins(p: PreparedCase, solutions: FacetSolutions, rows: np.ndarray) -> np.ndarray:
    """Least r'Re r - 1 along each descent, between the solver's samples too."""
    return np.array(
        [
            np.min(
                np.sum(
                    (flown_by_dop853(p.case, solutions.nodes_of(r), SAMPLES)[:, :3] / p.case.ellipsoid_m)
                    ** 2,
                    1,
                )
            )
            - 1.0
            for r in rows
        ]
    )


def test_the_ellipsoid_margin_is_the_least_along_a_dense_flight() -> None:
    p, solutions, reachable = solved()
    hugging = reachable[np.argsort(solutions.rows["ellipsoid_margin"][reachable])][:4]
    margins = dense_margins(p, solutions, hugging)
    promised = solutions.rows["ellipsoid_margin"][hugging] - margins
    assert promised.max() < LIMIT_TOLERANCE
    assert promised.min() > -1e-4


def hand_over(p: PreparedCase, thrust: np.ndarray, facet: int) -> tuple[dict[str, float], np.ndarray]:
    """Deliver an arbitrary thrust (N, 3), scaled."""
    out = new_deliveries(1)
    deliver_many(
        p.coarse,
        p.frame,
        p.shared.surface,
        thrust[None],
        p.shared.centroids_m[facet : facet + 1],
        p.shared.normals[facet : facet + 1],
        out,
    )
    return dict(zip(VALUE_COLUMNS, out.values[0], strict=True)), out.handover[0]


def test_a_path_through_the_rock_has_negative_clearance() -> None:
    """The rock is convex: the deepest point's depth is its least distance to a facet's plane."""
    p, solutions, reachable = solved()
    corners = p.case.asteroid.mesh.vertices
    hull = Delaunay(corners)
    near = reachable[0]
    thrust = solutions.nodes_of(near) / p.frame.thrust_max_n
    far = int(np.argmin(p.shared.normals @ p.case.position_m))
    values, handover = hand_over(p, thrust, far)
    path = final_arc(p.case, handover, p.shared.centroids_m[far])["position"]
    assert (hull.find_simplex(path) >= 0).mean() > 0.3
    planes = np.sum(p.shared.normals * p.shared.centroids_m, axis=1)
    depth = np.min(planes - path @ p.shared.normals.T, axis=1).max()
    assert values["terrain_clearance_min_m"] == pytest.approx(-depth, rel=0.02)
    own = solutions.rows["terrain_clearance_min_m"][near]
    assert own > 0.0


def test_each_limit_that_is_broken_is_the_violation() -> None:
    p, solutions, reachable = solved()
    row = reachable[0]
    facet, thrust = int(solutions.rows["facet"][row]), solutions.nodes_of(row) / p.frame.thrust_max_n
    values, _ = hand_over(p, thrust, facet)
    assert values["violation"] == 0.0
    stronger = thrust.copy()
    stronger[5] *= 1.1 / np.linalg.norm(stronger[5])
    values, _ = hand_over(p, stronger, facet)
    broken = max(
        0.1,
        values["peak_thrust_ratio_final"] - 1,
        -values["ellipsoid_margin"],
        -math.radians(values["glide_slope_margin_deg"]),
    )
    assert values["violation"] == pytest.approx(broken, rel=1e-9)
    # a facet on the far side: the arc comes in from below
    far = int(np.argmin(p.shared.normals @ p.case.position_m))
    values, _ = hand_over(p, thrust, far)
    assert values["glide_slope_margin_deg"] < -20.0
    largest = max(values["peak_thrust_ratio_final"] - 1, -math.radians(values["glide_slope_margin_deg"]))
    assert values["violation"] == pytest.approx(largest, rel=1e-9)


def test_fuel_above_the_bound_is_a_violation() -> None:
    p, solutions, reachable = solved()
    row = reachable[0]
    fuel = float(solutions.rows["fuel_kg"][row])
    case = landing_case(p.case.asteroid, tof_s=800.0, spacecraft=Spacecraft(2000.0, 20.0, 400.0, 0.9 * fuel))
    tight = prepare(case, p.shared)
    thrust = solutions.nodes_of(row) / p.frame.thrust_max_n
    values, _ = hand_over(tight, thrust, int(solutions.rows["facet"][row]))
    assert values["violation"] == pytest.approx(0.1 / 0.9, rel=1e-6)


def test_a_handover_off_the_ellipsoid_is_a_violation_in_that_reading() -> None:
    p, solutions, reachable = solved()
    far_out = reachable[np.argmax(solutions.rows["ellipsoid_margin"][reachable])]
    case = landing_case(p.case.asteroid, tof_s=800.0, handover="on_ellipsoid")
    values, handover = hand_over(
        prepare(case, p.shared),
        solutions.nodes_of(far_out) / p.frame.thrust_max_n,
        int(solutions.rows["facet"][far_out]),
    )
    off = abs(np.sum((handover[:3] / case.ellipsoid_m) ** 2) - 1.0)
    assert off > 0.01
    assert values["violation"] == pytest.approx(off, rel=1e-9)


def test_no_delivered_flight_dips_into_the_ellipsoid_between_its_samples() -> None:
    p, solutions, reachable = solved()
    near = reachable[solutions.rows["ellipsoid_margin"][reachable] < 1e-3]
    assert len(near) >= 3
    margins = dense_margins(p, solutions, near)
    assert margins.min() > -2.0 * LIMIT_TOLERANCE
