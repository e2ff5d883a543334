"""The multipliers that a solve hands out: costates, and what each constraint is worth."""

from __future__ import annotations

import numpy as np
import pytest
from landing_samples import asteroid, landing_case
from scipy.integrate import solve_ivp

from landing_cli.body.gravity.field_values import accelerations, gradients
from landing_cli.flight.dynamics import about_z
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.free_batch import Batch
from landing_cli.reach.free_descent import prepare, solve_facets, survey
from landing_cli.reach.free_flights import Question, best_flights
from landing_cli.reach.free_solve import CONVERGED
from landing_cli.reach.records import Binding, LandingCase, Verdict


def extremal_of(case: LandingCase, costates: np.ndarray, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States (SI, mass as a ratio) and thrust ratios (body axes) along the extremal of some costates."""
    craft, duration = case.spacecraft, case.descent_s
    a0 = craft.thrust_max_n / craft.mass_kg
    length = a0 * duration**2
    w = np.array([0.0, 0.0, case.asteroid.rotation_rate_rad_s * duration])
    flow = craft.thrust_max_n * duration / (craft.isp_s * 9.80665 * craft.mass_kg)

    def thrust(y: np.ndarray) -> np.ndarray:
        speed = np.linalg.norm(y[10:13])
        return -min(speed / y[6] + flow * y[13], 1.0) * y[10:13] / speed

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        r, v, m, lambda_r, lambda_v = y[:3], y[3:6], y[6], y[7:10], y[10:13]
        gravity = accelerations(case.asteroid.gravity, r * length)[0] / a0
        gradient = gradients(case.asteroid.gravity, r * length)[0] * duration**2
        u = thrust(y)
        return np.concatenate(
            [
                v,
                gravity + u / m - 2 * np.cross(w, v) - np.cross(w, np.cross(w, r)),
                [-flow * np.linalg.norm(u)],
                np.cross(w, np.cross(w, lambda_v)) - gradient @ lambda_v,
                -lambda_r + 2 * np.cross(lambda_v, w),
                [lambda_v @ u / m**2],
            ]
        )

    start = np.concatenate([case.position_m / length, case.velocity_m_s * duration / length, [1.0], costates])
    flown = solve_ivp(rates, (0, 1), start, "DOP853", times, rtol=1e-9, atol=1e-11, max_step=0.02)
    states = flown.y[:7].T.copy()
    states[:, :3] *= length
    states[:, 3:6] *= length / duration
    return states, np.array([thrust(y) for y in flown.y.T])


def test_the_costates_fly_the_same_way_as_the_stored_thrust() -> None:
    """Where the ellipsoid leaves the flight alone, their extremal has its thrust and its handover."""
    case = landing_case(asteroid(gravity=3.0, spin=3.0))
    solutions = solve_facets(case, np.arange(0, 320, 3))
    rows = solutions.rows
    free = (
        (rows["verdict"] == Verdict.REACHABLE)
        & (rows["ellipsoid_margin"] > 0.02)
        & (rows["binding"] != Binding.ELLIPSOID)
    )
    tried = np.flatnonzero(free)[::4]
    assert len(tried) >= 6
    saturated = 0
    for k in tried:
        nodes = solutions.nodes_of(int(k)) / case.spacecraft.thrust_max_n
        n = len(nodes)
        times = np.sort(np.concatenate([(np.arange(n) + 0.5) / n, [1.0]]))
        states, thrust = extremal_of(case, rows["costates"][k], times)
        angle = case.asteroid.rotation_rate_rad_s * case.descent_s * (1.0 - times[:-1])
        stored = about_z(angle, nodes)
        saturated += np.linalg.norm(nodes, axis=1).max() > 0.999
        assert np.abs(thrust[:-1] - stored).max() < 2e-3
        miss = np.linalg.norm(states[-1, :3] - rows["handover_position_m"][k])
        assert miss < 4e-4 * case.spacecraft.thrust_max_n / case.spacecraft.mass_kg * case.descent_s**2
    assert saturated > 0


LOOSER = 1e-3


def loosened(tof_s: float, half_angle_deg: float, constraint: Binding) -> LandingCase:
    """A case in which several kinds of limit shape the flights, one of them loosened."""
    factor = {kind: 1.0 + LOOSER * (kind == constraint) for kind in Binding}
    slope = np.tan(np.radians(half_angle_deg)) * factor[Binding.GLIDE_SLOPE]
    craft = Spacecraft(2000.0, 20.0 * factor[Binding.THRUST], 400.0, 2.4 * factor[Binding.PROPELLANT])
    return landing_case(
        tof_s=tof_s,
        spacecraft=craft,
        glide_slope_half_angle_rad=float(np.arctan(slope)),
        ellipsoid_m=np.array([300.0, 280.0, 260.0]) / factor[Binding.ELLIPSOID],
    )


def best(case: LandingCase) -> tuple[Batch, np.ndarray]:
    """Least-energy flights to every other facet, and J."""
    p = prepare(case, survey(case))
    facets = np.arange(0, 320, 2)
    targets, normals = p.shared.centroids_m[facets] / p.coarse.length_m, p.shared.normals[facets]
    arc = p.shared.bounds.on_arcs_m_s2 / p.coarse.acceleration_m_s2
    flights, _ = best_flights(Question(p.coarse, targets, normals, False, p.coarse_tube, arc))
    scale = p.coarse.acceleration_m_s2**2 * case.descent_s
    return flights, np.where(flights.status == CONVERGED, scale * flights.energy, np.nan)


@pytest.mark.parametrize(
    ("constraint", "tof_s", "half_angle_deg", "tolerance"),
    [
        (Binding.THRUST, 760.0, 45.0, 0.03),
        (Binding.GLIDE_SLOPE, 760.0, 45.0, 0.01),
        (Binding.PROPELLANT, 860.0, 85.0, 0.1),
        (Binding.ELLIPSOID, 860.0, 85.0, 0.25),
    ],
)
def test_a_pressure_is_what_loosening_the_constraint_gains(
    constraint: Binding, tof_s: float, half_angle_deg: float, tolerance: float
) -> None:
    """By the envelope theorem, for a relative unit; the largest one names the constraint that binds."""
    tight = loosened(tof_s, half_angle_deg, Binding.NONE)
    base, j = best(tight)
    _, looser = best(loosened(tof_s, half_angle_deg, constraint))
    gain = (j - looser) / LOOSER / (tight.descent_s * (20.0 / 2000.0) ** 2)
    pressure = base.pressure[:, int(constraint) - 1]
    pressed = (pressure > 0.02) & np.isfinite(gain)
    assert pressed.sum() >= 2
    np.testing.assert_allclose(gain[pressed], pressure[pressed], rtol=tolerance)
