"""What Liu, Chen and Zhang (2023) print, to set our own figures beside it; nothing is computed from it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PrintedFlyby:
    """One row of Table 2.

    Attributes
    ----------
    designation : str
        Unpacked.
    date : str
        UTC day.
    delta_v_m_s : float, m/s
    geocentric_distance_km : float, km
    absolute_magnitude : float
        H.
    diameter_m : float, m
    """

    designation: str
    date: str
    delta_v_m_s: float
    geocentric_distance_km: float
    absolute_magnitude: float
    diameter_m: float


@dataclass(frozen=True)
class PrintedScheme:
    """One row of Table 1, with its rows of Table 2 where they are printed.

    Attributes
    ----------
    number : int
    asteroids : int
    duration_d : float, d
    delta_v_m_s : float, m/s
    distance_km : (float, float), km
        Least and greatest distance from the Earth at the flybys.
    flybys : tuple of PrintedFlyby
        Of the first four schemes.
    """

    number: int
    asteroids: int
    duration_d: float
    delta_v_m_s: float
    distance_km: tuple[float, float]
    flybys: tuple[PrintedFlyby, ...] = ()


_SCHEME_1 = (
    PrintedFlyby("2014 NQ64", "2021-07-05", 433.7, 1.069e7, 24.0, 54.4),
    PrintedFlyby("12923", "2021-09-26", 211.3, 3.256e7, 15.8, 2429.7),
)
_SCHEME_2 = (
    PrintedFlyby("2018 QE", "2021-08-08", 296.4, 1.444e7, 27.7, 9.9),
    PrintedFlyby("154276", "2022-11-15", 77.1, 5.090e7, 17.6, 1036.5),
)
_SCHEME_3 = (
    PrintedFlyby("2010 WC", "2021-11-29", 360.8, 2.822e7, 25.3, 29.9),
    PrintedFlyby("154276", "2022-11-16", 223.3, 5.088e7, 17.6, 1036.5),
)
_SCHEME_4 = (
    PrintedFlyby("2016 BQ15", "2022-02-22", 81.4, 3.859e7, 25.1, 32.8),
    PrintedFlyby("2019 EK", "2022-03-18", 144.4, 3.985e7, 26.4, 18.0),
    PrintedFlyby("2015 KG", "2022-05-30", 176.7, 4.489e7, 26.9, 14.3),
    PrintedFlyby("452807", "2022-06-16", 99.8, 4.727e7, 21.3, 188.6),
    PrintedFlyby("2014 FR37", "2022-11-03", 98.4, 8.013e7, 22.9, 90.3),
)

SCHEMES = (
    PrintedScheme(1, 2, 172.8, 645.0, (1.069e7, 3.256e7), _SCHEME_1),
    PrintedScheme(2, 2, 586.3, 373.4, (1.444e7, 5.090e7), _SCHEME_2),
    PrintedScheme(3, 2, 586.4, 584.1, (2.822e7, 5.088e7), _SCHEME_3),
    PrintedScheme(4, 5, 573.8, 600.7, (3.859e7, 8.013e7), _SCHEME_4),
    PrintedScheme(5, 5, 608.3, 649.3, (3.859e7, 9.019e7)),
    PrintedScheme(6, 4, 582.6, 594.6, (1.594e7, 9.588e7)),
    PrintedScheme(7, 4, 630.1, 654.8, (1.594e7, 1.1493e8)),
    PrintedScheme(8, 5, 543.2, 580.2, (3.859e7, 6.093e7)),
    PrintedScheme(9, 4, 620.3, 565.4, (1.594e7, 1.0449e8)),
    PrintedScheme(10, 5, 616.6, 542.1, (3.859e7, 7.433e7)),
    PrintedScheme(11, 4, 620.1, 537.3, (1.594e7, 1.0453e8)),
    PrintedScheme(12, 5, 607.2, 608.0, (3.859e7, 8.792e7)),
    PrintedScheme(13, 5, 611.7, 591.6, (4.917e7, 9.348e7)),
    PrintedScheme(14, 5, 606.9, 601.0, (3.859e7, 8.790e7)),
    PrintedScheme(15, 5, 629.6, 600.3, (3.859e7, 9.269e7)),
    PrintedScheme(16, 5, 608.8, 646.3, (3.859e7, 6.746e7)),
    PrintedScheme(17, 5, 625.4, 655.5, (3.859e7, 7.994e7)),
    PrintedScheme(18, 5, 595.0, 630.3, (3.859e7, 5.848e7)),
    PrintedScheme(19, 5, 618.3, 643.8, (3.859e7, 7.491e7)),
)
"""Table 1. Scheme 1's 172.8 d from 8 April end on 28 September, two days after the date of Table 2."""

ESCAPE_CORNERS_M_S = {"moon": (31.0, 676.0), "earth": (24.0, 220.0)}
"""Least and greatest increments of Fig. 1."""
ESCAPE_FLIGHTS_M_S = {"perigee_100_km": 42.0, "perigee_135_km": 37.8}
"""Increments that the paper states under perturbations, by our names of the two orbits."""
