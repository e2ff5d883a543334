"""Whether stored thrust levels are true: a sample is searched again, and flown by another integrator."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.flown import case_of_row
from landing_cli.reach.free_descent import prepare, survey
from landing_cli.reach.least_thrust import fly_least_thrust
from landing_cli.reach.records import Verdict
from landing_cli.reach.reflight import Ground, measure_rows
from landing_cli.reach.stored import CaseResult

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Facets of each case that are searched again: evenly spaced ones, and those nearest to the boundary.
SPACED_FACETS, NEAREST_FACETS = 8, 8

# What the sample may differ by at most: the level, searched again and flown; the flight of least thrust.
MARGIN_LIMITS: Mapping[str, float] = {
    "stored_thrust_level_flown": 1e-6,
    "least_thrust_excess": 2e-5,
    "least_thrust_miss_m": 0.05,
    "least_thrust_ellipsoid_depth": 2e-5,
    "least_thrust_glide_slope_excess_deg": 2e-3,
}


def sampled_rows(result: CaseResult) -> Ints:
    """Choose rows with a flown thrust level: some evenly spaced, and those whose margin is least."""
    rows = result.solutions.rows
    known = np.flatnonzero(np.isfinite(rows["thrust_level_flown"]))
    spaced = known[:: max(1, len(known) // SPACED_FACETS)]
    nearest = known[np.argsort(np.abs(rows["thrust_margin"][known]), kind="stable")[:NEAREST_FACETS]]
    return np.union1d(spaced, nearest)


def check_levels(result: CaseResult, ground: Ground) -> tuple[Ints, dict[str, Floats]]:
    """Search a sample's thrust levels again and fly what has them.

    Parameters
    ----------
    result : CaseResult
        A case with the margin.
    ground : Ground
        Its surface.

    Returns
    -------
    facets : (n,) int
        The sample; empty where no level was flown.
    found : mapping of str to (n,) float
        What is checked, by the names of MARGIN_LIMITS.
    """
    chosen = sampled_rows(result)
    parts = list(_searched(result, chosen, ground))
    found = {name: np.array([part[name] for part in parts]) for name in MARGIN_LIMITS}
    return result.solutions.rows["facet"][chosen].astype(np.int64), found


def _searched(result: CaseResult, chosen: Ints, ground: Ground) -> Iterator[dict[str, float]]:
    if len(chosen) == 0:
        return
    shared = survey(result.case)
    for row in chosen.tolist():
        stored = result.solutions.rows[row]
        prepared = prepare(case_of_row(result.case, result.solutions, row), shared)
        _, flights = fly_least_thrust(prepared, np.array([stored["facet"]]))
        flown = float(flights.rows["thrust_level_flown"][0])
        if flights.rows["thrust_nodes"][0] == 0:
            yield dict.fromkeys(MARGIN_LIMITS, np.nan)
            continue
        level, apart = (
            flown,
            0.0,
        )  # a free final stage has its least level at another duration than its least J
        if stored["verdict"] == Verdict.REACHABLE:
            level = float(np.fmin(flown, min(stored["peak_thrust_ratio"], 1.0)))
        if result.case.free_final_stage is None or stored["verdict"] != Verdict.REACHABLE:
            apart = abs(level - float(stored["thrust_level_flown"]))
        seen = measure_rows(prepared.case, flights, np.zeros(1, dtype=np.int64), ground)[0]
        yield {
            "stored_thrust_level_flown": apart,
            "least_thrust_excess": float(seen["peak_thrust_ratio"]) / flown - 1.0,
            "least_thrust_miss_m": float(seen["touchdown_miss_m"]),
            "least_thrust_ellipsoid_depth": -float(seen["ellipsoid_margin"]),
            "least_thrust_glide_slope_excess_deg": -float(seen["glide_slope_margin_deg"]),
        }
