"""What it takes to leave the Moon or the Earth: in closed form, and flown.

Liu et al. (2023), eqs 1-2. Eq 2 as printed has the parenthesis under the root; it must read
``sqrt(2 mu/r_p) (1 - sqrt(r_a/(r_p + r_a)))``, the parabolic speed less that of eq 1.

The paper adds two orbits in a full force model: one with a perigee of 100 km and an apogee of 1.5 million km,
which then needs 42 m/s to get to 1.5 million km, and one of 17.8 days with a perigee of 135 km, which needs
37.8 m/s. It gives neither epoch nor orientation. Here both are flown under the Sun, the planets, the Moon and
the oblate Earth through a month of epochs and all directions in the ecliptic. Drag is left out; through it
a pass at 100 km costs about 2000 m/s times the craft's drag area over mass in m2/kg.
"""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.flight.astronomy import DAY_S
from landing_cli.tour.ephemeris import GM_M3_S2, Ephemeris, flight_ephemeris, states_of_body
from landing_cli.tour.escape_records import EscapeFlight
from landing_cli.tour.forces import EARTH_RADIUS_M
from landing_cli.tour.nbody import fly_through
from landing_cli.tour.time_scales import utc_to_t_s

FloatArray = NDArray[np.float64]

REACH_M = 1.5e9  # from the Earth's centre: where the paper takes the craft for free
ESCAPE_SPAN = ("2021-03-03T00:00:00", "2021-05-31T00:00:00")  # before the paper's departure of 8 April

_EPOCHS = 8  # over a month of the Moon
_DIRECTIONS = 12
_MONTH_S = 27.32 * DAY_S
_FLIGHT_S = 60.0 * DAY_S
_SAMPLE_S = 0.5 * DAY_S
_STEP_M_S = 4.0
_RESOLVED_M_S = 0.05
_HEADROOM_M_S = 24.0  # above the two-body increment to infinity
_PERIOD_S = 17.8 * DAY_S


def escape_increment(
    gm_m3_s2: float, radius_m: float, periapsis_altitude_m: ArrayLike, apoapsis_altitude_m: ArrayLike
) -> FloatArray:
    """Velocity increment at the periapsis that makes an orbit parabolic (Liu 2023, eqs 1-2, corrected).

    Parameters
    ----------
    gm_m3_s2 : float, m3/s2
        Gravitational parameter of the body.
    radius_m : float, m
        Its radius, from which altitudes count.
    periapsis_altitude_m, apoapsis_altitude_m : float or arrays that broadcast, m
        Of the orbit.

    Returns
    -------
    array of float, m/s
        NaN where the apoapsis would be below the periapsis.
    """
    low = radius_m + np.asarray(periapsis_altitude_m, dtype=np.float64)
    high = radius_m + np.asarray(apoapsis_altitude_m, dtype=np.float64)
    # 1 - sqrt(1 - q) without cancellation, q = r_p/(r_p + r_a)
    q = low / (low + high)
    increment = np.sqrt(2.0 * gm_m3_s2 / low) * q / (1.0 + np.sqrt(1.0 - q))
    return np.asarray(np.where(high >= low, increment, np.nan), dtype=np.float64)


def fly_escapes(kernel_name: str) -> tuple[EscapeFlight, ...]:
    """Fly the paper's two orbits about the Earth out to 1.5 million km.

    Parameters
    ----------
    kernel_name : str
        Ephemeris: ``DE440``, or the path of a planetary SPK file.

    Returns
    -------
    tuple of EscapeFlight
        ``perigee_100_km`` and ``perigee_135_km``.

    Raises
    ------
    InputRefused
        If the ephemeris cannot be read.
    """
    start, end = (utc_to_t_s(text) for text in ESCAPE_SPAN)
    ephemeris = flight_ephemeris(kernel_name, start, end)
    epochs = np.linspace(start, start + _MONTH_S, _EPOCHS, endpoint=False)
    axis = (GM_M3_S2["Earth"] * (_PERIOD_S / (2.0 * math.pi)) ** 2) ** (1.0 / 3.0)
    return (
        escape_flight("perigee_100_km", 1.0e5, 1.5e9, epochs, ephemeris),
        escape_flight("perigee_135_km", 1.35e5, 2.0 * (axis - EARTH_RADIUS_M) - 1.35e5, epochs, ephemeris),
    )


