"""The least-fuel guide points by a coarse and a fine grid (Lyu 2026, section 2.3).

Every candidate is priced, the cheapest is checked first, and the first that keeps the constraints is the
grid's best: exact distances are computed for the few candidates below it in price, not for the whole grid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.peak_thrust import peak_acceleration
from landing_cli.plan.field_departure import pricing_field
from landing_cli.plan.guide_candidates import (
    Candidates,
    GuideSearch,
    clearances,
    curve_of,
    first_kept,
    price,
)
from landing_cli.plan.records import PlanCase

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Objective = Literal["fuel", "peak"]

_DEPARTURE_ERROR = 1e-3
"""Share by which an interpolated departure may misjudge a peak (tested): such candidates are not dropped."""


@dataclass(frozen=True)
class Found:
    """The guide points that a search settled on.

    Attributes
    ----------
    alpha_m, beta_m : float, m
    delta_v_m_s : float, m/s
        As the search prices it.
    peak_m_s2 : float, m/s2
        Largest thrust over the initial mass, at its stationary points.
    checked, distances : int
        Candidates whose path was looked at, and distances that were computed for them.
    """

    alpha_m: float
    beta_m: float
    delta_v_m_s: float
    peak_m_s2: float
    checked: int
    distances: int


def search_guide_points(search: GuideSearch) -> Found | None:
    """Find the cheapest guide points that keep the constraints (Lyu 2026, eq 30).

    Parameters
    ----------
    search : GuideSearch
        The search.

    Returns
    -------
    Found or None
        None where no candidate is clear of the body. Where the cheapest needs more than the largest thrust,
        which the paper does not look at here, the cheapest below it near the curve of least peak; where there
        is none, that curve: its peak then exceeds the limit.
    """
    limit = thrust_limit_m_s2(search.case)
    found = two_level_search(search, "fuel")
    if found is None or found.peak_m_s2 <= limit:
        return found
    gentle = two_level_search(search, "peak")
    if gentle is None or gentle.peak_m_s2 > limit:
        return gentle
    within = two_level_search(search, "fuel", limit)
    return gentle if within is None or within.delta_v_m_s > gentle.delta_v_m_s else within


def two_level_search(search: GuideSearch, objective: Objective, limit_m_s2: float = math.inf) -> Found | None:
    """Search a coarse grid, then a fine one between the neighbours of its best.

    Parameters
    ----------
    search : GuideSearch
        The search.
    objective : {"fuel", "peak"}
        What the best is least in: fuel, or largest thrust.
    limit_m_s2 : float, m/s2
        Largest thrust over the initial mass that is accepted.

    Returns
    -------
    Found or None
        None where no candidate keeps the constraints. Without a limit, the fine grid is laid about the coarse
        candidate that stays farthest from the body where none of the coarse ones keeps them.
    """
    blocked, fine_points = search.plane.blocked, search.options.fine_points
    shares = np.linspace(0.0, 1.0, search.options.coarse_points)
    beta_shares = shares if blocked else np.zeros(1)
    coarse = price(search, shares, beta_shares)
    best = best_kept(search, coarse, objective, limit_m_s2)
    if best is None and limit_m_s2 < math.inf:
        return None
    index = best[0] if best else int(np.argmax(clearances(search, coarse)))
    at_alpha, at_beta = divmod(index, beta_shares.size)
    near_beta = _around(shares[at_beta], shares[1], fine_points) if blocked else beta_shares
    fine = price(search, _around(shares[at_alpha], shares[1], fine_points), near_beta)
    better = best_kept(search, fine, objective, limit_m_s2)
    if best is None or better is None:
        return (best or better or (0, None))[1]
    checked, distances = (
        getattr(best[1], name) + getattr(better[1], name) for name in ("checked", "distances")
    )
    found = min(better[1], best[1], key=lambda f: f.delta_v_m_s if objective == "fuel" else f.peak_m_s2)
    return replace(found, checked=checked, distances=distances)


def _around(share: float, step: float, count: int) -> FloatArray:
    return np.linspace(max(share - step, 0.0), min(share + step, 1.0), count)


def best_kept(
    search: GuideSearch, candidates: Candidates, objective: Objective, limit_m_s2: float = math.inf
) -> tuple[int, Found] | None:
    """Go through candidates from the best on, to the first whose path keeps the constraints.

    Parameters
    ----------
    search : GuideSearch
        The search.
    candidates : Candidates
        What to go through.
    objective : {"fuel", "peak"}
        What the best is least in.
    limit_m_s2 : float, m/s2
        Largest thrust over the initial mass that is accepted.

    Returns
    -------
    (int, Found) or None
        Index of the candidate, and the candidate; None where none keeps them.
    """
    order = _worth_checking(search, candidates, objective, limit_m_s2)
    at, distances = 0, 0
    while at < order.size:
        at, measured = first_kept(search, candidates, order, at)
        distances += measured
        if at == order.size:
            break
        index = int(order[at])
        at += 1
        alpha, beta = float(candidates.alpha_m[index]), float(candidates.beta_m[index])
        peak = peak_of(search, alpha, beta)
        if peak <= limit_m_s2:
            return index, Found(alpha, beta, float(candidates.delta_v_m_s[index]), peak, at, distances)
    return None


def thrust_limit_m_s2(case: PlanCase) -> float:
    """Largest thrust over the initial mass, m/s2."""
    return case.spacecraft.thrust_max_n / case.spacecraft.mass_kg


def peak_of(search: GuideSearch, alpha_m: float, beta_m: float) -> float:
    """Largest thrust over the initial mass on one curve, at its stationary points, m/s2."""
    leg, w = curve_of(search, alpha_m, beta_m), search.case.asteroid.rotation_rate_rad_s
    return peak_acceleration(leg, w, search.exhaust_velocity_m_s)[0]


def _worth_checking(
    search: GuideSearch, candidates: Candidates, objective: Objective, limit: float
) -> IntArray:
    """Candidates from the best on, without those whose sampled peak is too high already."""
    exact = pricing_field(search.case) is search.case.asteroid.gravity
    bound = limit if exact else limit * (1.0 + _DEPARTURE_ERROR)
    possible = np.isfinite(candidates.delta_v_m_s) & (candidates.peak_m_s2 <= bound)
    order = np.argsort(candidates.delta_v_m_s if objective == "fuel" else candidates.peak_m_s2, kind="stable")
    return np.asarray(order[possible[order]])
