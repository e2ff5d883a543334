"""Constants and the epoch of heliocentric flight, in SI."""

from __future__ import annotations

import math

AU_M = 149_597_870_700.0  # IAU 2012, exact
DAY_S = 86_400.0
J2000_JD = 2_451_545.0  # TDB
GM_SUN_M3_S2 = 1.327_124_400_412_794_2e20  # DE440 (Park et al. 2021)
OBLIQUITY_RAD = math.radians(84_381.448 / 3600.0)  # IAU 1976, at J2000: the Minor Planet Center's ecliptic
