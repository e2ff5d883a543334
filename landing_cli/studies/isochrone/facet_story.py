"""What is known about one facet over the times of flight, in a sentence and as a table."""

from __future__ import annotations

from typing import Any

import numpy as np

from landing_cli.errors import InputRefused
from landing_cli.reach.records import Verdict
from landing_cli.studies.isochrone.records import FACET_COLUMNS, INTERVAL_COLUMNS, End, Rows, StateResult

Row = Any  # one row of FACET_DTYPE or INTERVAL_DTYPE


def intervals_of_facet(result: StateResult, facet: int) -> Rows:
    """Return the intervals of a facet.

    Parameters
    ----------
    result : StateResult
        What was found for an initial state.
    facet : int
        0-based.

    Raises
    ------
    InputRefused
        If there is no such facet.
    """
    count = len(result.facets)
    if not 0 <= facet < count:
        raise InputRefused("no such facet", where=f"--facet {facet}", fix=f"take one of 0 to {count - 1}")
    return result.intervals[result.intervals["facet"] == facet]


def tell_facet(result: StateResult, facet: int) -> str:
    """Say in one sentence when a facet is reachable.

    Parameters
    ----------
    result : StateResult
        What was found for an initial state.
    facet : int
        0-based.

    Raises
    ------
    InputRefused
        If there is no such facet.
    """
    intervals = intervals_of_facet(result, facet)
    reachable = intervals[intervals["verdict"] == Verdict.REACHABLE]
    unknown = intervals[intervals["verdict"] == Verdict.UNRESOLVED]
    lost = sum(one.facet == facet for one in result.lost)
    parts = [_verdict(result, facet, reachable)]
    if len(reachable) > 1:
        parts.append(_in_between(result, facet, reachable))
    if len(unknown):
        parts.append(f"unresolved {', '.join(_stretch(row, result) for row in unknown)}")
    if lost:
        parts.append(f"{lost} questions were lost")
    known = result.facets[facet]
    if np.isfinite(known["least_delta_v_m_s"]):
        parts.append(
            f"least delta-v on the grid {known['least_delta_v_m_s']:.4g} m/s at "
            f"{known['least_delta_v_tof_s']:g} s"
        )
    return "; ".join(parts)


def facet_facts(result: StateResult, facet: int) -> dict[str, Any]:
    """Every stored number of a facet by name, enumerations in words, and its intervals as a list.

    Parameters
    ----------
    result : StateResult
        What was found for an initial state.
    facet : int
        0-based.
    """
    intervals = intervals_of_facet(result, facet)
    told = {c.name: _plain(result.facets[facet], c) for c in FACET_COLUMNS}
    listed = [{c.name: _plain(row, c) for c in INTERVAL_COLUMNS if c.name != "facet"} for row in intervals]
    return {**told, "interval_list": listed}


def _verdict(result: StateResult, facet: int, reachable: Rows) -> str:
    told = f"facet {facet} is"
    if len(reachable):
        return f"{told} reachable {', and '.join(_stretch(row, result) for row in reachable)}"
    times = result.grid.tof_s
    span = f"at any of {len(times)} times from {times[0]:g} to {times[-1]:g} s"
    verdicts = result.answers.verdict[:, facet]
    if (verdicts == Verdict.UNRESOLVED).any():
        return f"{told} not known to be reachable {span}"
    proved = int(result.answers.proved[:, facet].sum())
    share = "proved" if proved == len(times) else f"proved at {proved} of them"
    return f"{told} not reachable {span} ({share})"


def _in_between(result: StateResult, facet: int, reachable: Rows) -> str:
    """Say how many of the grid's times between the intervals are proved out of reach."""
    tof_s = result.grid.tof_s
    within = (tof_s > reachable["begin_s"].min()) & (tof_s < reachable["end_s"].max())
    gone = within & (result.answers.verdict[:, facet] == Verdict.UNREACHABLE)
    proved = int(result.answers.proved[gone, facet].sum())
    return f"unreachable at {int(gone.sum())} of the times asked in between, {proved} of them proved"


def _stretch(row: Row, result: StateResult) -> str:
    """Say from when to when, and what is at either end."""
    begin = {
        End.OPEN: f"from {row['begin_s']:g} s or before (the range begins there: open)",
        End.REACHED: f"from {row['begin_s']:.6g} s (not at {row['before_s']:.6g} s)",
        End.UNRESOLVED: f"from {row['begin_s']:.6g} s (unresolved at {row['before_s']:.6g} s)",
    }
    end = {
        End.OPEN: f"to {row['end_s']:g} s or beyond (the range ends there: open)",
        End.REACHED: f"to {row['end_s']:.6g} s (not at {row['after_s']:.6g} s)",
        End.UNRESOLVED: f"to {row['end_s']:.6g} s (unresolved at {row['after_s']:.6g} s)",
    }
    return f"{begin[End(int(row['begin']))]} {end[End(int(row['end']))]}"


def _plain(row: Row, column: Any) -> Any:
    value = row[column.name].tolist()
    return value if column.flags is None else column.flags(value).name.lower()
