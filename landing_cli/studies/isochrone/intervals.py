"""From verdicts at single times to intervals, and from intervals to a facet's numbers and to the domain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.records import Verdict
from landing_cli.studies.isochrone.records import (
    FACET_DTYPE,
    INTERVAL_DTYPE,
    End,
    GridAnswers,
    Rows,
)
from landing_cli.studies.isochrone.time_grid import TimeGrid

IntArray = NDArray[np.int64]
FloatArray = NDArray[np.float64]


def intervals_of(grid: TimeGrid, facet: IntArray, place: IntArray, verdict: NDArray[np.uint8]) -> Rows:
    """Join samples of equal verdict that follow each other.

    Parameters
    ----------
    grid : TimeGrid
        The ladder.
    facet, place, verdict : (n,) int
        All samples of one initial state; each facet has those of the whole grid.

    Returns
    -------
    (k,) structured array of INTERVAL_DTYPE
        Reachable and unresolved intervals, by facet, then by time.
    """
    order = np.lexsort((place, facet))
    facet, place, verdict = facet[order], place[order], verdict[order]
    new_facet = np.diff(facet, prepend=-1) != 0
    begins = np.flatnonzero(new_facet | (np.diff(verdict.astype(np.int64), prepend=-1) != 0))
    ends = np.append(begins[1:], len(facet)) - 1
    first, last = new_facet[begins], np.append(new_facet[ends[:-1] + 1], True)
    time = grid.times_s(place)
    rows = np.zeros(len(begins), dtype=INTERVAL_DTYPE)
    rows["facet"], rows["verdict"] = facet[begins], verdict[begins]
    rows["begin_s"], rows["end_s"] = time[begins], time[ends]
    rows["before_s"] = np.where(first, np.nan, time[np.maximum(begins - 1, 0)])
    rows["after_s"] = np.where(last, np.nan, time[np.minimum(ends + 1, len(time) - 1)])
    rows["begin"] = _kind(first, np.roll(rows["verdict"], 1), rows["verdict"])
    rows["end"] = _kind(last, np.roll(rows["verdict"], -1), rows["verdict"])
    return rows[rows["verdict"] != Verdict.UNREACHABLE]


def _kind(edge: NDArray[np.bool_], neighbour: NDArray[np.uint8], own: NDArray[np.uint8]) -> NDArray[np.int64]:
    """What an end is, by what lies beyond it."""
    unknown = (neighbour == Verdict.UNRESOLVED) & (own != Verdict.UNRESOLVED)
    return np.where(edge, int(End.OPEN), np.where(unknown, int(End.UNRESOLVED), int(End.REACHED)))


def facet_numbers(grid: TimeGrid, answers: GridAnswers, intervals: Rows) -> Rows:
    """Sum up every facet's intervals.

    Parameters
    ----------
    grid : TimeGrid
        The times.
    answers : GridAnswers
        What was found at them.
    intervals : structured array of INTERVAL_DTYPE
        Of all facets.

    Returns
    -------
    (m,) structured array of FACET_DTYPE
    """
    count = answers.verdict.shape[1]
    rows = np.zeros(count, dtype=FACET_DTYPE)
    rows["facet"] = np.arange(count)
    for name in ("first_tof_s", "last_tof_s", "least_delta_v_m_s", "least_delta_v_tof_s"):
        rows[name] = np.nan
    known = intervals["verdict"] == Verdict.REACHABLE
    length = intervals["end_s"] - intervals["begin_s"]
    for name, chosen in (("reachable_s", known), ("unresolved_s", ~known)):
        rows[name] = np.bincount(intervals["facet"][chosen], length[chosen], count)
    rows["verdict"] = Verdict.UNREACHABLE
    rows["verdict"][intervals["facet"][~known]] = Verdict.UNRESOLVED
    reachable = intervals[known]
    rows["intervals"] = np.bincount(reachable["facet"], minlength=count)
    facets, first = np.unique(reachable["facet"], return_index=True)
    last = np.append(first[1:], len(reachable)) - 1 if len(first) else first
    rows["verdict"][facets] = Verdict.REACHABLE
    rows["first_tof_s"][facets], rows["begin"][facets] = (
        reachable["begin_s"][first],
        reachable["begin"][first],
    )
    rows["last_tof_s"][facets], rows["end"][facets] = reachable["end_s"][last], reachable["end"][last]
    flown = np.isfinite(answers.delta_v_m_s).any(axis=0)
    cheapest = np.nanargmin(answers.delta_v_m_s[:, flown], axis=0)
    rows["least_delta_v_m_s"][flown] = answers.delta_v_m_s[cheapest, np.flatnonzero(flown)]
    rows["least_delta_v_tof_s"][flown] = grid.tof_s[cheapest]
    return rows


def interval_at(intervals: Rows, facets: int, tof_s: float) -> tuple[IntArray, NDArray[np.uint8]]:
    """Find the interval of every facet that holds a time of flight, and the verdict there.

    Parameters
    ----------
    intervals : structured array of INTERVAL_DTYPE
        By facet, then by time.
    facets : int
        Facets of the mesh.
    tof_s : float, s
        Within the range.

    Returns
    -------
    row : (m,) int
        Index into the intervals; -1 where none holds it.
    verdict : (m,) uint8
        Unresolved also between the two sides of an interval's end.
    """
    row = np.full(facets, -1, dtype=np.int64)
    verdict = np.full(facets, int(Verdict.UNREACHABLE), dtype=np.uint8)
    before = (intervals["before_s"] < tof_s) & (tof_s < intervals["begin_s"])
    after = (intervals["end_s"] < tof_s) & (tof_s < intervals["after_s"])
    verdict[intervals["facet"][before | after]] = Verdict.UNRESOLVED
    within = np.flatnonzero((intervals["begin_s"] <= tof_s) & (tof_s <= intervals["end_s"]))
    row[intervals["facet"][within]] = within
    verdict[intervals["facet"][within]] = intervals["verdict"][within]
    return row, verdict


def reachable_area(intervals: Rows, area_m2: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How much of the surface is known to be reachable at every time of flight.

    Parameters
    ----------
    intervals : structured array of INTERVAL_DTYPE
        Of all facets.
    area_m2 : (m,) float, m2
        Area of each facet.

    Returns
    -------
    tof_s : (n,) float, s
        Times at which an interval begins, or has just ended, ascending.
    reachable_m2 : (n,) float, m2
        Area that is reachable from that time up to the next.
    """
    known = intervals[intervals["verdict"] == Verdict.REACHABLE]
    area = area_m2[known["facet"]]
    times = np.concatenate([known["begin_s"], np.nextafter(known["end_s"], np.inf)])
    change = np.concatenate([area, -area])
    tof_s, where = np.unique(times, return_inverse=True)
    return tof_s, np.cumsum(np.bincount(where, change, len(tof_s)))
