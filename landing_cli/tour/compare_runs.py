"""What came out differently in two tours."""

from __future__ import annotations

from typing import Any

from landing_cli.errors import InputRefused
from landing_cli.flight.astronomy import DAY_S
from landing_cli.tour.escape_records import EscapeRun
from landing_cli.tour.run_records import TourRun


def compare_runs(before: TourRun | EscapeRun, after: TourRun | EscapeRun) -> list[dict[str, Any]]:
    """Compare two runs, sequence of asteroids by sequence.

    Parameters
    ----------
    before, after : TourRun or EscapeRun
        The earlier and the later one.

    Returns
    -------
    list of dict
        A row for every sequence that both hold.

    Raises
    ------
    InputRefused
        If they have no sequence in common, or are no searches.
    """
    if isinstance(before, EscapeRun) or isinstance(after, EscapeRun):
        raise InputRefused("an escape run has no chains", fix="compare results of `tour search`")
    old = {entry.chain.targets: entry for entry in before.cases}
    rows = []
    for entry in after.cases:
        was = old.get(entry.chain.targets)
        if was is not None:
            change = entry.chain.nbody_delta_v_m_s - was.chain.nbody_delta_v_m_s
            rows.append(
                {
                    "name": entry.name if entry.name == was.name else f"{was.name} -> {entry.name}",
                    "targets": ", ".join(entry.chain.targets),
                    "nbody_delta_v_before_m_s": was.chain.nbody_delta_v_m_s,
                    "nbody_delta_v_change_m_s": change,
                    "duration_change_d": (entry.chain.duration_s - was.chain.duration_s) / DAY_S,
                }
            )
    if not rows:
        raise InputRefused("the results have no sequence of asteroids in common")
    return rows
