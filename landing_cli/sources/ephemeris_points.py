"""Positions of the Sun, the planets, the Earth and the Moon at single times, straight from a kernel.

For checks: what flies has copied the kernel into pieces of its own (`ephemeris_kernel.read_span`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from landing_cli.sources.ephemeris_kernel import EARTH, EARTH_MOON, MOON, SUN, _opened

FloatArray = NDArray[np.float64]
Points = Callable[[float], FloatArray]

BODIES = ("Earth", "Moon", "Mercury", "Venus", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune")
_BARYCENTRES = (1, 2, 4, 5, 6, 7, 8)
_J2000_JD, _DAY_S = 2_451_545.0, 86_400.0


@contextmanager
def heliocentric_points(kernel: str) -> Iterator[Points]:
    """Open a kernel for positions at single times.

    Parameters
    ----------
    kernel : str
        ``DE440``, or the path of a planetary SPK file.

    Yields
    ------
    callable
        Takes TDB seconds past J2000; returns (9, 3) float, m: the `BODIES` from the Sun, ICRF axes.

    Raises
    ------
    InputRefused
        If the extra is missing, or the file is no planetary kernel.
    """
    with _opened(kernel) as (spk, _):

        def points(t_s: float) -> FloatArray:
            days = math.floor(t_s / _DAY_S)
            moment = (_J2000_JD + days, t_s / _DAY_S - days)
            sun, pair = spk[0, SUN].compute(*moment), spk[0, EARTH_MOON].compute(*moment)
            rows = [
                pair + spk[EARTH_MOON, EARTH].compute(*moment),
                pair + spk[EARTH_MOON, MOON].compute(*moment),
                *(spk[0, number].compute(*moment) for number in _BARYCENTRES),
            ]
            return 1000.0 * (np.array(rows) - sun)

        yield points
