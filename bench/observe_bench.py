"""CPU time of a least-energy landing through waypoints beside the same one by IPOPT through CasADi.

Run ``python -m bench observe``: the paper's case where its mesh is found in LANDING_REFERENCE_DATA/shapes
(default ../shared/shapes), else the same start over the shipped Eros shape. Ours flies in the polyhedron
itself and in the interpolated field; IPOPT solves a Hermite-Simpson transcription with as many intervals in a
cubic B-spline of the field, as the polyhedron has no expression that CasADi could differentiate.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.bvh import build_surface_index
from landing_cli.body.gravity.boxed import Box, boxed_field
from landing_cli.body.gravity.field_values import accelerations
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.body.mesh import facet_centroids, facet_normals
from landing_cli.flight.linear_arcs import frame_slopes
from landing_cli.flight.replay import replay
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.observe.energy_flight import EnergyFlight, energy_flight, inverse_dynamics, spline_positions
from landing_cli.observe.gravity_box import box_of
from landing_cli.observe.observed import Path as FlownPath
from landing_cli.observe.path_values import control_energy
from landing_cli.observe.records import Landmarks, ObserveCase, Prior, Sensor, SteeringOptions
from landing_cli.observe.site_frame import site_frame
from landing_cli.observe.transcription import least_energy_path
from landing_cli.observe.waypoints import waypoints_of
from landing_cli.sources.shape_files import read_shape

GM, SPIN, TOF, NODES = 4.46311e5, 3.31165e-4, 800.0, 400
SITE_M = (1142.533333, 4668.203333, 1099.37)
INNER_M = np.array([[-28.67, 71.88], [1.92, 21.90]])
ROUNDS, GRID = 3, 17


def eros() -> tuple[str, ObserveCase]:
    """Build the paper's case, on the mesh that is found."""
    root = Path(__file__).resolve().parent.parent
    reference = Path(os.environ.get("LANDING_REFERENCE_DATA", root.parent / "shared")) / "shapes"
    path = next(p for p in (reference / "eros_near_3897.obj", root / "shapes" / "eros.obj") if p.is_file())
    mesh = read_shape(path, "km").mesh
    facet = int(np.argmin(np.linalg.norm(facet_centroids(mesh) - SITE_M, axis=1)))
    frame = site_frame(facet_centroids(mesh)[facet], facet_normals(mesh)[facet], "radial", facet)
    none = np.zeros((0, 3))
    case = ObserveCase(
        name="paper",
        asteroid=Asteroid("eros", mesh, SPIN, polyhedron_field(mesh.vertices, mesh.faces, GM), GM),
        spacecraft=Spacecraft(500.0, 1000.0, 220.0),
        position_m=frame.to_body(np.array([-60.0, 70.0, 65.0])),
        velocity_m_s=np.zeros(3),
        frame=frame,
        time_of_flight="fixed",
        tof_s=TOF,
        tof_range_s=(TOF, TOF),
        landmarks=Landmarks(none, none, np.zeros(0), (), np.zeros(0, dtype=np.int64)),
        sensor=Sensor("lidar", 0.5, "nadir", 0.0, 500.0, 1.4, 1.4, 0.1, 1e-3, 0.5),
        prior=Prior(5.0, 0.05),
        sun_direction=None,
        clearance_m=None,
        clearance_free_m=30.0,
        glide_slope_half_angle_rad=None,
        surface=build_surface_index(mesh),
    )
    return f"{path.name}, {len(mesh.faces)} facets, facet {facet}", case


def gravity_spline(case: ObserveCase, box: Box) -> Any:
    """Tabulate gravity over a box, as a cubic B-spline that CasADi differentiates."""
    import casadi as ca

    grid = [np.linspace(a, b, GRID) for a, b in zip(box.lower_m, box.upper_m, strict=True)]
    points = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, 3)
    g = accelerations(case.asteroid.gravity, points @ box.axes + box.origin_m)
    ordered = g.reshape(GRID, GRID, GRID, 3).transpose(3, 0, 1, 2).reshape(3, -1, order="F")
    return ca.interpolant("g", "bspline", grid, ordered.ravel(order="F"))


