"""What is delivered for a facet: its flight integrated accurately, and every limit checked on it.

The solver's path is second order in the interval. Here the stored thrust is flown by Runge-Kutta 4, the
final arc is recomputed in closed form from the handover that is really reached, so the landing is exact,
and the limits are measured on that flight.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from landing_cli.body.bvh import SurfaceIndex
from landing_cli.body.clearance import path_clearance
from landing_cli.body.gravity.field import GravityKind
from landing_cli.kernel import inlined, inner, kernel, part
from landing_cli.kernel_address import Callee, call
from landing_cli.kernel_lanes import WIDTH, lane
from landing_cli.kernel_record import by_reference
from landing_cli.reach.final_stage import ARC_SAMPLES, measure_arc
from landing_cli.reach.scaled_case import ScaledCase, least_between
from landing_cli.reach.shooting import Flights, fly_some, new_flights

_types: Any = types  # not typed

Floats = NDArray[np.float64]

# Limits are met when no scaled violation exceeds this: the last digits of the solver's convergence.
LIMIT_TOLERANCE = 1e-5
# Runge-Kutta steps in each interval of a delivered flight: over Eros two of them miss by half a millimetre,
# which shows as an angle just above the touchdown.
DELIVERY_SUBSTEPS = 4
# Terrain clearance is looked at along the path's chords this often, in mean edges.
CLEARANCE_SPACING = 1.0 / 40.0


@by_reference
class Frame(NamedTuple):
    """Physical facts of a case that the scaled problem does not carry."""

    mass_kg: float
    thrust_max_n: float
    exhaust_velocity_m_s: float
    descent_s: float
    final_stage_s: float
    rotation_rate_rad_s: float
    propellant_kg: float  # infinite when unbounded
    half_angle_rad: float
    clear_radius_m: float  # one mean edge


VALUE_COLUMNS = (
    "performance_index_m2_s3",
    "delta_v_m_s",
    "fuel_kg",
    "peak_thrust_ratio",
    "peak_thrust_ratio_descent",
    "peak_thrust_ratio_final",
    "ellipsoid_margin",
    "glide_slope_margin_deg",
    "terrain_clearance_min_m",
    "violation",
)


@by_reference
class Deliveries(NamedTuple):
    """What is delivered for every facet of a batch."""

    values: Floats  # (n, 10) by VALUE_COLUMNS
    handover: Floats  # (n, 7) position (m) and rotating-frame velocity (m/s), body axes; mass (kg)


def new_deliveries(size: int) -> Deliveries:
    """Return deliveries filled with NaN."""
    return Deliveries(np.full((size, len(VALUE_COLUMNS)), np.nan), np.full((size, 7), np.nan))


class Descent(NamedTuple):
    """What was measured on a flight before its final arc."""

    steps: int  # where the path's final arc begins
    energy_m2_s3: float
    peak: float  # largest thrust ratio
    margin: float  # least r' Re r - 1
    off_ellipsoid: float  # how far the handover is from where it has to be
    compensated: bool  # whether the thrust that is flown is bounded on the final arc, or m a*


@inner
def measure_landing(
    frame: Frame,
    surface: SurfaceIndex,
    kind: GravityKind,
    params: Floats,
    descent: Descent,
    handover: Floats,
    target_m: Floats,
    normal: Floats,
    path_m: Floats,
    values: Floats,
) -> None:
    """Fly the final arc in closed form and measure the whole landing.

    Parameters
    ----------
    frame, surface : Frame, SurfaceIndex
        Facts of the case, and the asteroid's surface.
    kind, params : GravityKind, (p,) float
        The gravity field.
    descent : Descent
        What is known already.
    handover : (7,) float
        See Deliveries.
    target_m, normal : (3,) float
        Touchdown point (m) and outward normal, body axes.
    path_m : (descent.steps + 1 + ARC_SAMPLES or more, 3) float
        The path in the body frame, m, up to the final arc, which is filled.
    values : (10,) float
        Filled; see Deliveries.
    """
    arc = measure_arc(
        handover,
        handover[6],
        target_m,
        normal,
        frame.final_stage_s,
        frame.rotation_rate_rad_s,
        frame.exhaust_velocity_m_s,
        kind,
        params,
        path_m[descent.steps :],
    )
    peak = descent.peak
    peak_final = arc.peak_thrust_n if descent.compensated else arc.peak_planned_thrust_n
    peak_final /= frame.thrust_max_n
    glide = frame.half_angle_rad - arc.glide_angle_rad
    fuel = frame.mass_kg - arc.touchdown_mass_kg
    excess = max(peak - 1.0, peak_final - 1.0, -descent.margin, -glide, descent.off_ellipsoid)
    excess = max(excess, fuel / frame.propellant_kg - 1.0)
    path = path_m[: descent.steps + 1 + ARC_SAMPLES]
    clearance, _facet = path_clearance(
        surface, path, frame.clear_radius_m, 1e-3, CLEARANCE_SPACING * frame.clear_radius_m
    )
    values[0] = descent.energy_m2_s3 + arc.energy_m2_s3
    values[1] = frame.exhaust_velocity_m_s * math.log(frame.mass_kg / arc.touchdown_mass_kg)
    values[2] = fuel
    values[3], values[4], values[5] = max(peak, peak_final), peak, peak_final
    values[6], values[7], values[8] = descent.margin, math.degrees(glide), clearance
    values[9] = excess if excess > LIMIT_TOLERANCE else 0.0


def measure_of(frame: Frame, surface: SurfaceIndex, kind: GravityKind, params: Floats) -> Callee:
    """Return `measure_landing` for these kinds of arguments."""
    descent, path, numbers = Descent(0, 0.0, 0.0, 0.0, 0.0, False), np.empty((1, 3)), np.empty(1)
    of_facet = descent, numbers, numbers, numbers, path, numbers
    return Callee(measure_landing, _types.none, frame, surface, kind, params, *of_facet)


@part
def _to_body(case: ScaledCase, flights: Flights, place: int, path_m: Floats) -> float:
    """Fill body-frame positions of a lane, m; return the least r' Re r - 1 of the descent."""
    least, before, middle = 1e9, 1e9, 1e9
    for row in range(flights.samples.shape[0]):
        c, s, sample = flights.cosine[row], flights.sine[row], flights.samples[row]
        at_x, at_y, z = lane(sample[0], place), lane(sample[1], place), lane(sample[2], place)
        x, y = c * at_x + s * at_y, c * at_y - s * at_x
        path_m[row, 0], path_m[row, 1], path_m[row, 2] = (
            x * case.length_m,
            y * case.length_m,
            z * case.length_m,
        )
        a, b, d = x * case.inverse_axes[0], y * case.inverse_axes[1], z * case.inverse_axes[2]
        level = a * a + b * b + d * d - 1.0
        if row > 0 and row % 2 == 0:
            least = min(least, least_between(before, middle, level))
        if row % 2 == 0:
            before = level
        else:
            middle = level
    return least


