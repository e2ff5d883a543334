"""Whether a stored plan does what it says: its control flown again, every limit checked on the flight.

The control is flown open loop, in the gravity it was planned in, by scipy's DOP853, which plans nothing. The
same control under the gravity of the mesh as a uniform polyhedron shows the error of the gravity model; that
fails nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import closing
from functools import partial
from typing import Literal

import numpy as np

from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.flight.replay import replay
from landing_cli.flight.trajectory import Trajectory
from landing_cli.parallel import LostChunk, WorkPlan, run_chunks
from landing_cli.plan.assess import Measured, measure_trajectory
from landing_cli.plan.records import CHECK_SAMPLES, Plan, PlanCase
from landing_cli.plan.sampled_flight import accelerations_at, at_times
from landing_cli.plan.stored import PlanEntry
from landing_cli.results.verification import Check, FieldReport

POLYHEDRON_PLANS = 20
"""Plans that fly under the polyhedron unless all do: a flight takes seconds on a large mesh."""

# What a flight may miss, exceed or differ by at most.
LIMITS: Mapping[str, float] = {
    "touchdown_miss_m": 0.05,
    "touchdown_speed_m_s": 1e-3,  # off the landing velocity
    "thrust_excess": 2e-5,  # over the bound, relative
    "clearance_shortfall_m": 0.01,
    "depth_in_cone_m": 0.01,
    "propellant_excess_kg": 1e-4,
    "stored_path_m": 0.05,
    "stored_fuel": 2e-5,  # relative
    "stored_peak_thrust": 2e-5,  # relative
    "stored_clearance_m": 0.05,
    "stored_cone_entry": 2.0,  # samples
}


def verify_run(
    entries: tuple[PlanEntry, ...],
    *,
    polyhedron_for_all: bool = False,
    jobs: int = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[FieldReport, ...]:
    """Fly every plan again and check what is said about it.

    Parameters
    ----------
    entries : tuple of PlanEntry
        Plans of one run, at least one.
    polyhedron_for_all : bool
        Fly every plan under the polyhedron too, not an evenly spaced sample.
    jobs : int
        Threads.
    progress : callable
        Told (flown, total) plans.

    Returns
    -------
    tuple of FieldReport
        One a plan.
    """
    asteroid = entries[0].case.asteroid
    polyhedron = polyhedron_field(asteroid.mesh.vertices, asteroid.mesh.faces, asteroid.gm_m3_s2)
    count = len(entries)
    sample = range(count)
    if not polyhedron_for_all:
        sample = np.unique(
            np.linspace(0, count - 1, min(count, POLYHEDRON_PLANS)).round().astype(int)
        ).tolist()
    work = partial(_verify_at, entries, polyhedron, frozenset(sample))
    reports: dict[int, FieldReport] = {}
    with closing(run_chunks(work, [[index] for index in range(count)], WorkPlan(jobs=jobs))) as coming:
        for index, report in coming:
            assert not isinstance(report, LostChunk)  # threads lose nothing
            reports[index] = report
            progress(len(reports), count)
    return tuple(reports[index] for index in range(count))


def _verify_at(
    entries: tuple[PlanEntry, ...], polyhedron: GravityField, sample: frozenset[int], chunk: list[int]
) -> FieldReport:
    index = chunk[0]
    return verify_entry(entries[index], polyhedron if index in sample else None)


def verify_entry(
    entry: PlanEntry,
    polyhedron: GravityField | None = None,
    integrator: Literal["dop853", "gauss"] = "dop853",
) -> FieldReport:
    """Fly one plan again and check what is said about it.

    Parameters
    ----------
    entry : PlanEntry
        The plan and what was asked.
    polyhedron : GravityField, optional
        A field to fly it in too.
    integrator : {"dop853", "gauss"}
        Of the re-flight.

    Returns
    -------
    FieldReport
    """
    case, plan = entry.case, entry.plan
    fault = fault_of(entry)
    if fault or plan.status != "planned":
        return FieldReport(entry.name, plan.status, False, {}, fault, None)
    flown = measure_trajectory(case, *fly(case, plan, integrator))
    miss = None
    if polyhedron is not None and case.asteroid.gravity.kind is not GravityKind.POLYHEDRON:
        end = _flight(case, plan, polyhedron, "gauss").position_m[-1]
        miss = math.dist(end, case.site.position_m)
    return FieldReport(entry.name, plan.status, True, _checks(entry, flown), "", miss)


def fault_of(entry: PlanEntry) -> str:
    """Say what cannot be true in a plan's record; empty where nothing is.

    Parameters
    ----------
    entry : PlanEntry
        The plan and what was asked.

    Returns
    -------
    str
    """
    case, plan = entry.case, entry.plan
    if plan.status == "planned" and not plan.control:
        return "it is planned, but has no control"
    if plan.status != "planned" and not plan.message:
        return f"it is {plan.status}, but does not say why"
    if not plan.control:
        return ""
    total = math.fsum(leg.duration_s for leg in plan.control)
    if abs(total - case.tof_s) > 1e-6 * case.tof_s or abs(plan.tof_s - case.tof_s) > 1e-6 * case.tof_s:
        return f"its control lasts {total:.9g} s, its time of flight is {case.tof_s:.9g} s"
    return ""


def fly(case: PlanCase, plan: Plan, integrator: Literal["dop853", "gauss"]) -> tuple[Trajectory, float]:
    """Integrate a plan's control in its own gravity and sample the flight.

    Parameters
    ----------
    case : PlanCase
        What was asked.
    plan : Plan
        With a control.
    integrator : {"dop853", "gauss"}
        Which one flies it.

    Returns
    -------
    Trajectory
        `CHECK_SAMPLES` samples.
    float
        Velocity increment, m/s.
    """
    flown = _flight(case, plan, case.asteroid.gravity, integrator)
    t = np.linspace(0.0, flown.t_s[-1], CHECK_SAMPLES)
    r, v = at_times(flown, t)
    u = accelerations_at(plan.control, t, case.asteroid.rotation_rate_rad_s)
    craft = case.spacecraft
    spent = craft.exhaust_velocity_m_s * np.log(craft.mass_kg / flown.mass_kg)
    mass = np.interp(t, flown.t_s, flown.mass_kg)
    if case.mass_model == "constant":
        mass = np.full(len(t), craft.mass_kg)
    return Trajectory(t, r, v, mass, mass[:, None] * u), float(spent[-1])


def _flight(
    case: PlanCase, plan: Plan, field: GravityField, integrator: Literal["dop853", "gauss"]
) -> Trajectory:
    return replay(
        case.position_m,
        case.velocity_m_s,
        case.spacecraft.mass_kg,
        plan.control,
        rotation_rate_rad_s=case.asteroid.rotation_rate_rad_s,
        field=field,
        exhaust_velocity_m_s=case.spacecraft.exhaust_velocity_m_s,
        integrator=integrator,
    )


def _checks(entry: PlanEntry, flown: Measured) -> dict[str, Check]:
    case, plan, path = entry.case, entry.plan, flown.trajectory
    surface = case.clearance_metric == "surface"
    clearance = flown.clearance_surface_m if surface else flown.clearance_vertices_m
    propellant = case.spacecraft.propellant_kg
    found = {
        "touchdown_miss_m": math.dist(path.position_m[-1], case.site.position_m),
        "touchdown_speed_m_s": math.dist(path.velocity_m_s[-1], case.landing_velocity_m_s),
        "thrust_excess": flown.peak_thrust_n / case.spacecraft.thrust_max_n - 1.0,
        "clearance_shortfall_m": case.clearance_m - clearance if flown.entry > 0 else 0.0,
        "depth_in_cone_m": flown.depth_in_cone_m,
        "propellant_excess_kg": 0.0 if propellant is None else flown.fuel_kg - propellant,
        "stored_fuel": abs(flown.fuel_kg / plan.fuel_kg - 1.0),
        "stored_peak_thrust": abs(flown.peak_thrust_n / plan.peak_thrust_n - 1.0),
        "stored_clearance_m": abs(clearance - plan.clearance_min_m),
        "stored_cone_entry": abs(path.t_s[flown.entry] - plan.cone_entry_s) / (path.t_s[1] - path.t_s[0]),
    }
    stored = plan.trajectory
    if stored is not None and len(stored.t_s) == len(path.t_s):
        found["stored_path_m"] = float(np.linalg.norm(stored.position_m - path.position_m, axis=1).max())
    return {name: Check(float(value), LIMITS[name]) for name, value in found.items()}