def ipopt(flight: EnergyFlight, box: Box, spline: Any) -> tuple[float, float, float]:
    """Build and solve with IPOPT; J, and CPU times of both, s. Scaled as ours."""
    import casadi as ca

    began = time.process_time()
    case, times, unit = flight.case, flight.times_s, flight.unit
    by_v, by_r = frame_slopes(case.asteroid.rotation_rate_rad_s)
    site, n, tof = case.frame.origin_m, len(times) - 1, flight.tof_s
    state, h = ca.MX.sym("x", 6), np.diff(times) / tof
    control = ca.MX.sym("u", 3)
    r, v = state[:3] * unit[0] + site, state[3:] * unit[3]
    g = spline(box.axes @ (r - box.origin_m))
    rate = ca.vertcat(state[3:], (g + by_r @ r + by_v @ v) / unit[6] + control)
    f = ca.Function("f", [state, control], [rate])
    X, U, M = ca.MX.sym("X", 6, n + 1), ca.MX.sym("U", 3, n + 1), ca.MX.sym("M", 3, n)
    every = f.map(n + 1)(X, U)
    left, right = every[:, :-1], every[:, 1:]
    steps = ca.repmat(ca.DM(h).T, 6, 1)
    middle = 0.5 * (X[:, :-1] + X[:, 1:]) + steps / 8.0 * (left - right)
    gaps = X[:, 1:] - X[:, :-1] - steps / 6.0 * (left + 4.0 * f.map(n)(middle, M) + right)
    squares = ca.sum1(U[:, :-1] ** 2 + 4.0 * M**2 + U[:, 1:] ** 2)
    cost = ca.sum2(squares * ca.DM(h).T) / 6.0
    ends = [X[:, 0] - flight.start / unit[:6], X[:, n]]
    passed = [
        case.frame.axes[:2] @ X[:3, int(k)] - point / unit[0]
        for k, point in zip(flight.waypoint_node, flight.waypoint_m, strict=True)
    ]
    unknowns = ca.vertcat(ca.vec(X), ca.vec(U), ca.vec(M))
    rows = ca.vertcat(ca.vec(gaps), *ends, *passed)
    quiet = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-10}}
    solver = ca.nlpsol("landing", "ipopt", {"x": unknowns, "f": cost, "g": rows}, quiet)
    built = time.process_time()
    path = spline_positions(flight)
    guess = np.concatenate([path(times) - site, path(times, 1)], axis=1) / unit[:6]
    thrust = inverse_dynamics(case, path(times), path(times, 1), path(times, 2)) / unit[6:]
    halfway = 0.5 * (thrust[1:] + thrust[:-1])
    start = np.concatenate([guess.ravel(), thrust.ravel(), halfway.ravel()])
    answer = solver(x0=start, lbg=0.0, ubg=0.0)
    if not solver.stats()["success"]:
        raise SystemExit(f"IPOPT: {solver.stats()['return_status']}")
    energy = float(answer["f"]) * unit[0] ** 2 / tof**3
    return energy, built - began, time.process_time() - built


def cpu_s(work: Callable[[], Any], rounds: int) -> tuple[float, Any]:
    """Best CPU time of some calls, s, and the last answer."""
    best, answer = math.inf, None
    for _ in range(rounds):
        start = time.process_time()
        answer = work()
        best = min(best, time.process_time() - start)
    return best, answer


def miss_m(case: ObserveCase, path: FlownPath) -> float:
    """Distance between the site and where the thrust ends in the polyhedron, flown open loop."""
    flown = replay(
        case.position_m,
        case.velocity_m_s,
        case.spacecraft.mass_kg,
        [path.leg],
        rotation_rate_rad_s=SPIN,
        field=case.asteroid.gravity,
        exhaust_velocity_m_s=case.spacecraft.exhaust_velocity_m_s,
        integrator="gauss",
    )
    return float(np.linalg.norm(flown.position_m[-1] - case.frame.origin_m))


def main() -> None:
    """Print the table."""
    name, case = eros()
    box = box_of(case)
    print(f"{name}; CPU, kernels compiled and loaded; J over that in the polyhedron, and the miss there")
    least_energy_path(case, TOF, None, 20)
    fit_s, fitted = cpu_s(lambda: boxed_field(case.asteroid.gravity, box), 1)
    print(f"  interpolating {fit_s:.1f} s: {fitted.pieces} pieces, {fitted.error:.1e} of g at most")
    fast = replace(case, asteroid=replace(case.asteroid, gravity=fitted.field))
    table_s, spline = cpu_s(lambda: gravity_spline(case, box), 1)
    print(f"  tabulating for CasADi {table_s:.1f} s: {GRID}^3 points")
    for count in (0, 1, 3, 7):
        wanted = waypoints_of(case, INNER_M, TOF, SteeringOptions(waypoints=count))
        flight = energy_flight(case, TOF, wanted, NODES)
        exact_s, exact = cpu_s(lambda w=wanted: least_energy_path(case, TOF, w, NODES), ROUNDS)
        energy = exact.performance_index_m2_s3
        print(f"  m = {count}: J = {energy:.13f} m2/s3")
        path, t = spline_positions(flight), flight.times_s
        spline_s, u = cpu_s(lambda p=path, t=t: inverse_dynamics(case, p(t), p(t, 1), p(t, 2)), 1)
        row("spline and inverse dynamics", spline_s, control_energy(t, u) / energy - 1.0)
        row("sparse KKT, polyhedron", exact_s, 0.0, miss_m(case, exact))
        quick_s, quick = cpu_s(lambda w=wanted: least_energy_path(fast, TOF, w, NODES), ROUNDS)
        row(
            "sparse KKT, interpolated",
            quick_s,
            quick.performance_index_m2_s3 / energy - 1.0,
            miss_m(case, quick),
        )
        other, build_s, solve_s = ipopt(flight, box, spline)
        row(f"IPOPT, and {build_s:.1f} s to build", solve_s, other / energy - 1.0)
        times = f"{solve_s / exact_s:.1f} to the polyhedron, {solve_s / quick_s:.0f} to the interpolated"
        print(f"    ratio: {times}")


def row(name: str, cpu: float, above: float, miss: float | None = None) -> None:
    """Print one line of the table."""
    told = "" if miss is None else f"{miss:9.1e} m"
    print(f"    {name:32s} {cpu:8.3f} s  {above:+9.1e}  {told}", flush=True)


if __name__ == "__main__":
    main()
