"""The numbers that an initial state is summed up in, and how its domain grows with the time of flight."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.mesh import Mesh, facet_areas
from landing_cli.reach.records import Verdict
from landing_cli.studies.isochrone.records import End, GridAnswers, Rows
from landing_cli.studies.isochrone.time_grid import TimeGrid


def summarise(mesh: Mesh, grid: TimeGrid, facets: Rows, intervals: Rows) -> dict[str, Any]:
    """Sum up the facets of an initial state.

    Parameters
    ----------
    mesh : Mesh
        The asteroid's surface.
    grid : TimeGrid
        The times asked.
    facets : structured array of FACET_DTYPE
        Every facet.
    intervals : structured array of INTERVAL_DTYPE
        Their intervals.

    Returns
    -------
    dict
        ``reachable`` counts facets that are reachable at some time of the range, ``several`` those with more
        than one interval, ``lost_again`` those out of reach again at the longest time asked;
        ``first_tof_s`` spreads the first times of the reachable facets, ``open_from_start`` counts those
        that were reachable at the shortest time already.
    """
    reachable = facets["verdict"] == Verdict.REACHABLE
    known = facets[reachable]
    return {
        "tof_min_s": float(grid.tof_s[0]),
        "tof_max_s": float(grid.tof_s[-1]),
        "times": len(grid.tof_s),
        "resolution_s": grid.finest_s,
        "facets": len(facets),
        "reachable": int(reachable.sum()),
        "unreachable": int((facets["verdict"] == Verdict.UNREACHABLE).sum()),
        "unresolved": int((facets["verdict"] == Verdict.UNRESOLVED).sum()),
        "several": int((facets["intervals"] > 1).sum()),
        "lost_again": int((known["end"] == End.REACHED).sum()),
        "open_from_start": int((known["begin"] == End.OPEN).sum()),
        "unresolved_intervals": int((intervals["verdict"] == Verdict.UNRESOLVED).sum()),
        "reachable_area_m2": float(facet_areas(mesh)[reachable].sum()),
        "first_tof_s": _spread(known["first_tof_s"]),
    }


def growth(mesh: Mesh, grid: TimeGrid, answers: GridAnswers) -> list[dict[str, Any]]:
    """Tell how the domain grows: facets and area at the grid's times.

    Parameters
    ----------
    mesh : Mesh
        The asteroid's surface.
    grid : TimeGrid
        The times.
    answers : GridAnswers
        The verdicts at them.

    Returns
    -------
    list of dict
        One a time: ``tof_s``, ``reachable``, ``unreachable``, ``proved``, ``unresolved``,
        ``reachable_area_m2``.
    """
    reachable = answers.verdict == Verdict.REACHABLE
    columns = {
        "reachable": reachable.sum(axis=1),
        "unreachable": (answers.verdict == Verdict.UNREACHABLE).sum(axis=1),
        "proved": answers.proved.sum(axis=1, dtype=np.int64),
        "unresolved": (answers.verdict == Verdict.UNRESOLVED).sum(axis=1),
    }
    area = reachable @ facet_areas(mesh)
    return [
        {
            "tof_s": tof_s,
            **{name: int(column[k]) for name, column in columns.items()},
            "reachable_area_m2": float(area[k]),
        }
        for k, tof_s in enumerate(grid.tof_s.tolist())
    ]


def _spread(values: NDArray[np.float64]) -> dict[str, float | None]:
    if len(values) == 0:
        return {"min": None, "median": None, "max": None}
    return {"min": float(values.min()), "median": float(np.median(values)), "max": float(values.max())}
