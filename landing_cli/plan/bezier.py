"""The paper's method: a seventh-order Bezier curve through two guide points (Lyu 2026, section 2)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from landing_cli.plan.assess import plan_of
from landing_cli.plan.grid_search import (
    Found,
    search_guide_points,
    thrust_limit_m_s2,
)
from landing_cli.plan.guide_candidates import GuideSearch, clearances, curve_of, prepare_search, price
from landing_cli.plan.guide_points import Bounds, GuidePlane, above_guide_point, beta_bounds
from landing_cli.plan.records import BezierOptions, Parameter, Plan, PlanCase

METHOD = "bezier"

_WORDS = {
    "clearance": "the clearance",
    "last_control_point": "above P_5",
    "tangent": "above the line from the start that grazes the body",
    "velocity": "below where the initial velocity leads",
    "start_radius": "not higher than the start",
    "start_distance": "no farther than the start",
}
_STRETCHES = 8
_STRETCHED_ENOUGH = 1e-3


def plan_bezier(case: PlanCase, options: BezierOptions) -> Plan:
    """Plan a landing by the cheapest pair of guide points.

    Parameters
    ----------
    case : PlanCase
        What is asked.
    options : BezierOptions
        Grid and samples.

    Returns
    -------
    Plan
        ``infeasible`` where no curve of the coarse grid, nor of the fine one about its best, keeps the
        constraints; ``refused_by`` among its parameters then says which: ``bounds`` (they leave no guide
        point), ``clearance``, ``terrain`` (the body stands in the cone) or ``thrust``.
    """
    search = prepare_search(case, options)
    found = search_guide_points(search)
    if found is None:
        return refusal(search)
    if found.peak_m_s2 > thrust_limit_m_s2(case):
        return too_weak(search, found, _longer(search, found))
    return plan_from(search, found)


def plan_from(
    search: GuideSearch, found: Found, *, because: str = "", refused_by: str = "", method: str = METHOD
) -> Plan:
    """Measure the curve that a search settled on.

    Parameters
    ----------
    search : GuideSearch
        The search.
    found : Found
        Its answer.
    because : str
        Why it is no plan, if so.
    refused_by : str
        The constraint that refuses it, if one does.
    method : str
        Name of the method.

    Returns
    -------
    Plan
        Its peak thrust is that of the stationary points, which lie between the samples.
    """
    leg = curve_of(search, found.alpha_m, found.beta_m)
    parameters = _parameters(search, found, leg.points_m)
    if refused_by:
        parameters["refused_by"] = refused_by
    plan = plan_of(
        search.case,
        method,
        (leg,),
        iterations=found.checked,
        parameters=parameters,
        otherwise="infeasible",
        because=because,
    )
    return replace(plan, peak_thrust_n=found.peak_m_s2 * search.case.spacecraft.mass_kg)


def too_weak(search: GuideSearch, gentlest: Found, then: str = "", method: str = METHOD) -> Plan:
    """Say how much thrust is missing, with the curve that needs least.

    Parameters
    ----------
    search : GuideSearch
        The search.
    gentlest : Found
        The curve of least peak thrust.
    then : str
        What else there is to say.
    method : str
        Name of the method.

    Returns
    -------
    Plan
    """
    plan = plan_from(search, gentlest, refused_by="thrust", method=method)
    limit = search.case.spacecraft.thrust_max_n
    message = f"the gentlest curve found needs {needs(search, gentlest)}, the thruster gives {limit:g} N"
    return replace(plan, status="infeasible", message=f"{message}; {then}" if then else message)


def refusal(search: GuideSearch, method: str = METHOD) -> Plan:
    """Say why no guide points are clear of the body, with the curve that comes closest.

    Parameters
    ----------
    search : GuideSearch
        The search.
    method : str
        Name of the method.

    Returns
    -------
    Plan
    """
    shares = np.linspace(0.0, 1.0, search.options.coarse_points)
    candidates = price(search, shares, shares if search.plane.blocked else np.zeros(1))
    clear = clearances(search, candidates)
    index = int(np.argmax(clear))
    closest = Found(
        float(candidates.alpha_m[index]),
        float(candidates.beta_m[index]),
        float(candidates.delta_v_m_s[index]),
        float(candidates.peak_m_s2[index]),
        clear.size,
        clear.size * search.options.samples,
    )
    if np.isinf(candidates.delta_v_m_s).all():
        return plan_from(search, closest, because=_no_room(search), refused_by="bounds", method=method)
    count = f"none of {clear.size} choices of guide points, nor of those about the best of them,"
    if clear[index] == -np.inf:
        because = f"{count} leads to the site without cutting the body inside the cone"
        return plan_from(search, closest, because=because, refused_by="terrain", method=method)
    because = f"{count} keeps its distance; of the one that stays farthest"
    return plan_from(search, closest, because=because, refused_by="clearance", method=method)


def _no_room(search: GuideSearch) -> str:
    """Tell which bounds leave no guide point."""
    alpha, plane = search.alpha, search.plane
    if alpha.least > alpha.greatest:
        return (
            f"no guide point fits above the site: alpha has to be at least {alpha.least:.6g} m "
            f"({_WORDS[alpha.least_by]}) and at most {alpha.greatest:.6g} m ({_WORDS[alpha.greatest_by]})"
        )
    beta = beta_bounds(search.case, plane)
    least = max(beta.least, float(above_guide_point(search.case, plane, np.array([alpha.least]))[0]))
    return (
        f"no guide point fits above the body: beta has to be at least {least:.6g} m (the clearance, and "
        f"above the other guide point) and at most {beta.greatest:.6g} m ({_WORDS[beta.greatest_by]})"
    )


def needs(search: GuideSearch, found: Found) -> str:
    """Tell the peak thrust of a curve and its time, in words."""
    case = search.case
    return f"{found.peak_m_s2 * case.spacecraft.mass_kg:.4g} N at {case.tof_s:.6g} s"


def _longer(search: GuideSearch, found: Found) -> str:
    """Tell a longer time that the thrust suffices for, by the paper's rule (Lyu 2026, eq 39)."""
    limit, peak, tof_s = thrust_limit_m_s2(search.case), found.peak_m_s2, search.case.tof_s
    for _ in range(_STRETCHES):
        tof_s *= float(np.sqrt(peak / limit)) * (1.0 + 0.5 * _STRETCHED_ENOUGH)
        longer = prepare_search(replace(search.case, tof_s=tof_s), search.options, search.plane)
        then = search_guide_points(longer)
        if then is None:
            return ""
        peak = then.peak_m_s2
        if peak <= limit:
            return f"{tof_s:.6g} s needs {peak * search.case.spacecraft.mass_kg:.4g} N"
    return ""


