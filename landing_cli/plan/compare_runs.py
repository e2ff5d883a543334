"""What came out differently in two plan runs."""

from __future__ import annotations

from typing import Any

from landing_cli.errors import InputRefused
from landing_cli.plan.stored import PlanRun


def compare_runs(before: PlanRun, after: PlanRun) -> list[dict[str, Any]]:
    """Compare two runs, plan by plan.

    Parameters
    ----------
    before, after : PlanRun
        The earlier and the later one.

    Returns
    -------
    list of dict
        A row for every plan that both hold.

    Raises
    ------
    InputRefused
        If they have no plan in common.
    """
    old = {entry.name: entry.plan for entry in before.cases}
    rows = []
    for entry in after.cases:
        if entry.name in old:
            was, now = old[entry.name], entry.plan
            rows.append(
                {
                    "name": entry.name,
                    "status": now.status if was.status == now.status else f"{was.status} -> {now.status}",
                    "fuel_before_kg": was.fuel_kg,
                    "fuel_change_kg": now.fuel_kg - was.fuel_kg,
                    "peak_thrust_change_n": now.peak_thrust_n - was.peak_thrust_n,
                    "clearance_change_m": now.clearance_min_m - was.clearance_min_m,
                }
            )
    if not rows:
        raise InputRefused("the results have no plan in common", fix="compare plans of one command")
    return rows
