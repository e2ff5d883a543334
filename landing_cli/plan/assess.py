"""One yardstick for every method: a control flown, measured, and held against the case's constraints."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.clearance import TOUCHDOWN_TOLERANCE_M
from landing_cli.flight.acceleration_control import natural_accelerations, thrust_accelerations
from landing_cli.flight.bezier_curve import curve_states
from landing_cli.flight.legs import AccelerationLeg, BezierLeg
from landing_cli.flight.replay import replay
from landing_cli.flight.trajectory import Trajectory
from landing_cli.plan.path_check import least_distance
from landing_cli.plan.records import CHECK_SAMPLES, Parameter, Plan, PlanCase, PlanStatus

FloatArray = NDArray[np.float64]

# what an optimiser's active constraint may be off by
THRUST_TOLERANCE = 2e-5  # relative
CLEARANCE_TOLERANCE_M = 1e-3
CONE_TOLERANCE_RAD = 1e-4
TOUCHDOWN_MISS_M, TOUCHDOWN_SPEED_M_S = 0.05, 1e-3
PROPELLANT_TOLERANCE_KG = 1e-6
ANGLE_BEFORE_S = 1.0  # the paper reads its landing angle this long before touchdown


@dataclass(frozen=True, eq=False)
class Measured:
    """A flown path, measured.

    Attributes
    ----------
    trajectory : Trajectory
        Even samples.
    depth_in_cone_m : float, m
        How far the deepest sample after the entry lies below the surface; negative where all lie above it.
    deepest, closest : int
        That sample, and the one closest to the surface before the entry.
    cone_angle_rad : (n,) float, rad
        Angle from the touchdown between n_f and every sample; 0 within `TOUCHDOWN_MISS_M` of it.
    entry : int
        First of the samples that lie in the cone up to touchdown.
    fuel_kg, delta_v_m_s, peak_thrust_n : float
    clearance_surface_m, clearance_vertices_m : float, m
        Least distance up to the entry.
    landing_angle_deg : float, deg
    """

    trajectory: Trajectory
    depth_in_cone_m: float
    deepest: int
    closest: int
    cone_angle_rad: FloatArray
    entry: int
    fuel_kg: float
    delta_v_m_s: float
    peak_thrust_n: float
    clearance_surface_m: float
    clearance_vertices_m: float
    landing_angle_deg: float

    @property
    def cone_entry_s(self) -> float:
        """Time from which the path stays in the cone, s."""
        return float(self.trajectory.t_s[self.entry])


def plan_of(
    case: PlanCase,
    method: str,
    control: Sequence[AccelerationLeg],
    *,
    iterations: int,
    parameters: Mapping[str, Parameter],
    otherwise: PlanStatus = "unresolved",
    because: str = "",
) -> Plan:
    """Fly and measure a control, and make the method's answer of it.

    Parameters
    ----------
    case : PlanCase
        What was asked.
    method : str
        Name of the method.
    control : sequence of AccelerationLeg
        Its control.
    iterations : int
        What it took.
    parameters : mapping
        The method's own choices.
    otherwise : {"infeasible", "unresolved"}
        Status where the path breaks a constraint.
    because : str
        What the method knows about why, put before what is broken.

    Returns
    -------
    Plan
        ``planned`` where the path keeps every constraint at all `CHECK_SAMPLES` samples.
    """
    measured = measure(case, control)
    broken = broken_constraints(case, measured)
    told = "; ".join([because, *broken] if because and broken else broken)
    return Plan(
        method=method,
        status=otherwise if broken else "planned",
        message=told or "every constraint holds at all samples",
        trajectory=measured.trajectory,
        control=tuple(control),
        tof_s=case.tof_s,
        fuel_kg=measured.fuel_kg,
        delta_v_m_s=measured.delta_v_m_s,
        peak_thrust_n=measured.peak_thrust_n,
        clearance_surface_m=measured.clearance_surface_m,
        clearance_vertices_m=measured.clearance_vertices_m,
        landing_angle_deg=measured.landing_angle_deg,
        cone_entry_s=measured.cone_entry_s,
        iterations=iterations,
        clearance_metric=case.clearance_metric,
        parameters=dict(parameters),
    )


def no_plan(
    case: PlanCase,
    method: str,
    status: PlanStatus,
    message: str,
    *,
    iterations: int = 0,
    parameters: Mapping[str, Parameter] | None = None,
) -> Plan:
    """Make the answer of a method that has no path to show.

    Parameters
    ----------
    case : PlanCase
        What was asked.
    method : str
        Name of the method.
    status : {"infeasible", "unresolved"}
        What is known.
    message : str
        Why, in the analyst's words.
    iterations : int
        What it took.
    parameters : mapping, optional
        The method's own choices.

    Returns
    -------
    Plan
    """
    nan = math.nan
    return Plan(
        method=method,
        status=status,
        message=message,
        trajectory=None,
        control=(),
        tof_s=case.tof_s,
        fuel_kg=nan,
        delta_v_m_s=nan,
        peak_thrust_n=nan,
        clearance_surface_m=nan,
        clearance_vertices_m=nan,
        landing_angle_deg=nan,
        cone_entry_s=nan,
        iterations=iterations,
        clearance_metric=case.clearance_metric,
        parameters=dict(parameters or {}),
    )


def measure(case: PlanCase, control: Sequence[AccelerationLeg]) -> Measured:
    """Fly a control in the case's gravity and measure the path.

    Parameters
    ----------
    case : PlanCase
        What was asked.
    control : sequence of AccelerationLeg
        Leg after leg; together they last the time of flight.

    Returns
    -------
    Measured
        At `CHECK_SAMPLES` even times. Angles are seen from where the path itself ends, which may be off the
        site by no more than `TOUCHDOWN_MISS_M`: close to touchdown the miss would turn them.
    """
    trajectory, delta_v = sampled_flight(case, control)
    return measure_trajectory(case, trajectory, delta_v)


def measure_trajectory(case: PlanCase, trajectory: Trajectory, delta_v_m_s: float) -> Measured:
    """Measure a sampled path.

    Parameters
    ----------
    case : PlanCase
        What was asked.
    trajectory : Trajectory
        Samples of the path, touchdown last.
    delta_v_m_s : float, m/s
        Its velocity increment.

    Returns
    -------
    Measured
    """
    path, craft = trajectory.position_m, case.spacecraft
    offset = path - path[-1]
    angle = _angles(offset, case.site.normal)
    angle[np.linalg.norm(offset, axis=1) < TOUCHDOWN_MISS_M] = 0.0  # closer than a miss that is forgiven
    outside = np.flatnonzero(angle[:-1] > case.cone_half_angle_rad + CONE_TOLERANCE_RAD)
    entry = int(outside[-1]) + 1 if len(outside) else 0
    before = max(entry, 1)
    to_surface, closest = least_distance(case.surface, False, path, 0, before)
    in_cone, deepest = least_distance(case.surface, False, path, entry, len(path))
    ratio = 1.0 - math.exp(-delta_v_m_s / craft.exhaust_velocity_m_s)
    spent = delta_v_m_s / craft.exhaust_velocity_m_s if case.mass_model == "constant" else ratio
    return Measured(
        trajectory=trajectory,
        depth_in_cone_m=-in_cone,
        deepest=deepest,
        closest=closest,
        cone_angle_rad=angle,
        entry=entry,
        fuel_kg=craft.mass_kg * spent,
        delta_v_m_s=delta_v_m_s,
        peak_thrust_n=float(np.linalg.norm(trajectory.thrust_n, axis=1).max()),
        clearance_surface_m=to_surface,
        clearance_vertices_m=least_distance(case.surface, True, path, 0, before)[0],
        landing_angle_deg=_landing_angle_deg(trajectory, case.site.normal),
    )


def sampled_flight(
    case: PlanCase, control: Sequence[AccelerationLeg], samples: int = CHECK_SAMPLES
) -> tuple[Trajectory, float]:
    """Fly a control in the case's gravity.

    Parameters
    ----------
    case : PlanCase
        What was asked.
    control : sequence of AccelerationLeg
        Leg after leg.
    samples : int
        How many, even in time.

    Returns
    -------
    Trajectory
        Of that many samples; a Bezier curve is evaluated, anything else is integrated. With the constant
        mass model its mass stays the initial one.
    float
        Velocity increment, m/s.
    """
    craft = case.spacecraft
    t = np.linspace(0.0, case.tof_s, samples)
    if len(control) == 1 and isinstance(control[0], BezierLeg):
        r, v, u, spent = _on_curve(case, control[0], t)
    else:
        r, v, u, spent = _integrated(case, control, t)
    mass = craft.mass_kg * np.exp(-spent / craft.exhaust_velocity_m_s)
    if case.mass_model == "constant":
        mass = np.full(samples, craft.mass_kg)
    return Trajectory(t, r, v, mass, mass[:, None] * u), float(spent[-1])


def broken_constraints(case: PlanCase, measured: Measured) -> list[str]:
    """Say which constraints a measured path breaks, and by how much.

    Parameters
    ----------
    case : PlanCase
        What was asked.
    measured : Measured
        The path.

    Returns
    -------
    list of str
        In the analyst's words; empty where every constraint holds.
    """
    told = [*_missed(case, measured), *_over_thrust(case, measured), *_too_close(case, measured)]
    propellant = case.spacecraft.propellant_kg
    if propellant is not None and measured.fuel_kg > propellant + PROPELLANT_TOLERANCE_KG:
        told.append(f"it burns {measured.fuel_kg:.2f} kg of the {propellant:g} kg on board")
    return told


def _missed(case: PlanCase, measured: Measured) -> list[str]:
    path = measured.trajectory
    told = []
    miss = math.dist(path.position_m[-1], case.site.position_m)
    speed = math.dist(path.velocity_m_s[-1], case.landing_velocity_m_s)
    if not miss <= TOUCHDOWN_MISS_M:
        told.append(f"it ends {miss:.3g} m from the site")
    if not speed <= TOUCHDOWN_SPEED_M_S:
        told.append(f"it touches down {speed:.3g} m/s off the landing velocity")
    return told


def _over_thrust(case: PlanCase, measured: Measured) -> list[str]:
    bound = case.spacecraft.thrust_max_n
    if measured.peak_thrust_n <= bound * (1.0 + THRUST_TOLERANCE):
        return []
    return [f"it needs {measured.peak_thrust_n:.4g} N at {case.tof_s:.6g} s; the thruster gives {bound:g} N"]


def _too_close(case: PlanCase, measured: Measured) -> list[str]:
    told = []
    surface = case.clearance_metric == "surface"
    clearance = measured.clearance_surface_m if surface else measured.clearance_vertices_m
    entry, t = measured.entry, measured.trajectory.t_s
    if entry > 0 and not clearance >= case.clearance_m - CLEARANCE_TOLERANCE_M:
        what = "the surface" if surface else "the nearest vertex"
        late = f" (t = {t[measured.closest]:.1f} s)" if surface else ""
        told.append(
            f"it comes within {clearance:.4g} m of {what} before the cone{late}: {case.clearance_m:g} m asked"
        )
    depth = measured.depth_in_cone_m
    if depth > TOUCHDOWN_TOLERANCE_M:
        late = f"t = {t[measured.deepest]:.1f} s"
        told.append(f"it cuts {depth:.4g} m into the surface inside the cone ({late})")
    return told


def at_times(flown: Trajectory, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Position and velocity between the knots of an integration, on cubics through both.

    Parameters
    ----------
    flown : Trajectory
        An integrator's steps.
    t : (n,) float, s
        Times within it.

    Returns
    -------
    r, v : (n, 3) float, m, m/s
        Off by jerk rate times step^4 / 384: micrometres for steps of some seconds.
    """
    k = np.clip(np.searchsorted(flown.t_s, t, side="right") - 1, 0, len(flown.t_s) - 2)
    h = (flown.t_s[k + 1] - flown.t_s[k])[:, None]
    s = ((t - flown.t_s[k])[:, None]) / h
    r0, r1 = flown.position_m[k], flown.position_m[k + 1]
    d0, d1 = h * flown.velocity_m_s[k], h * flown.velocity_m_s[k + 1]
    square, cubic = 3.0 * (r1 - r0) - 2.0 * d0 - d1, d0 + d1 - 2.0 * (r1 - r0)
    return r0 + s * (d0 + s * (square + s * cubic)), (d0 + s * (2.0 * square + 3.0 * s * cubic)) / h


