"""An isochrone study as a tree on disk."""

from __future__ import annotations

from typing import Any

import numpy as np

from landing_cli.body.asteroid import Asteroid
from landing_cli.errors import InputRefused
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.records import Verdict
from landing_cli.reach.stored import case_from_attributes, case_to_attributes
from landing_cli.results.body_checks import check_spacecraft
from landing_cli.results.body_group import body_from_group, body_to_group, number
from landing_cli.results.store import StoredResult
from landing_cli.results.tree import (
    Dataset,
    Group,
    flag_words,
    group_to_mapping,
    mapping_to_group,
    table_group,
    table_rows,
)
from landing_cli.studies.isochrone.records import (
    FACET_COLUMNS,
    INTERVAL_COLUMNS,
    GridAnswers,
    IsochroneRun,
    Lost,
    StateResult,
)
from landing_cli.studies.isochrone.stored_checks import check_state, check_times
from landing_cli.studies.isochrone.time_grid import TimeGrid

MISSION = "isochrone"

_OVER_GRID = ("tof_s", "facet")


def run_to_tree(run: IsochroneRun) -> Group:
    """Lay a study out for the store.

    Parameters
    ----------
    run : IsochroneRun
        With at least one initial state.

    Returns
    -------
    Group
        With the groups ``body``, ``spacecraft`` and ``cases``.
    """
    craft = {name: value for name, value in vars(run.spacecraft).items() if value is not None}
    cases = {result.case.name: _state_to_group(result, order) for order, result in enumerate(run.cases)}
    return Group(
        {"body": body_to_group(run.asteroid), "spacecraft": Group({}, craft), "cases": Group(cases)},
        {"mission": MISSION},
    )


def run_from_result(result: StoredResult) -> IsochroneRun:
    """Rebuild a study from its file.

    Parameters
    ----------
    result : StoredResult
        As it was read.

    Returns
    -------
    IsochroneRun
        Equal to the study that was stored.

    Raises
    ------
    InputRefused
        If the file is of another mission, lacks a part, or holds what no study can have found.
    """
    if result.mission != MISSION:
        told = f"holds a result of '{result.mission}', not of '{MISSION}'"
        raise InputRefused(told, where=str(result.path), fix="name a file that `reach isochrone` wrote")
    try:
        return _run_from_tree(result.tree)
    except (KeyError, ValueError, TypeError, IndexError, OverflowError) as error:
        raise InputRefused(
            f"lacks a part or holds a wrong one: {error}",
            where=str(result.path),
            fix="run again with --force, or use the version that wrote it",
        ) from error


def _run_from_tree(tree: Group) -> IsochroneRun:
    asteroid = body_from_group(tree.group("body"))
    craft = Spacecraft(**tree.group("spacecraft").attributes)  # type: ignore[arg-type]
    check_spacecraft(craft)
    groups = {name: tree.group("cases", name) for name in tree.group("cases").members}
    ordered = sorted(groups, key=lambda name: number(groups[name], "order"))
    cases = tuple(_state_from_group(name, groups[name], asteroid, craft) for name in ordered)
    if not cases:
        raise ValueError("no case")
    for case in cases:
        check_state(case)
    return IsochroneRun(cases)


def _state_to_group(result: StateResult, order: int) -> Group:
    attributes: dict[str, Any] = {"order": order, **case_to_attributes(result.case)}
    members: dict[str, Dataset | Group] = {
        "facets": table_group(result.facets, FACET_COLUMNS, "facet"),
        "intervals": table_group(result.intervals, INTERVAL_COLUMNS, "interval"),
        "grid": _grid_to_group(result.grid, result.answers),
        "summary": mapping_to_group(result.summary),
    }
    if result.lost:
        members["lost"] = _lost_to_group(result.lost)
    return Group(members, attributes)


def _grid_to_group(grid: TimeGrid, answers: GridAnswers) -> Group:
    told = {
        "verdict": ("1", "what `reach run` finds at this time of flight", flag_words(Verdict)),
        "proved": ("1", "1 where an unreachable facet is certified by a dual bound", None),
        "performance_index_m2_s3": ("m2 s-3", "two-stage energy J; NaN where not reachable", None),
        "delta_v_m_s": ("m s-1", "velocity increment of the thrust; NaN where not reachable", None),
    }
    members: dict[str, Dataset | Group] = {
        name: Dataset(getattr(answers, name), units, description, _OVER_GRID, flags)
        for name, (units, description, flags) in told.items()
    }
    members["tof_s"] = Dataset(grid.tof_s, "s", "times of flight asked of every facet", ("tof_s",))
    return Group(members, {"halvings": grid.halvings})


def _lost_to_group(lost: tuple[Lost, ...]) -> Group:
    facets = np.array([one.facet for one in lost], dtype=np.int32)
    times = np.array([one.tof_s for one in lost])
    reasons = np.array([one.reason for one in lost])
    return Group(
        {
            "facet": Dataset(facets, "1", "facets of questions that could not be answered", ("question",)),
            "tof_s": Dataset(times, "s", "at which time of flight, or in the step from it", ("question",)),
            "reason": Dataset(reasons, "1", "why", ("question",)),
        }
    )


def _state_from_group(name: str, group: Group, asteroid: Asteroid, craft: Spacecraft) -> StateResult:
    grid, answers = _grid_from_group(group.group("grid"))
    lost: tuple[Lost, ...] = ()
    if "lost" in group.members:
        table = group.group("lost")
        columns = (table.dataset(key).data.tolist() for key in ("facet", "tof_s", "reason"))
        lost = tuple(Lost(*row) for row in zip(*columns, strict=True))
    return StateResult(
        case_from_attributes(name, group, asteroid, craft),
        grid,
        answers,
        table_rows(group.group("intervals"), INTERVAL_COLUMNS),
        table_rows(group.group("facets"), FACET_COLUMNS),
        group_to_mapping(group.group("summary")),
        lost,
    )


def _grid_from_group(group: Group) -> tuple[TimeGrid, GridAnswers]:
    grid = TimeGrid(group.dataset("tof_s").data, int(number(group, "halvings")))
    check_times(grid)
    kinds = {"verdict": "u1", "proved": "u1", "performance_index_m2_s3": "f8", "delta_v_m_s": "f8"}
    columns = {}
    for name, kind in kinds.items():
        data = group.dataset(name).data
        if data.dtype != np.dtype(kind) or data.ndim != 2 or len(data) != len(grid.tof_s):
            raise ValueError(f"grid/{name} is {data.dtype} {data.shape}")
        columns[name] = data
    return grid, GridAnswers(**columns)
