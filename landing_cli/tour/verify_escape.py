"""Whether stored escape maps are right: by energies, not by the closed form that made them."""

from __future__ import annotations

import numpy as np

from landing_cli.results.verification import Check, Report
from landing_cli.tour.escape_records import EscapeMap

LIMIT_M_S = 1e-6


def verify_map(entry: EscapeMap) -> Report:
    """Check a map: after the burn the energy about the body is zero.

    Parameters
    ----------
    entry : EscapeMap
        The map.

    Returns
    -------
    Report
    """
    low = entry.radius_m + entry.periapsis_altitude_m[:, None]
    high = entry.radius_m + entry.apoapsis_altitude_m[None]
    possible = high >= low
    speed = np.sqrt(entry.gm_m3_s2 * (2.0 / low - 2.0 / (low + np.where(possible, high, low))))
    energy = 0.5 * (speed + entry.delta_v_m_s) ** 2 - entry.gm_m3_s2 / low
    fault = ""
    if not np.array_equal(np.isnan(entry.delta_v_m_s), ~possible):
        fault = "has values where the apoapsis is below the periapsis, or none where it is above"
    excess = np.abs(energy / np.sqrt(2.0 * entry.gm_m3_s2 / low))  # as a velocity
    worst = {"energy_m_s": Check(float(np.nanmax(excess)), LIMIT_M_S)}
    return Report(entry.name, "map", True, worst, fault)
