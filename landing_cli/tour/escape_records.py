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
    """One orbit about the Earth, flown in N-body to where the paper takes a craft for free.

    Attributes
    ----------
    name : str
        ``perigee_100_km``.
    perigee_altitude_m, apogee_altitude_m : float, m
        Of the osculating orbit at the perigee.
    two_body_m_s : float, m/s
        Increment at the perigee that eq 2 asks for: to infinity.
    two_body_reach_m_s : float, m/s
        Two-body increment at the perigee that carries to 1.5 million km.
    flown_m_s, flown_least_m_s, flown_most_m_s : float, m/s
        Least increment at the perigee with which a flight in N-body gets to 1.5 million km: median, least and
        most over epochs and directions; NaN where none does.
    flown_apogee_m : float, m
        Greatest distance from the Earth's centre without a burn, median.
    told : str
        Epochs, directions and forces, in words.
    """

    name: str
    perigee_altitude_m: float
    apogee_altitude_m: float
    two_body_m_s: float
    two_body_reach_m_s: float
    flown_m_s: float
    flown_least_m_s: float
    flown_most_m_s: float
    flown_apogee_m: float
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
