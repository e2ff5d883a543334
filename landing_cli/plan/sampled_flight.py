"""A control flown in the case's gravity, as even samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.acceleration_control import natural_accelerations, thrust_accelerations
from landing_cli.flight.bezier_curve import curve_states
from landing_cli.flight.legs import AccelerationLeg, BezierLeg
from landing_cli.flight.replay import replay
from landing_cli.flight.trajectory import Trajectory
from landing_cli.plan.records import CHECK_SAMPLES, PlanCase

FloatArray = NDArray[np.float64]


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