@inlined
def deliver(
    case: ScaledCase,
    frame: Frame,
    surface: SurfaceIndex,
    thrust: Floats,
    target_m: Floats,
    normal: Floats,
    flights: Flights,
    place: int,
    path_m: Floats,
    measure: Callee,
    values: Floats,
    handover: Floats,
) -> None:
    """Measure the flight of one facet's stored thrust.

    Parameters
    ----------
    case, frame, surface : ScaledCase, Frame, SurfaceIndex
        The case and the asteroid's surface.
    thrust : (N, 3) float
        Scaled thrust, constant within each interval, solver axes.
    target_m, normal : (3,) float
        Touchdown point (m) and outward normal, body axes.
    flights : Flights
        Flown with that thrust,
    place : int
        in this lane.
    path_m : (N DELIVERY_SUBSTEPS + 1 + ARC_SAMPLES, 3) float
        Filled with the path from start to touchdown, body frame, m.
    measure : Callee
        See measure_of.
    values, handover : (10,) float, (7,) float
        Filled; see Deliveries.
    """
    n, steps = thrust.shape[0], flights.samples.shape[0] - 1
    margin, end = _to_body(case, flights, place, path_m), np.empty(7)
    for i in range(7):
        end[i] = lane(flights.samples[steps, i], place)
    speed = case.length_m / frame.descent_s
    for i in range(3):
        handover[i] = end[i] * case.length_m
    handover[3] = (end[3] + case.spin * end[1]) * speed
    handover[4] = (end[4] - case.spin * end[0]) * speed
    handover[5] = end[5] * speed
    off_ellipsoid = 0.0
    if case.on_ellipsoid:
        for i in range(3):
            off_ellipsoid += (end[i] * case.inverse_axes[i]) ** 2
        off_ellipsoid = abs(off_ellipsoid - 1.0)
        rising = 0.0
        for i in range(3):
            rising += handover[i] * handover[3 + i] * case.inverse_axes[i] ** 2
        off_ellipsoid = max(off_ellipsoid, rising * frame.descent_s / case.length_m**2)
    energy = peak = 0.0
    for k in range(n):
        square = thrust[k, 0] ** 2 + thrust[k, 1] ** 2 + thrust[k, 2] ** 2
        energy += 0.5 * square / n
        peak = max(peak, math.sqrt(square))
    handover[6] = end[6] * frame.mass_kg
    descent = Descent(
        steps,
        energy * case.acceleration_m_s2**2 * frame.descent_s,
        peak,
        margin,
        off_ellipsoid,
        case.compensated,
    )
    field = case.gravity_kind, case.gravity_params
    call(measure, (frame, surface, *field, descent, handover, target_m, normal, path_m, values))


def deliver_many(
    case: ScaledCase,
    frame: Frame,
    surface: SurfaceIndex,
    thrusts: Floats,
    targets_m: Floats,
    normals: Floats,
    out: Deliveries,
) -> None:
    """Deliver a batch of facets; see :func:`deliver`."""
    flights = new_flights(case, DELIVERY_SUBSTEPS)
    measure = measure_of(frame, surface, case.gravity_kind, case.gravity_params)
    fill_deliveries(case, frame, surface, thrusts, targets_m, normals, flights, measure, out)


@kernel
def fill_deliveries(
    case: ScaledCase,
    frame: Frame,
    surface: SurfaceIndex,
    thrusts: Floats,
    targets_m: Floats,
    normals: Floats,
    flights: Flights,
    measure: Callee,
    out: Deliveries,
) -> None:
    """Deliver a batch of facets, as many together as there are lanes; see :func:`deliver`."""
    path_m = np.empty((flights.samples.shape[0] + ARC_SAMPLES, 3))
    for first in range(0, thrusts.shape[0], WIDTH):
        fly_some(case, thrusts, first, flights)
        for place in range(min(WIDTH, thrusts.shape[0] - first)):
            i = first + place
            deliver(
                case,
                frame,
                surface,
                thrusts[i],
                targets_m[i],
                normals[i],
                flights,
                place,
                path_m,
                measure,
                out.values[i],
                out.handover[i],
            )