def escape_flight(
    name: str,
    perigee_altitude_m: float,
    apogee_altitude_m: float,
    epochs_s: FloatArray,
    ephemeris: Ephemeris,
) -> EscapeFlight:
    """Fly one orbit about the Earth out to 1.5 million km, at several epochs and in all directions.

    Parameters
    ----------
    name : str
        Of the orbit.
    perigee_altitude_m, apogee_altitude_m : float, m
        Of the osculating orbit at the perigee, before the burn.
    epochs_s : (n,) float, s
        Of the perigee, TDB seconds past J2000.
    ephemeris : Ephemeris
        From the first epoch to 60 days after the last.

    Returns
    -------
    EscapeFlight
    """
    free = float(escape_increment(GM_M3_S2["Earth"], EARTH_RADIUS_M, perigee_altitude_m, apogee_altitude_m))
    low, high = EARTH_RADIUS_M + perigee_altitude_m, EARTH_RADIUS_M + apogee_altitude_m
    angles = 2.0 * math.pi / _DIRECTIONS * np.arange(_DIRECTIONS)
    cases = np.array(list(product(epochs_s, angles)))
    tried = np.arange(0.0, free + _HEADROOM_M_S, _STEP_M_S)
    farthest = np.stack([_farthest(cases, low, high, dv, ephemeris) for dv in tried], axis=1)
    least = _least_increments(cases, low, high, tried, farthest, ephemeris)
    gone = np.isfinite(least)
    speeds = [math.sqrt(2.0 * GM_M3_S2["Earth"] * (1.0 / low - 1.0 / (low + far))) for far in (high, REACH_M)]
    return EscapeFlight(
        name=name,
        perigee_altitude_m=perigee_altitude_m,
        apogee_altitude_m=apogee_altitude_m,
        two_body_m_s=free,
        two_body_reach_m_s=max(0.0, speeds[1] - speeds[0]),
        flown_m_s=float(np.median(least[gone])) if gone.any() else math.nan,
        flown_least_m_s=float(least[gone].min()) if gone.any() else math.nan,
        flown_most_m_s=float(least[gone].max()) if gone.any() else math.nan,
        flown_apogee_m=float(np.median(farthest[:, 0])),
        told=(
            f"{len(cases)} flights of 60 days from the perigee, {_EPOCHS} epochs over a month from "
            f"{ESCAPE_SPAN[0][:10]} and {_DIRECTIONS} directions in the ecliptic: Sun, planets, Moon, "
            f"J2, no drag; {int(gone.sum())} get to 1.5 million km"
        ),
    )


def _farthest(
    cases: FloatArray, low: float, high: float, increment_m_s: float | FloatArray, ephemeris: Ephemeris
) -> FloatArray:
    """Greatest geocentric distance of each case, m: (epoch, direction of the apogee from the Sun)."""
    speed = math.sqrt(2.0 * GM_M3_S2["Earth"] * (1.0 / low - 1.0 / (low + high)))
    speeds = np.broadcast_to(speed + np.asarray(increment_m_s), (len(cases),))
    farthest = np.zeros(len(cases))
    for epoch in np.unique(cases[:, 0]):
        rows = np.flatnonzero(cases[:, 0] == epoch)
        earth = states_of_body(ephemeris, "Earth", epoch)[0]
        at = math.atan2(-earth[1], -earth[0]) + cases[rows, 1] + math.pi
        nothing = np.zeros(len(rows))
        outward = np.stack([np.cos(at), np.sin(at), nothing], axis=1)
        along = np.stack([-np.sin(at), np.cos(at), nothing], axis=1)
        states = earth + np.hstack([low * outward, speeds[rows, None] * along])
        times = epoch + np.arange(_SAMPLE_S, _FLIGHT_S + 1.0, _SAMPLE_S)
        noted, _ = fly_through(states, epoch, times, ephemeris)
        away = noted[..., :3] - states_of_body(ephemeris, "Earth", times)[:, :3]
        farthest[rows] = np.nanmax(np.linalg.norm(away, axis=2), axis=1)
    return farthest


def _least_increments(
    cases: FloatArray,
    low: float,
    high: float,
    tried: FloatArray,
    farthest: FloatArray,
    ephemeris: Ephemeris,
) -> FloatArray:
    """Least increment with which each case gets away, by halving; NaN where none does."""
    away = farthest >= REACH_M
    first = np.argmax(away, axis=1)
    enough, little = tried[first], tried[np.maximum(first - 1, 0)]
    for _ in range(math.ceil(math.log2(_STEP_M_S / _RESOLVED_M_S))):
        middle = 0.5 * (enough + little)
        gone = _farthest(cases, low, high, middle, ephemeris) >= REACH_M
        enough, little = np.where(gone, middle, enough), np.where(gone, little, middle)
    least = np.where(first == 0, 0.0, enough)
    return np.where(away.any(axis=1), least, np.nan)