def _parameters(search: GuideSearch, found: Found, points_m: np.ndarray) -> dict[str, Parameter]:
    """Every choice, with units, as it stands in the result."""
    plane, options = search.plane, search.options
    return {
        "line_of_sight": "blocked" if plane.blocked else "free",
        "alpha_m": found.alpha_m,
        "beta_m": found.beta_m if plane.blocked else None,
        **_limits("alpha", search.alpha),
        **(_limits("beta", _beta_limits(search, found.alpha_m)) if plane.blocked else {}),
        "obstacle_guide_point_m": points_m[4].tolist(),
        "collision_guide_point_m": points_m[3].tolist(),
        "tangent_point_m": plane.tangent_point_m.tolist(),
        **_angles(plane),
        "frame": [plane.e_x.tolist(), plane.e_y.tolist(), plane.e_z.tolist()],
        "coarse_points": options.coarse_points,
        "fine_points": options.fine_points,
        "samples": options.samples,
        "candidates_checked": found.checked,
        "distances_computed": found.distances,
    }


def _beta_limits(search: GuideSearch, alpha_m: float) -> Bounds:
    """Limits of beta beside a given alpha."""
    bounds = beta_bounds(search.case, search.plane)
    above = float(above_guide_point(search.case, search.plane, np.array([alpha_m]))[0])
    return bounds if above <= bounds.least else replace(bounds, least=above, least_by="guide_point")


def _limits(name: str, bounds: Bounds) -> dict[str, Parameter]:
    return {
        f"{name}_min_m": bounds.least,
        f"{name}_min_by": bounds.least_by,
        f"{name}_max_m": bounds.greatest,
        f"{name}_max_by": bounds.greatest_by,
    }


def _angles(plane: GuidePlane) -> dict[str, Parameter]:
    """Gamma and gamma_s in degrees; None where there is none (at rest, nothing ahead)."""
    angles = {"velocity_angle_deg": plane.velocity_angle_rad, "tangent_angle_deg": plane.tangent_angle_rad}
    return {name: None if np.isnan(angle) else float(np.degrees(angle)) for name, angle in angles.items()}
