"""What leaving the Moon or the Earth takes: maps over altitudes, and cases that were flown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class EscapeMap:
    """Two-body velocity increments at the periapsis that make an orbit parabolic (Liu 2023, eqs 1-2).

    Attributes
    ----------
    name : str
        ``moon`` or ``earth``.
    gm_m3_s2 : float, m3/s2
    radius_m : float, m
        Of the body, from which altitudes count.
    periapsis_altitude_m : (n,) float, m
    apoapsis_altitude_m : (m,) float, m
    delta_v_m_s : (n, m) float, m/s
        NaN where the apoapsis would be below the periapsis.
    """

    name: str
    gm_m3_s2: float
    radius_m: float
    periapsis_altitude_m: FloatArray
    apoapsis_altitude_m: FloatArray
    delta_v_m_s: FloatArray


@dataclass(frozen=True)
class EscapeFlight:
    """One orbit about the Earth, left in N-body.

    Attributes
    ----------
    name : str
        ``perigee_100_km``.
    perigee_altitude_m, apogee_altitude_m : float, m
        Of the osculating orbit at the perigee.
    two_body_m_s : float, m/s
        Increment at the perigee that eq 2 asks for.
    flown_m_s : float, m/s
        Least increment at the perigee with which the flight in N-body gets away; NaN where none does.
    told : str
        Epoch, orientation and end of the flight, in words.
    """

    name: str
    perigee_altitude_m: float
    apogee_altitude_m: float
    two_body_m_s: float
    flown_m_s: float
    told: str


@dataclass(frozen=True, eq=False)
class EscapeRun:
    """What `tour escape` found.

    Attributes
    ----------
    cases : tuple of EscapeMap
    flights : tuple of EscapeFlight
    """

    cases: tuple[EscapeMap, ...]
    flights: tuple[EscapeFlight, ...]
