"""The state from which a spacecraft near the Earth sets out on a tour."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from landing_cli.tour.ephemeris import Ephemeris, states_of_body
from landing_cli.tour.records import Departure

FloatArray = NDArray[np.float64]


def departure_from_polar(
    t_s: float, distance_m: float, angle_rad: float, radial_speed_m_s: float, ephemeris: Ephemeris
) -> Departure:
    """Depart from a point in the ecliptic with a radial velocity: numbers that a paper leaves to be inferred.

    Parameters
    ----------
    t_s : float, s
        TDB seconds past J2000.
    distance_m : float, m
        From the Earth's centre.
    angle_rad : float, rad
        Of the position, counter-clockwise in the ecliptic from the direction Earth to Sun.
    radial_speed_m_s : float, m/s
        Away from the Earth.
    ephemeris : Ephemeris
        Covers the time.

    Returns
    -------
    Departure
    """
    earth = states_of_body(ephemeris, "Earth", t_s)[0]
    angle = math.atan2(-earth[1], -earth[0]) + angle_rad
    outward = np.array([math.cos(angle), math.sin(angle), 0.0])
    return departure_from_state(t_s, distance_m * outward, radial_speed_m_s * outward, ephemeris)


def departure_from_state(
    t_s: float, position_m: FloatArray, velocity_m_s: FloatArray, ephemeris: Ephemeris
) -> Departure:
    """Depart from a geocentric state.

    Parameters
    ----------
    t_s : float, s
        TDB seconds past J2000.
    position_m, velocity_m_s : (3,) float, m and m/s
        Geocentric, ecliptic and equinox J2000.
    ephemeris : Ephemeris
        Covers the time.

    Returns
    -------
    Departure
    """
    earth = states_of_body(ephemeris, "Earth", t_s)[0]
    distance = float(np.linalg.norm(position_m))
    turned = math.atan2(position_m[1], position_m[0]) - math.atan2(-earth[1], -earth[0])
    return Departure(
        t_s=t_s,
        position_m=earth[:3] + position_m,
        velocity_m_s=earth[3:] + velocity_m_s,
        geocentric_distance_m=distance,
        angle_rad=turned % (2.0 * math.pi),
        radial_speed_m_s=float(position_m @ velocity_m_s) / distance,
    )
