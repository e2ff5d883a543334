"""Whether a stored study can be true: what code and printers take for granted, asked of every file."""

from __future__ import annotations

from math import pi

import numpy as np

from landing_cli.reach.records import Verdict
from landing_cli.reach.stored_checks import check_choices, check_printable, check_summary
from landing_cli.results.body_checks import bounded, positive
from landing_cli.results.columns import Column
from landing_cli.scenario.schema_isochrone import MOST_HALVINGS, MOST_STEPS
from landing_cli.studies.isochrone.records import FACET_COLUMNS, INTERVAL_COLUMNS, End, Rows, StateResult
from landing_cli.studies.isochrone.summary import summarise
from landing_cli.studies.isochrone.time_grid import TimeGrid

# what a scenario may ask for at most
_LONGEST_S, _FARTHEST_M, _FASTEST_M_S = 1e7, 1e9, 1e6
_MOST_TIMES = 2 * MOST_STEPS  # with those of the scenario's own


def check_times(grid: TimeGrid) -> None:
    """Hold a grid to times that ascend, and to a ladder that can be counted.

    Parameters
    ----------
    grid : TimeGrid
        As it was read.

    Raises
    ------
    ValueError
        If it is none.
    """
    times = grid.tof_s
    if times.dtype != np.float64 or times.ndim != 1 or not 2 <= len(times) <= _MOST_TIMES:
        raise ValueError("tof_s is no list of times")
    positive("tof_s", times, _LONGEST_S)
    if not (np.diff(times) > 0.0).all():
        raise ValueError("tof_s does not ascend")
    if not 0 <= grid.halvings <= MOST_HALVINGS + 1:
        raise ValueError("halvings is out of range")


def check_state(result: StateResult) -> None:
    """Hold what was found for an initial state to what can have been asked and answered.

    Parameters
    ----------
    result : StateResult
        As it was read.

    Raises
    ------
    ValueError
        If a quantity is impossible, a choice unknown, or a facet not of this body.
    """
    case, count = result.case, len(result.case.asteroid.mesh.faces)
    for name in ("tof_s", "final_stage_s"):
        positive(name, getattr(case, name), _LONGEST_S)
    positive("ellipsoid_m", case.ellipsoid_m, _FARTHEST_M)
    bounded("position_m", case.position_m, _FARTHEST_M)
    bounded("velocity_m_s", case.velocity_m_s, _FASTEST_M_S)
    if not 0.0 < case.glide_slope_half_angle_rad <= pi / 2:
        raise ValueError("glide_slope_half_angle_rad is not between 0 and pi/2")
    check_choices(case)
    if not case.final_stage_s < result.grid.tof_s[0]:
        raise ValueError("final_stage_s is longer than the shortest time of flight")
    if case.tof_s != result.grid.tof_s[-1]:
        raise ValueError("tof_s is not the longest time of flight")
    if result.answers.verdict.shape[1] != count or not np.isin(result.answers.verdict, list(Verdict)).all():
        raise ValueError("the grid's verdicts are not of this body, or without a meaning")
    for name in ("proved", "performance_index_m2_s3", "delta_v_m_s"):
        if getattr(result.answers, name).shape != result.answers.verdict.shape:
            raise ValueError(f"grid/{name} does not tell of every facet")
    _check_facets(result.facets, count)
    _check_intervals(result.intervals, count, result.grid)
    for one in result.lost:
        if not (isinstance(one.facet, int) and 0 <= one.facet < count and isinstance(one.tof_s, float)):
            raise ValueError("lost names what does not exist")
    check_printable("summary", result.summary)
    known = summarise(case.asteroid.mesh, result.grid, result.facets, result.intervals)
    check_summary(result.summary, known)


def _check_facets(rows: Rows, count: int) -> None:
    if not np.array_equal(rows["facet"], np.arange(count)):
        raise ValueError("the facets are not those of the body in their order")
    _check_flags(rows, FACET_COLUMNS)
    if (rows["intervals"] < 0).any():
        raise ValueError("a facet has a negative number of intervals")
    for column in FACET_COLUMNS:
        if column.dtype == "f8" and not (~(np.abs(rows[column.name]) > _LONGEST_S)).all():
            raise ValueError(f"{column.name} holds an absurd number")


def _check_intervals(rows: Rows, count: int, grid: TimeGrid) -> None:
    """Intervals of facets that exist, apart from each other, ascending, with two sides to their ends."""
    _check_flags(rows, INTERVAL_COLUMNS)
    facet, begin, end = rows["facet"], rows["begin_s"], rows["end_s"]
    if len(rows) and not 0 <= facet.min() <= facet.max() < count:
        raise ValueError("an interval is of a facet that does not exist")
    if not ((grid.tof_s[0] <= begin) & (begin <= end) & (end <= grid.tof_s[-1])).all():
        raise ValueError("an interval is beyond the times asked")
    later = (np.diff(facet) > 0) | ((np.diff(facet) == 0) & (begin[1:] > end[:-1]))
    if not later.all():
        raise ValueError("the intervals do not ascend")
    for side, kind, sound in (
        (rows["before_s"], rows["begin"], rows["before_s"] < begin),
        (rows["after_s"], rows["end"], rows["after_s"] > end),
    ):
        if (kind == End.NONE).any():
            raise ValueError("an interval has no end")
        if not np.where(kind == End.OPEN, np.isnan(side), sound).all():
            raise ValueError("an end of an interval has no other side, or one too many")


def _check_flags(rows: Rows, columns: tuple[Column, ...]) -> None:
    for column in columns:
        if column.flags is not None and not np.isin(rows[column.name], list(column.flags)).all():
            raise ValueError(f"{column.name} holds a value without a meaning")
