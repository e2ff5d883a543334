"""The Bezier curve that bends a landing towards the landmarks, and the waypoints on it.

Shen 2026, section 2.2. Departures: its eq 7 counts n control points where the sum has n + 1 (degree n), and
its eq 14 asks for R_B at t_i where the path's own x, y are meant. With ``paper`` the ends are control points
once (eq 10): the curve then leaves and arrives with n (P_1 - P_0) / t_f and n (P_n - P_{n-1}) / t_f, which
clash with the velocities asked for, and the cost grows with every waypoint,
dJ/dm -> 2 sqrt(3) (|dv_0|^2 + |dv_f|^2) / t_f. With ``velocity_matched`` two more control points give the
curve the velocities of the ends.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.flight.bezier_curve import bezier_basis
from landing_cli.observe.observed import Waypoints
from landing_cli.observe.records import ObserveCase, SteeringOptions, WaypointTiming

FloatArray = NDArray[np.float64]


def waypoints_of(
    case: ObserveCase, control_points_m: ArrayLike, tof_s: float, options: SteeringOptions
) -> Waypoints:
    """Place the waypoints of a case.

    Parameters
    ----------
    case : ObserveCase
        Its start, velocity and site frame.
    control_points_m : (c, 2) float, m, site frame x, y
        Inner control points in the order of flight; none leaves a curve between the ends alone.
    tof_s : float, s
        t_f.
    options : SteeringOptions
        How many waypoints, and their timing.

    Returns
    -------
    Waypoints
    """
    start = case.frame.to_site(case.position_m)[:2]
    velocity = (case.frame.axes @ case.velocity_m_s)[:2]
    curve = curve_points(control_points_m, start, velocity, tof_s, options.timing)
    t_s, position = equal_time_waypoints(curve, tof_s, options.waypoints)
    return Waypoints(t_s, position, curve, options.timing)


def curve_points(
    inner_m: ArrayLike, start_m: ArrayLike, velocity_m_s: ArrayLike, tof_s: float, timing: WaypointTiming
) -> FloatArray:
    """Control points of the whole curve, from the start to rest at the site (eq 10).

    Parameters
    ----------
    inner_m : (c, 2) float, m, site frame x, y
        Inner control points in the order of flight.
    start_m, velocity_m_s : (2,) float, m, m/s, site frame x, y
        Initial state, projected.
    tof_s : float, s
        t_f.
    timing : {"paper", "velocity_matched"}
        Whether the ends stand once, or again displaced so that the curve has their velocities.

    Returns
    -------
    (c + 2, 2) or (c + 4, 2) float, m
    """
    inner = np.asarray(inner_m, dtype=np.float64).reshape(-1, 2)
    start, site = np.asarray(start_m, dtype=np.float64), np.zeros(2)
    if timing == "paper":
        return np.concatenate([start[None], inner, site[None]])
    degree = len(inner) + 3
    after = start + np.asarray(velocity_m_s, dtype=np.float64) * tof_s / degree
    return np.concatenate([start[None], after[None], inner, site[None], site[None]])


def equal_time_waypoints(curve_m: FloatArray, tof_s: float, count: int) -> tuple[FloatArray, FloatArray]:
    """Points of the curve at t_i = i t_f / (m + 1), i = 1 ... m (eqs 9, 11, 12).

    Parameters
    ----------
    curve_m : (n + 1, 2) float, m
        Control points.
    tof_s : float, s
        t_f.
    count : int
        m.

    Returns
    -------
    t_s : (m,) float, s
    position_m : (m, 2) float, m
    """
    eta = np.arange(1, count + 1) / (count + 1)
    return eta * tof_s, np.asarray(bezier_basis(len(curve_m) - 1, eta) @ curve_m)
