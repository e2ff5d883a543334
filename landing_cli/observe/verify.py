"""Whether a stored observation does what it says: flown again, seen again, every limit checked on the flight.

Every path is flown open loop, in the gravity it was planned in, by scipy's DOP853, which plans nothing; what
it costs, sees and knows is computed from that flight and held against what is stored. The same control under
the gravity of the mesh as a uniform polyhedron shows the error of the gravity model; that fails nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import closing
from functools import partial

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.clearance import TOUCHDOWN_TOLERANCE_M
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.flight.replay import replay
from landing_cli.observe.observed import ObservedPath, Path, Waypoints
from landing_cli.observe.path_samples import positions_at
from landing_cli.observe.path_values import CLEARANCE_TOLERANCE_M, GLIDE_SLOPE_TOLERANCE_RAD, path_of
from landing_cli.observe.records import ObserveCase
from landing_cli.observe.stored import ObservationEntry
from landing_cli.observe.tasks import observed
from landing_cli.parallel import LostChunk, WorkPlan, run_chunks
from landing_cli.results.verification import Check, FieldReport

FloatArray = NDArray[np.float64]

NOMINAL = "nominal"

# What a flight may miss, exceed or differ by at most.
LIMITS: Mapping[str, float] = {
    "touchdown_miss_m": 1e-3,
    "touchdown_speed_m_s": 1e-5,
    "waypoint_miss_m": 1e-3,
    "thrust_excess": 3e-5,  # over the bound, relative
    "depth_m": 2.0 * TOUCHDOWN_TOLERANCE_M,
    "clearance_shortfall_m": 2.0 * CLEARANCE_TOLERANCE_M,
    "glide_slope_excess_rad": 2.0 * GLIDE_SLOPE_TOLERANCE_RAD,
    "stored_path_m": 1e-3,
    "stored_performance_index": 1e-9,  # relative
    "stored_delta_v": 1e-9,  # relative
    "stored_propellant_mass_fraction": 1e-9,  # relative
    "stored_peak_thrust": 1e-9,  # relative
    "stored_clearance_m": 1e-3,
    "stored_visible": 1e-3,  # share of the pairs of time and landmark
    "stored_position_sigma": 1e-3,  # relative
}


def verify_run(
    entries: tuple[ObservationEntry, ...],
    *,
    polyhedron_for_all: bool = False,
    jobs: int = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[FieldReport, ...]:
    """Fly the unsteered path and every steered one again, and check what is said about them.

    Parameters
    ----------
    entries : tuple of ObservationEntry
        Observations of one run, at least one.
    polyhedron_for_all : bool
        Does nothing: the few paths of a run all fly under the polyhedron.
    jobs : int
        Threads.
    progress : callable
        Told (flown, total) paths.

    Returns
    -------
    tuple of FieldReport
        The unsteered path's first, then one an observation.
    """
    case = entries[0].case
    body = case.asteroid
    polyhedron = None
    if body.gravity.kind is not GravityKind.POLYHEDRON:
        polyhedron = polyhedron_field(body.mesh.vertices, body.mesh.faces, body.gm_m3_s2)
    paths: list[tuple[str, ObservedPath, Waypoints | None]] = [
        (NOMINAL, entries[0].observation.nominal, None)
    ]
    paths += [(entry.name, entry.observation.steered, entry.observation.waypoints) for entry in entries]
    reports: dict[int, FieldReport] = {}
    chunks = [[index] for index in range(len(paths))]
    with closing(
        run_chunks(partial(_verify_at, case, paths, polyhedron), chunks, WorkPlan(jobs=jobs))
    ) as coming:
        for index, report in coming:
            assert not isinstance(report, LostChunk)  # threads lose nothing
            reports[index] = report
            progress(len(reports), len(paths))
    return tuple(reports[index] for index in range(len(paths)))


def _verify_at(
    case: ObserveCase,
    paths: list[tuple[str, ObservedPath, Waypoints | None]],
    polyhedron: GravityField | None,
    chunk: list[int],
) -> FieldReport:
    return verify_path(case, *paths[chunk[0]], polyhedron)


def verify_path(
    case: ObserveCase,
    name: str,
    stored: ObservedPath,
    waypoints: Waypoints | None = None,
    polyhedron: GravityField | None = None,
) -> FieldReport:
    """Fly one path again and check what is said about it.

    Parameters
    ----------
    case : ObserveCase
        What was asked.
    name : str
        Of the path.
    stored : ObservedPath
        What is said about it.
    waypoints : Waypoints, optional
        Where it was asked to pass.
    polyhedron : GravityField, optional
        A field to fly it in too.

    Returns
    -------
    FieldReport
    """
    path = stored.path
    fault = "" if path.status == "planned" or path.message else f"it is {path.status}, but does not say why"
    if not fault and case.time_of_flight == "fixed" and abs(path.tof_s - case.tof_s) > 1e-9 * case.tof_s:
        fault = f"it lasts {path.tof_s:.9g} s, its time of flight is {case.tof_s:.9g} s"
    if fault or path.status == "unresolved":
        return FieldReport(name, path.status, False, {}, fault, None)
    again = observed(case, fly(case, path, case.asteroid.gravity))
    checks = _agreement(stored, again)
    if path.status == "planned":
        checks = {**_limits(case, again.path, waypoints), **checks}
    worst = {key: Check(float(checks[key]), limit) for key, limit in LIMITS.items() if key in checks}
    miss = None
    if polyhedron is not None:
        miss = math.dist(fly(case, path, polyhedron).position_m[-1], case.frame.origin_m)
    return FieldReport(name, path.status, True, worst, "", miss)


def fly(case: ObserveCase, path: Path, field: GravityField) -> Path:
    """Integrate a path's thrust acceleration open loop, and measure the flight at the same nodes.

    Parameters
    ----------
    case : ObserveCase
        What was asked; the flight begins at its initial state.
    path : Path
        Whose thrust acceleration is flown.
    field : GravityField
        The field to fly in.

    Returns
    -------
    Path
    """
    flown = replay(
        case.position_m,
        case.velocity_m_s,
        case.spacecraft.mass_kg,
        (path.leg,),
        rotation_rate_rad_s=case.asteroid.rotation_rate_rad_s,
        field=field,
        exhaust_velocity_m_s=case.spacecraft.exhaust_velocity_m_s,
        integrator="dop853",
    )
    at = np.clip(np.searchsorted(flown.t_s, path.t_s - 1e-9 * path.tof_s), 0, len(flown.t_s) - 1)
    return path_of(
        case,
        path.t_s,
        np.ascontiguousarray(flown.position_m[at]),
        np.ascontiguousarray(flown.velocity_m_s[at]),
        path.acceleration_m_s2,
        path.status,
        path.message,
        path.iterations,
    )


def _limits(case: ObserveCase, flown: Path, waypoints: Waypoints | None) -> dict[str, float]:
    """How far a flight misses what was asked."""
    clearance = flown.clearance_min_m
    found = {
        "touchdown_miss_m": math.dist(flown.position_m[-1], case.frame.origin_m),
        "touchdown_speed_m_s": float(np.linalg.norm(flown.velocity_m_s[-1])),
        "thrust_excess": flown.peak_thrust_n / case.spacecraft.thrust_max_n - 1.0,
        "depth_m": max(0.0, -clearance) if clearance == clearance else math.nan,
    }
    if waypoints is not None:
        passed = case.frame.to_site(positions_at(flown, waypoints.t_s))[:, :2]
        found["waypoint_miss_m"] = float(np.linalg.norm(passed - waypoints.position_m, axis=1).max())
    if case.clearance_m is not None:
        found["clearance_shortfall_m"] = case.clearance_m - clearance
    if case.glide_slope_half_angle_rad is not None:
        found["glide_slope_excess_rad"] = flown.glide_slope_max_rad - case.glide_slope_half_angle_rad
    return found


def _agreement(stored: ObservedPath, again: ObservedPath) -> dict[str, float]:
    """How far what is stored differs from what the flight shows."""
    path, flown = stored.path, again.path
    found = {
        "stored_path_m": float(np.linalg.norm(path.position_m - flown.position_m, axis=1).max()),
        "stored_performance_index": _off(path.performance_index_m2_s3, flown.performance_index_m2_s3),
        "stored_delta_v": _off(path.delta_v_m_s, flown.delta_v_m_s),
        "stored_propellant_mass_fraction": _off(
            path.propellant_mass_fraction, flown.propellant_mass_fraction
        ),
        "stored_peak_thrust": _off(path.peak_thrust_n, flown.peak_thrust_n),
    }
    if math.isfinite(path.clearance_min_m) or math.isfinite(flown.clearance_min_m):
        found["stored_clearance_m"] = abs(path.clearance_min_m - flown.clearance_min_m)
    visible, seen = stored.seen.visible, again.seen.visible
    found["stored_visible"] = float(np.mean(visible != seen)) if visible.shape == seen.shape else math.nan
    sigma, known = stored.sigma.position_sigma_m, again.sigma.position_sigma_m
    same = sigma.shape == known.shape
    found["stored_position_sigma"] = float(np.abs(sigma / known - 1.0).max()) if same else math.nan
    return found


def _off(stored: float, flown: float) -> float:
    return abs(stored / flown - 1.0)
