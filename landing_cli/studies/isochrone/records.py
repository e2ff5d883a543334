"""What an isochrone study asks and finds: samples, intervals, and a facet's numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.records import LandingCase, Verdict
from landing_cli.results.columns import Column
from landing_cli.studies.isochrone.time_grid import TimeGrid

FloatArray = NDArray[np.float64]
Rows = NDArray[np.void]


class End(IntEnum):
    """What an end of an interval is; none where there is no interval."""

    NONE = 0
    REACHED = 1
    OPEN = 2
    UNRESOLVED = 3


# One question: a facet at a place of the ladder, of one initial state (see `work`).
SAMPLE_DTYPE = np.dtype(
    [
        ("item", "i8"),
        ("verdict", "u1"),
        ("proved", "u1"),
        ("performance_index_m2_s3", "f8"),
        ("delta_v_m_s", "f8"),
    ]
)

INTERVAL_COLUMNS: tuple[Column, ...] = (
    Column("facet", "i4", "1", "facet, 0-based, in the shape file's order; its intervals ascend"),
    Column("verdict", "u1", "1", "reachable or unresolved; between intervals it is neither", flags=Verdict),
    Column("begin_s", "f8", "s", "shortest time of flight of the interval that was asked"),
    Column("end_s", "f8", "s", "longest time of flight of the interval that was asked"),
    Column("before_s", "f8", "s", "time asked just before, of another verdict; NaN where the range begins"),
    Column("after_s", "f8", "s", "time asked just after, of another verdict; NaN where the range ends"),
    Column(
        "begin",
        "u1",
        "1",
        "what the beginning is: reached (unreachable before), open (the range begins), unresolved (before)",
        flags=End,
    ),
    Column("end", "u1", "1", "what the end is, likewise", flags=End),
)
INTERVAL_DTYPE = np.dtype([(c.name, c.dtype) for c in INTERVAL_COLUMNS])

FACET_COLUMNS: tuple[Column, ...] = (
    Column("facet", "i4", "1", "facet, 0-based, in the shape file's order"),
    Column(
        "verdict",
        "u1",
        "1",
        "reachable at some time of the range, unreachable at all that were asked, or neither is known",
        flags=Verdict,
    ),
    Column("intervals", "i4", "1", "number of intervals in which it is reachable"),
    Column("first_tof_s", "f8", "s", "shortest time of flight known to reach it"),
    Column("last_tof_s", "f8", "s", "longest time of flight known to reach it"),
    Column("begin", "u1", "1", "what the first interval's beginning is", flags=End),
    Column("end", "u1", "1", "what the last interval's end is", flags=End),
    Column("reachable_s", "f8", "s", "total length of the intervals in which it is reachable"),
    Column("unresolved_s", "f8", "s", "total length of the intervals that are unresolved"),
    Column("least_delta_v_m_s", "f8", "m s-1", "least velocity increment at the grid's times"),
    Column("least_delta_v_tof_s", "f8", "s", "time of flight of the least velocity increment"),
)
FACET_DTYPE = np.dtype([(c.name, c.dtype) for c in FACET_COLUMNS])


@dataclass(frozen=True, eq=False)
class GridAnswers:
    """What `reach run` finds at the grid's times; (k, m): times by facets.

    Attributes
    ----------
    verdict, proved : (k, m) uint8
    performance_index_m2_s3, delta_v_m_s : (k, m) float
        NaN where the facet is not reachable.
    """

    verdict: NDArray[np.uint8]
    proved: NDArray[np.uint8]
    performance_index_m2_s3: FloatArray
    delta_v_m_s: FloatArray


@dataclass(frozen=True, eq=False)
class Lost:
    """A question that no worker could answer."""

    facet: int
    tof_s: float
    reason: str


@dataclass(frozen=True, eq=False)
class StateResult:
    """What a study found for one initial state.

    Attributes
    ----------
    case : LandingCase
        Named like the state; its time of flight is the longest of the grid.
    grid : TimeGrid
    answers : GridAnswers
    intervals : (n,) structured array of INTERVAL_DTYPE
        By facet, then by time.
    facets : (m,) structured array of FACET_DTYPE
        Every facet of the mesh.
    summary : mapping
        As printed.
    lost : tuple of Lost
    """

    case: LandingCase
    grid: TimeGrid
    answers: GridAnswers
    intervals: Rows
    facets: Rows
    summary: Mapping[str, Any] = field(default_factory=dict)
    lost: tuple[Lost, ...] = ()


@dataclass(frozen=True, eq=False)
class IsochroneRun:
    """An isochrone study: every initial state of one spacecraft over one asteroid.

    Attributes
    ----------
    cases : tuple of StateResult
        At least one, in the scenario's order.
    """

    cases: tuple[StateResult, ...]

    @property
    def asteroid(self) -> Asteroid:
        """The asteroid that all states share."""
        return self.cases[0].case.asteroid

    @property
    def spacecraft(self) -> Spacecraft:
        """The spacecraft that all states share."""
        return self.cases[0].case.spacecraft

    @property
    def lost_items(self) -> int:
        """How many questions could not be answered."""
        return sum(len(case.lost) for case in self.cases)
