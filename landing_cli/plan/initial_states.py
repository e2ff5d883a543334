"""Initial states of a sweep: one state, turned about the spin axis (Lyu 2026, section 3.3)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.dynamics import about_z
from landing_cli.plan.records import PlanCase

FloatArray = NDArray[np.float64]


def even_longitudes(count: int) -> FloatArray:
    """Longitudes even over the circle, from 0, (count,) float, deg."""
    return np.arange(count) * 360.0 / count


def turned_cases(case: PlanCase, longitudes_deg: Iterable[float]) -> tuple[PlanCase, ...]:
    """Turn a case's initial state about the spin axis.

    Parameters
    ----------
    case : PlanCase
        Its position, velocity and acceleration are turned together; the paper's ten starts on the 35 km
        circle are the nominal one turned so.
    longitudes_deg : iterable of float, deg
        Longitudes of the initial positions in the body frame.

    Returns
    -------
    tuple of PlanCase
        Named by longitude.
    """
    x, y, _ = case.position_m
    own = math.atan2(y, x)
    cases = []
    for longitude in longitudes_deg:
        angle = math.radians(longitude) - own
        r, v, a = (
            about_z(angle, vector) for vector in (case.position_m, case.velocity_m_s, case.acceleration_m_s2)
        )
        cases.append(
            replace(
                case,
                name=f"lon{longitude:.10g}_{case.name}",
                position_m=r,
                velocity_m_s=v,
                acceleration_m_s2=a,
            )
        )
    return tuple(cases)