def _on_curve(
    case: PlanCase, leg: BezierLeg, t: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """States, thrust acceleration and velocity increment up to each time, along a Bezier curve."""
    r, v, a = curve_states(leg.points_m, leg.duration_s, t / leg.duration_s)
    u = np.zeros_like(r)
    field = case.asteroid.gravity
    natural_accelerations(field.kind, field.params, case.asteroid.rotation_rate_rad_s, r, v, u)
    u = a - u
    return r, v, u, _cumulative(np.linalg.norm(u, axis=1), t[1] - t[0])


def _integrated(
    case: PlanCase, control: Sequence[AccelerationLeg], t: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """States, thrust acceleration and velocity increment up to each time, by the order-8 integrator."""
    craft, w = case.spacecraft, case.asteroid.rotation_rate_rad_s
    flown = replay(
        case.position_m,
        case.velocity_m_s,
        craft.mass_kg,
        control,
        rotation_rate_rad_s=w,
        field=case.asteroid.gravity,
        exhaust_velocity_m_s=craft.exhaust_velocity_m_s,
        integrator="gauss",
    )
    spent = craft.exhaust_velocity_m_s * np.log(craft.mass_kg / flown.mass_kg)
    r, v = at_times(flown, t)
    return r, v, accelerations_at(control, t, w), np.interp(t, flown.t_s, spent)


def accelerations_at(control: Sequence[AccelerationLeg], t: FloatArray, w: float) -> FloatArray:
    """Thrust acceleration of a control at any times.

    Parameters
    ----------
    control : sequence of AccelerationLeg
        Leg after leg.
    t : (n,) float, s
        Times since the start of the first.
    w : float, rad/s
        Spin rate.

    Returns
    -------
    (n, 3) float, m/s2, rotating body frame
    """
    starts = np.concatenate([[0.0], np.cumsum([leg.duration_s for leg in control])])
    owner = np.clip(np.searchsorted(starts, t, side="right") - 1, 0, len(control) - 1)
    u = np.zeros((len(t), 3))
    for index, leg in enumerate(control):
        own = owner == index
        u[own] = thrust_accelerations(leg, np.clip(t[own] - starts[index], 0.0, leg.duration_s), w)
    return u


def _cumulative(values: FloatArray, step: float) -> FloatArray:
    """Integral from the first of even samples up to each, by the cubics through four neighbours."""
    inner = (13.0 * (values[1:-2] + values[2:-1]) - values[:-3] - values[3:]) / 24.0
    first = (9.0 * values[0] + 19.0 * values[1] - 5.0 * values[2] + values[3]) / 24.0
    last = (9.0 * values[-1] + 19.0 * values[-2] - 5.0 * values[-3] + values[-4]) / 24.0
    return step * np.concatenate([[0.0], np.cumsum(np.concatenate([[first], inner, [last]]))])


def _angles(offset: FloatArray, normal: FloatArray) -> FloatArray:
    """Angle between a normal and every offset, (n,) float, rad; 0 where there is no offset."""
    along = offset @ normal
    across = np.linalg.norm(offset - along[:, None] * normal, axis=1)
    return np.arctan2(across, along)


def _landing_angle_deg(trajectory: Trajectory, normal: FloatArray) -> float:
    end_s = trajectory.t_s[-1]
    r, _ = at_times(trajectory, np.array([max(end_s - ANGLE_BEFORE_S, 0.0)]))
    return math.degrees(float(_angles(r - trajectory.position_m[-1], normal)[0]))
