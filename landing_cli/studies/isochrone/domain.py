"""The reachable domain at any time of flight, read off a study."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.reach.records import Verdict
from landing_cli.results.columns import Column
from landing_cli.studies.isochrone.intervals import interval_at
from landing_cli.studies.isochrone.records import End, StateResult

DOMAIN_COLUMNS: tuple[Column, ...] = (
    Column("facet", "i4", "1", "facet, 0-based, in the shape file's order"),
    Column("verdict", "u1", "1", "at this time; unresolved between the two sides of an end", flags=Verdict),
    Column("begin_s", "f8", "s", "beginning of the interval that holds this time"),
    Column("end_s", "f8", "s", "its end"),
    Column("begin", "u1", "1", "what its beginning is", flags=End),
    Column("end", "u1", "1", "what its end is", flags=End),
    Column("performance_index_m2_s3", "f8", "m2 s-3", "two-stage energy J, at the grid's times only"),
    Column("delta_v_m_s", "f8", "m s-1", "velocity increment, at the grid's times only"),
)
DOMAIN_DTYPE = np.dtype([(c.name, c.dtype) for c in DOMAIN_COLUMNS])


@dataclass(frozen=True, eq=False)
class Domain:
    """The domain from one initial state in one time of flight.

    Attributes
    ----------
    name : str
        As `reach run` would call the case.
    tof_s : float, s
    rows : (m,) structured array of DOMAIN_DTYPE
    """

    name: str
    tof_s: float
    rows: NDArray[np.void]


def domain_at(result: StateResult, tof_s: float) -> Domain:
    """Read the domain at a time of flight off the intervals.

    Parameters
    ----------
    result : StateResult
        What was found for an initial state.
    tof_s : float, s
        Within the range; at the grid's times the verdicts are those of `reach run`.

    Returns
    -------
    Domain

    Raises
    ------
    InputRefused
        If the time lies beyond the range.
    """
    first, last = float(result.grid.tof_s[0]), float(result.grid.tof_s[-1])
    if not first <= tof_s <= last:
        fix = f"take a time from {first:g} to {last:g} s, or run again with another --tof-s"
        raise InputRefused(
            "the study does not cover this time of flight", where=f"--tof-s {tof_s:g}", fix=fix
        )
    count = len(result.facets)
    row, verdict = interval_at(result.intervals, count, tof_s)
    rows = np.zeros(count, dtype=DOMAIN_DTYPE)
    rows["facet"], rows["verdict"] = np.arange(count), verdict
    for name in ("begin_s", "end_s", "performance_index_m2_s3", "delta_v_m_s"):
        rows[name] = np.nan
    within = row >= 0
    for name in ("begin_s", "end_s", "begin", "end"):
        rows[name][within] = result.intervals[name][row[within]]
    on_grid = np.flatnonzero(result.grid.tof_s == tof_s)
    if len(on_grid):
        for name in ("performance_index_m2_s3", "delta_v_m_s"):
            rows[name] = getattr(result.answers, name)[on_grid[0]]
    return Domain(f"{result.case.name}_{tof_s:.12g}s", tof_s, rows)
