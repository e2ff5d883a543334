"""The numbers that a plan and a sweep are summed up in."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from landing_cli.plan.stored import PlanEntry


def summarise(entry: PlanEntry) -> dict[str, Any]:
    """Sum up a plan, as ``plan * --json`` prints it.

    Parameters
    ----------
    entry : PlanEntry
        The plan and what was asked.

    Returns
    -------
    dict
        The contract's fields, then the method's own parameters under their own names.
    """
    plan, case = entry.plan, entry.case
    told = {
        "name": entry.name,
        "method": plan.method,
        "status": plan.status,
        "message": plan.message,
        "tof_s": plan.tof_s,
        "fuel_kg": plan.fuel_kg,
        "delta_v_m_s": plan.delta_v_m_s,
        "peak_thrust_n": plan.peak_thrust_n,
        "clearance_min_m": plan.clearance_min_m,
        "clearance_metric": plan.clearance_metric,
        "clearance_required_m": case.clearance_m,
        "clearance_surface_m": plan.clearance_surface_m,
        "clearance_vertices_m": plan.clearance_vertices_m,
        "landing_angle_deg": plan.landing_angle_deg,
        "cone_entry_s": plan.cone_entry_s,
        "cpu_s": entry.cpu_s,
        "iterations": plan.iterations,
        "site_m": case.site.position_m,
        "site_normal": case.site.normal,
        "site_facet": case.site.facet if case.site.facet >= 0 else None,
        "mass_model": case.mass_model,
    }
    return told | {key: value for key, value in plan.parameters.items() if key not in told}


def is_sweep(entries: Sequence[PlanEntry]) -> bool:
    """Tell whether plans are those of a sweep over initial positions."""
    return all("longitude_deg" in entry.plan.parameters for entry in entries)


def summarise_sweep(entries: Sequence[PlanEntry]) -> dict[str, Any]:
    """Sum up a sweep over initial positions.

    Parameters
    ----------
    entries : sequence of PlanEntry
        Its plans.

    Returns
    -------
    dict
        Counts and shares; ``geometric`` counts what only the thrust bound refuses too; ``refusals`` counts
        the causes.
    """
    planned = [entry for entry in entries if entry.plan.status == "planned"]
    causes = Counter(cause_of(entry) for entry in entries if entry.plan.status != "planned")
    geometric = len(planned) + causes.get("thrust", 0)
    return {
        "initial_positions": len(entries),
        "planned": len(planned),
        "planned_share": len(planned) / len(entries),
        "geometric_share": geometric / len(entries),
        "verified": sum(entry.plan.parameters.get("reflight") == "verified" for entry in planned),
        "refusals": dict(sorted(causes.items())),
    }


def cause_of(entry: PlanEntry) -> str:
    """Name what refuses a plan, in one word."""
    return str(entry.plan.parameters.get("refused_by", entry.plan.status))
