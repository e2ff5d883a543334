"""The shortest time of flight that the thruster allows (Lyu 2026, section 2.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from landing_cli.plan.bezier import needs, plan_bezier, plan_from
from landing_cli.plan.field_departure import pricing_field
from landing_cli.plan.grid_search import Found, thrust_limit_m_s2, two_level_search
from landing_cli.plan.guide_candidates import GuideSearch, prepare_search, price
from landing_cli.plan.guide_points import GuidePlane, guide_plane
from landing_cli.plan.records import BezierOptions, Plan, PlanCase

METHOD = "shortest_time"
RESOLUTION_S = 0.01

_RULE_STEPS = 30
_RULE_CHANGE = 1e-6
_SCAN_RATIO = 1.01
_SCANNED = (0.5, 3.0)  # from and to which multiple of the first guess
_MARGIN, _ROUGH_MARGIN = 1.1, 1.3  # how far the coarse grid's least peak may lie above the least; rough field


@dataclass(frozen=True)
class RuleTime:
    """What the paper's iteration over the time of flight came to.

    Attributes
    ----------
    tof_s : float, s
        Its last time.
    peak_n : float, N
        Peak thrust of the cheapest guide points there; NaN where there are none.
    converged : bool
        Whether the time stopped changing.
    """

    tof_s: float
    peak_n: float
    converged: bool


def rule_time(case: PlanCase, options: BezierOptions, plane: GuidePlane | None = None) -> RuleTime:
    """Iterate the time of flight by the square root of the thrust ratio (Lyu 2026, eq 39).

    Parameters
    ----------
    case : PlanCase
        What is asked; its time of flight is where the iteration begins.
    options : BezierOptions
        Grid and samples.
    plane : GuidePlane, optional
        The case's guide plane, where it is known.

    Returns
    -------
    RuleTime
        The cheapest guide points of every time, not the gentlest, as in the paper; the grid makes their peak
        jump, so the iteration may end in a cycle.
    """
    plane = guide_plane(case) if plane is None else plane
    tof_s, peak, limit = case.tof_s, math.nan, thrust_limit_m_s2(case)
    for _ in range(_RULE_STEPS):
        found = two_level_search(prepare_search(replace(case, tof_s=tof_s), options, plane), "fuel")
        if found is None:
            return RuleTime(tof_s, math.nan, False)
        peak = found.peak_m_s2
        stretch = math.sqrt(peak / limit)
        if abs(stretch - 1.0) <= _RULE_CHANGE:
            return RuleTime(tof_s, peak * case.spacecraft.mass_kg, True)
        tof_s *= stretch
    return RuleTime(tof_s, peak * case.spacecraft.mass_kg, False)


def plan_shortest_time(case: PlanCase, options: BezierOptions) -> Plan:
    """Find the shortest time of flight for which some guide points keep every constraint (Lyu 2026, eq 31).

    The paper iterates eq 39 with the cheapest guide points. Here the gentlest count, which allow a little
    less time, and the time is bracketed: longer is not always easier, so times are scanned upwards from one
    far too short, and the first that works is bisected against the one before it. The paper's iteration
    gives the first guess and is reported beside.

    Parameters
    ----------
    case : PlanCase
        What is asked; its time of flight only starts the first guess.
    options : BezierOptions
        Grid and samples.

    Returns
    -------
    Plan
        Of the shortest time, with its own ``tof_s``; at `RESOLUTION_S` less the thrust does not suffice.
    """
    plane = guide_plane(case)
    rule = rule_time(case, options, plane)
    guess = rule.tof_s if math.isfinite(rule.peak_n) else case.tof_s
    scan = (
        guess * _SCANNED[0] * _SCAN_RATIO ** np.arange(math.log(_SCANNED[1] / _SCANNED[0], _SCAN_RATIO) + 1)
    )
    too_short, gentlest = 0.0, None
    for tof_s in scan:
        search, found = _gentlest(case, options, plane, float(tof_s))
        if found is not None and found.peak_m_s2 <= thrust_limit_m_s2(case):
            return _bisected(case, options, plane, too_short, search, found, rule)
        too_short = float(tof_s)
        if found is not None and (gentlest is None or found.peak_m_s2 < gentlest[1].peak_m_s2):
            gentlest = search, found
    plan = plan_bezier(case, options)
    told = f"no time from {scan[0]:.6g} to {scan[-1]:.6g} s is long enough"
    if gentlest is not None:
        told += f"; the least thrust found is {needs(*gentlest)}"
    return replace(plan, method=METHOD, status="infeasible", message=f"{told}; {plan.message}")


def _gentlest(
    case: PlanCase, options: BezierOptions, plane: GuidePlane, tof_s: float
) -> tuple[GuideSearch, Found | None]:
    """Search the curve of least peak thrust, unless its price shows that it will be too much by far."""
    search = prepare_search(replace(case, tof_s=tof_s), options, plane)
    shares = np.linspace(0.0, 1.0, options.coarse_points)
    rough = pricing_field(case) is not case.asteroid.gravity
    grid = price(search, shares, shares if plane.blocked else np.zeros(1), departs=False)
    least = grid.peak_m_s2[np.isfinite(grid.delta_v_m_s)].min(initial=math.inf)
    if least > thrust_limit_m_s2(case) * (_ROUGH_MARGIN if rough else _MARGIN):
        return search, None
    return search, two_level_search(search, "peak")


def _bisected(
    case: PlanCase,
    options: BezierOptions,
    plane: GuidePlane,
    too_short: float,
    search: GuideSearch,
    found: Found,
    rule: RuleTime,
) -> Plan:
    """Close in between a time that is too short and one that is long enough; the latter is kept."""
    scanned_from = too_short
    while search.case.tof_s - too_short > RESOLUTION_S:
        middle = 0.5 * (too_short + search.case.tof_s)
        tried, gentlest = _gentlest(case, options, plane, middle)
        if gentlest is not None and gentlest.peak_m_s2 <= thrust_limit_m_s2(case):
            search, found = tried, gentlest
        else:
            too_short = middle
    plan = plan_from(search, found, method=METHOD)
    bracket = {
        "too_short_s": too_short,
        "scanned_from_s": scanned_from,
        "scan_ratio": _SCAN_RATIO,
        "rule_tof_s": rule.tof_s,
        "rule_peak_thrust_n": rule.peak_n if math.isfinite(rule.peak_n) else None,
        "rule_converged": rule.converged,
    }
    return replace(plan, parameters={**plan.parameters, **bracket})
