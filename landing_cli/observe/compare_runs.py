"""What came out differently in two observation runs."""

from __future__ import annotations

from typing import Any

from landing_cli.errors import InputRefused
from landing_cli.observe.stored import ObserveRun


def compare_runs(before: ObserveRun, after: ObserveRun) -> list[dict[str, Any]]:
    """Compare two runs, observation by observation.

    Parameters
    ----------
    before, after : ObserveRun
        The earlier and the later one.

    Returns
    -------
    list of dict
        A row for every observation that both hold.

    Raises
    ------
    InputRefused
        If they have no observation in common.
    """
    old = {entry.name: entry.observation.steered for entry in before.cases}
    rows = []
    for entry in after.cases:
        if entry.name in old:
            was, now = old[entry.name], entry.observation.steered
            status = (was.path.status, now.path.status)
            index = was.path.performance_index_m2_s3
            rows.append(
                {
                    "name": entry.name,
                    "status": status[0] if status[0] == status[1] else " -> ".join(status),
                    "performance_index_before_m2_s3": index,
                    "performance_index_change_m2_s3": now.path.performance_index_m2_s3 - index,
                    "distinct_change": now.seen.distinct - was.seen.distinct,
                    "mean_in_view_change": now.seen.mean_in_view - was.seen.mean_in_view,
                    "mean_position_sigma_change_m": now.sigma.mean_m - was.sigma.mean_m,
                }
            )
    if not rows:
        raise InputRefused("the results have no observation in common", fix="compare runs of one scenario")
    return rows
