"""The nominal landing: energy-optimal guidance, flown closed loop (Shen 2026, section 1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.flight.dynamics import natural_acceleration
from landing_cli.flight.energy_guidance import (
    GuidedFlight,
    fly_closed_loop,
    fly_for,
    least_cost_duration,
)
from landing_cli.flight.field_along import field_along
from landing_cli.flight.linear_arcs import frame_slopes
from landing_cli.observe.observed import Path
from landing_cli.observe.path_values import path_of
from landing_cli.observe.records import ObserveCase, PathStatus

FloatArray = NDArray[np.float64]

CYCLE_S = 2.0
"""Guidance cycle: the paper's time step."""
_INTERVALS = 400
_QUADRATURE = np.polynomial.legendre.leggauss(4)


def nominal_path(case: ObserveCase) -> Path:
    """Fly the guidance from the initial state to the site.

    Parameters
    ----------
    case : ObserveCase
        What is asked; its ``time_of_flight`` says whether t_f is given, solved for in every cycle, or the one
        of least J.

    Returns
    -------
    Path
        Its thrust acceleration is the linear interpolant that is closest to the flown one in the integral of
        the squared difference: the impulse and its first moment agree, so it lands as the law does.

    Raises
    ------
    InputRefused
        Nothing acts on the spacecraft at the start, so that no time to go follows from eq 3.
    """
    flight = guided_flight(case)
    times = _node_times(flight)
    r, v, _ = flight.states(times)
    status: PathStatus = "planned" if flight.arrived else "unresolved"
    message = f"flown in {flight.duration_s:.1f} s"
    if not flight.arrived:
        message = f"the time to go does not run out: {flight.to_go_s[-1]:.0f} s are left after "
        message += f"{flight.start_s[-1]:.0f} s"
    u = _closest_linear(times, *_thrust_between(case, flight, times))
    return path_of(case, times, r, v, u, status, message, len(flight.start_s))


def guided_flight(case: ObserveCase) -> GuidedFlight:
    """Fly the guidance by the case's choice of time of flight.

    Parameters
    ----------
    case : ObserveCase
        What is asked.

    Returns
    -------
    GuidedFlight

    Raises
    ------
    InputRefused
        Nothing acts on the spacecraft at the start, so that no time to go follows from eq 3.
    """
    asteroid, site = case.asteroid, case.frame.origin_m
    field, w = asteroid.gravity, asteroid.rotation_rate_rad_s
    state = (case.position_m, case.velocity_m_s)
    if case.time_of_flight == "fixed":
        return fly_for(*state, site, case.tof_s)
    if case.time_of_flight == "search":
        return fly_for(*state, site, least_cost_duration(field, w, *state, site, case.tof_range_s))
    if not np.any(natural_acceleration(field.kind, field.params, w, *state[0], *state[1])):
        raise InputRefused(
            "gravity and rotation balance at the start, so that no time to go follows from them",
            where=case.name,
            fix="give the time of flight, or search it",
        )
    return fly_closed_loop(field, w, *state, site, CYCLE_S)


def _node_times(flight: GuidedFlight) -> FloatArray:
    """Nodes: the guidance cycles and even parts of the last cubic."""
    parts = _INTERVALS if len(flight.start_s) == 1 else 4
    last = np.linspace(flight.start_s[-1], flight.duration_s, parts + 1)
    return np.concatenate([flight.start_s[:-1], last])


def _thrust_between(
    case: ObserveCase, flight: GuidedFlight, times: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Shares of every interval (4,) and the flown thrust acceleration there, (n, 4, 3), m/s2."""
    share = 0.5 * (_QUADRATURE[0] + 1.0)
    t = (times[:-1, None] + share * np.diff(times)[:, None]).ravel()
    r, v, a = flight.states(t)
    edges = np.linspace(times[0], times[-1], 3)
    g, _ = field_along(case.asteroid.gravity, lambda at: flight.states(at)[0], edges, t)
    by_v, by_r = frame_slopes(case.asteroid.rotation_rate_rad_s)
    u = a - g - r @ by_r.T - v @ by_v.T
    return share, u.reshape(len(times) - 1, len(share), 3)


def _closest_linear(times: FloatArray, share: FloatArray, values: FloatArray) -> FloatArray:
    """Node values of the piecewise linear function closest to one sampled at Gauss points, (n + 1, 3)."""
    from scipy.linalg import solveh_banded

    h, weight = np.diff(times), 0.5 * _QUADRATURE[1]
    right = np.zeros((len(times), 3))
    right[:-1] += h[:, None] * np.einsum("q,nqc->nc", weight * (1.0 - share), values)
    right[1:] += h[:, None] * np.einsum("q,nqc->nc", weight * share, values)
    matrix = np.zeros((2, len(times)))
    matrix[0] = (np.append(h, 0.0) + np.append(0.0, h)) / 3.0
    matrix[1, :-1] = h / 6.0
    return np.asarray(solveh_banded(matrix, right, lower=True))
