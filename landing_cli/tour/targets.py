"""Which asteroids of a catalogue are targets, and how large and how bright they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.errors import InputRefused
from landing_cli.flight.astronomy import AU_M, DAY_S
from landing_cli.sources.catalogue_files import read_catalogue
from landing_cli.sources.catalogue_records import Catalogue
from landing_cli.tour.records import TargetLimits

FloatArray = NDArray[np.float64]

EMBEDDED = Path(__file__).parent / "data" / "liu2023_targets.csv"
DIAMETER_AT_ZERO_MAGNITUDE_M = 1_329_000.0
SLOPE = 0.15
"""G of an asteroid whose phase curve was not measured."""
EPOCH_YEARS = 30.0
"""An orbit is not carried further: its planetary perturbations would rest on an error of unknown size."""

_YEAR_S = 365.25 * DAY_S
_PHASE = ((3.332, 0.631, 0.986), (1.862, 1.218, 0.238))  # A, B, C of Phi_1 and Phi_2


def embedded_catalogue() -> Catalogue:
    """Read the ten targets of the paper's Table 2, with the orbits of 2019 that its dates agree with.

    Returns
    -------
    Catalogue
        2014 NQ64 among them, whose orbit of that time is not known: leave it out of searches.
    """
    return read_catalogue(EMBEDDED)


def select(catalogue: Catalogue, limits: TargetLimits) -> Catalogue:
    """Keep the asteroids that are targets.

    Parameters
    ----------
    catalogue : Catalogue
        As read.
    limits : TargetLimits
        What a target must be.

    Returns
    -------
    Catalogue
        In the same order.

    Raises
    ------
    InputRefused
        If an excluded name is not in the catalogue's notation, or nothing is left.
    """
    elements = catalogue.elements
    keep = elements.a_m * (1.0 - elements.e) < limits.perihelion_max_m
    if np.isfinite(limits.absolute_magnitude_max):
        keep &= catalogue.absolute_magnitude <= limits.absolute_magnitude_max  # NaN is no target
    if limits.condition_code_max is not None:
        codes = catalogue.condition_code
        keep &= (codes >= 0) & (codes <= limits.condition_code_max)
    if limits.numbered_only:
        keep &= catalogue.numbered
    out = set(limits.excluded)
    keep &= np.array([name not in out for name in catalogue.designations], dtype=np.bool_)
    if not keep.any():
        raise InputRefused(
            f"none of its {len(catalogue)} asteroids is a target",
            where=catalogue.source,
            fix="widen tour.targets or give another catalogue (--catalogue)",
        )
    return catalogue.take(np.flatnonzero(keep))


def refuse_far_epochs(catalogue: Catalogue, start_t_s: float, end_t_s: float) -> None:
    """Refuse orbits whose epoch is too far from the flight to be carried there.

    Parameters
    ----------
    catalogue : Catalogue
        The targets.
    start_t_s, end_t_s : float, s
        The flight, TDB seconds past J2000.

    Raises
    ------
    InputRefused
        With the asteroid, its epoch and the distance in years.
    """
    epoch = catalogue.elements.epoch_t_s
    gap_years = np.maximum(np.maximum(start_t_s - epoch, epoch - end_t_s), 0.0) / _YEAR_S
    worst = int(np.argmax(gap_years))
    if gap_years[worst] > EPOCH_YEARS:
        year = 2000.0 + epoch[worst] / _YEAR_S
        raise InputRefused(
            f"the orbit of {catalogue.designations[worst]} is of {year:.1f}, {gap_years[worst]:.0f} years "
            f"from the flight; at most {EPOCH_YEARS:.0f} are bridged",
            where=catalogue.source,
            fix="give a catalogue of an epoch near the flight (--catalogue)",
        )


def diameter_m(absolute_magnitude: ArrayLike, albedo: float) -> FloatArray:
    """Diameter of a sphere of an absolute magnitude: D = 1329 km / sqrt(albedo) 10^(-H/5).

    Parameters
    ----------
    absolute_magnitude : float or array
        H.
    albedo : float
        Geometric.

    Returns
    -------
    array of float, m
        NaN where H is.

    Notes
    -----
    Eq 3 of Liu et al. 2023, which prints 329 for Harris's 1329 km; with 1329 and an albedo of 0.15 every
    diameter of its Table 2 follows from H within its rounding.
    """
    return DIAMETER_AT_ZERO_MAGNITUDE_M / np.sqrt(albedo) * 10.0 ** (-0.2 * np.asarray(absolute_magnitude))


def phase_angle(asteroid_m: FloatArray, observer_m: FloatArray) -> FloatArray:
    """Angle at the asteroid between the Sun and an observer.

    Parameters
    ----------
    asteroid_m, observer_m : (..., 3) float, m
        Heliocentric.

    Returns
    -------
    (...) float, rad
    """
    sun, seen = -asteroid_m, observer_m - asteroid_m
    across = np.linalg.norm(np.cross(sun, seen), axis=-1)
    return np.arctan2(across, np.sum(sun * seen, axis=-1))


def apparent_magnitude(
    absolute_magnitude: ArrayLike, asteroid_m: FloatArray, observer_m: FloatArray
) -> FloatArray:
    """Visual magnitude in the IAU's H, G system with G = 0.15.

    Parameters
    ----------
    absolute_magnitude : float or array
        H.
    asteroid_m, observer_m : (..., 3) float, m
        Heliocentric.

    Returns
    -------
    (...) float

    Notes
    -----
    Bowell et al. 1989 (Asteroids II), with the blend of the two phase functions below some ten degrees. Valid
    to phase angles of 120 degrees; further on it is an extrapolation.
    """
    half = np.tan(0.5 * phase_angle(asteroid_m, observer_m))
    sine = 2.0 * half / (1.0 + half**2)
    small = np.exp(-90.56 * half**2)
    phases = [
        small * (1.0 - C * sine / (0.119 + 1.341 * sine - 0.754 * sine**2))
        + (1.0 - small) * np.exp(-A * half**B)
        for A, B, C in _PHASE
    ]
    light = (1.0 - SLOPE) * phases[0] + SLOPE * phases[1]
    to_sun = np.linalg.norm(asteroid_m, axis=-1) / AU_M
    to_observer = np.linalg.norm(asteroid_m - observer_m, axis=-1) / AU_M
    return np.asarray(absolute_magnitude) + 5.0 * np.log10(to_sun * to_observer) - 2.5 * np.log10(light)
