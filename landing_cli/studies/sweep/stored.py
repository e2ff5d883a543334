"""A sweep as a tree on disk: one group over the axes, the initial states and the facets."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.errors import InputRefused
from landing_cli.reach.records import Verdict
from landing_cli.results.body_group import body_from_group, body_to_group
from landing_cli.results.store import StoredResult
from landing_cli.results.tree import Dataset, Group, flag_words
from landing_cli.scenario.build import Surface
from landing_cli.scenario.document import Document
from landing_cli.scenario.sections import reach_section
from landing_cli.studies.sweep.axes import Axis, named
from landing_cli.studies.sweep.grid import MOST_CELLS, Grid, Question
from landing_cli.studies.sweep.records import CELL_COLUMNS, SPREAD, SweepRun, gathered

MISSION = "sweep"
STATE, FACET = "initial_state", "facet"

_COUNTS = {
    "reachable": "reachable facets",
    "unreachable": "unreachable facets",
    "unresolved": "facets of which nothing is known",
    "proved": "unreachable facets certified by a dual bound",
    "paths_through_rock": "reachable facets to which the path cuts the mesh",
}
_SPREADS = {
    "delta_v_m_s": ("m s-1", "velocity increment to the reachable facets"),
    "performance_index_m2_s3": ("m2 s-3", "two-stage energy J of the reachable facets"),
}


def run_to_tree(run: SweepRun) -> Group:
    """Lay a sweep out for the store.

    Parameters
    ----------
    run : SweepRun
        Every case of it.

    Returns
    -------
    Group
        With the groups ``body``, ``question``, ``grid`` and, where facets were lost, ``lost``.
    """
    grid = run.grid
    axes = {
        f"axis_{place}": Group(
            {"values": Dataset(np.array(axis.texts), "1", "values as --set takes them", ("value",))},
            {"key": axis.key},
        )
        for place, axis in enumerate(grid.question.axes)
    }
    asked = {"document": json.dumps(grid.question.document.tree), "source": grid.question.source}
    members: dict[str, Dataset | Group] = {
        "body": body_to_group(run.asteroid),
        "question": Group(axes, {**asked, "axes": len(axes), "shape_sha256": grid.surface.sha256}),
        "grid": Group({**_coordinates(grid), **_summaries(run), **_columns(run)}),
    }
    if run.lost_facets:
        members["lost"] = _lost(run)
    return Group(members, {"mission": MISSION})


def run_from_result(result: StoredResult) -> SweepRun:
    """Rebuild a sweep from its file.

    Parameters
    ----------
    result : StoredResult
        As it was read.

    Returns
    -------
    SweepRun
        Equal to the one that was stored; its landing cases are made when they are asked for.

    Raises
    ------
    InputRefused
        If the file is of another mission, lacks a part, or holds what no sweep can have found.
    """
    if result.mission != MISSION:
        told = f"holds a result of '{result.mission}', not of '{MISSION}'"
        raise InputRefused(told, where=str(result.path), fix="name a file that `reach sweep` wrote")
    try:
        return _run_from_tree(result.tree)
    except (KeyError, ValueError, TypeError, IndexError, OverflowError, AttributeError) as error:
        told = f"lacks a part or holds a wrong one: {error}"
        fix = "run again with --force, or use the version that wrote it"
        raise InputRefused(told, where=str(result.path), fix=fix) from error


def _coordinates(grid: Grid) -> dict[str, Dataset]:
    """The axes, the initial states and the facets, each a dataset along itself."""
    found = {}
    for axis in grid.question.axes:
        found[axis.name] = Dataset(
            np.array(axis.values), axis.units, f"scenario key {axis.key}", (axis.name,)
        )
    found[STATE] = Dataset(np.array(grid.states), "1", "where the descent begins", (STATE,))
    facets = np.arange(grid.facets, dtype=np.int32)
    found[FACET] = Dataset(facets, "1", "facet, 0-based, in the shape file's order", (FACET,))
    return found


def _summaries(run: SweepRun) -> dict[str, Dataset]:
    """One number a cell and initial state."""
    grid = run.grid
    dims = (*(axis.name for axis in grid.question.axes), STATE)
    shape = (*grid.question.shape, len(grid.states))

    def over_cells(values: Iterable[Any], dtype: str) -> NDArray[Any]:
        return np.array([np.nan if v is None else v for v in values], dtype=dtype).reshape(shape)

    found = {
        f"{name}_facets" if name != "paths_through_rock" else name: Dataset(
            over_cells((case.summary[name] for case in run.cases), "i4"), "1", told, dims
        )
        for name, told in _COUNTS.items()
    }
    areas = over_cells((case.summary["reachable_area_m2"] for case in run.cases), "f8")
    found["reachable_area_m2"] = Dataset(areas, "m2", "area of the reachable facets", dims)
    for name, (units, told) in _SPREADS.items():
        for part in SPREAD:
            values = over_cells((case.summary[name][part] for case in run.cases), "f8")
            found[_spread_name(name, part)] = Dataset(values, units, f"{part} {told}", dims)
    return found


def _spread_name(name: str, part: str) -> str:
    """As delta_v_min_m_s: what is least of delta_v_m_s."""
    stem = "delta_v" if name == "delta_v_m_s" else "performance_index"
    return f"{stem}_{part}{name.removeprefix(stem)}"


def _columns(run: SweepRun) -> dict[str, Dataset]:
    """One value a cell, initial state and facet."""
    grid = run.grid
    dims = (*(axis.name for axis in grid.question.axes), STATE, FACET)
    shape = (*grid.question.shape, len(grid.states), grid.facets)
    found = {}
    for column in CELL_COLUMNS:
        data = run.columns[column.name].reshape(shape)
        words = flag_words(column.flags) if column.flags else None
        found[column.name] = Dataset(data, column.units, column.description, dims, words)
    return found


def _lost(run: SweepRun) -> Group:
    lost = [
        (place, facet, why)
        for place, case in enumerate(run.cases)
        for facet, why in sorted(case.lost.items())
    ]
    places, facets, reasons = zip(*lost, strict=True)
    dims = ("loss",)
    return Group(
        {
            "case": Dataset(np.array(places, np.int32), "1", "cell times initial states plus state", dims),
            "facet": Dataset(np.array(facets, np.int32), "1", "facets that could not be solved", dims),
            "reason": Dataset(np.array(reasons), "1", "why", dims),
        }
    )


def _run_from_tree(tree: Group) -> SweepRun:
    asteroid = body_from_group(tree.group("body"))
    grid = _grid_from_group(tree.group("question"), asteroid)
    stored = tree.group("grid")
    shape = (*grid.question.shape, len(grid.states), grid.facets)
    columns = {}
    for column in CELL_COLUMNS:
        data = stored.dataset(column.name).data
        if data.shape != shape or data.dtype != np.dtype(column.dtype):
            raise ValueError(f"grid/{column.name} is {data.dtype} {data.shape}")
        columns[column.name] = data.reshape(-1)
    _check_columns(columns)
    run = gathered(grid, asteroid, columns, _lost_from(tree, prod(shape[:-1]), grid.facets))
    _check_equal(stored, {**_coordinates(grid), **_summaries(run)})
    return run


def _grid_from_group(group: Group, asteroid: Asteroid) -> Grid:
    count = group.attributes["axes"]
    if not isinstance(count, int) or not 1 <= count <= len(group.members):
        raise ValueError("the number of axes is wrong")
    axes = []
    for place in range(count):
        member = group.group(f"axis_{place}")
        texts = tuple(map(str, member.dataset("values").data.tolist()))
        axes.append(Axis(str(member.attributes["key"]), texts))
    document = Document(json.loads(str(group.attributes["document"])), {})
    question = Question(document, str(group.attributes["source"]), Path(), named(axes))
    if not 1 <= question.cells <= MOST_CELLS:
        raise ValueError(f"{question.cells} cells")
    first = question.scenario_at(0)
    states = tuple(state.name for state in reach_section(first).initial_states)
    surface = Surface(asteroid.mesh, str(group.attributes["shape_sha256"]))
    return Grid(question, surface, states, (), first)


def _check_columns(columns: Mapping[str, NDArray[Any]]) -> None:
    """Hold every facet to what can have been found: known words, and numbers where there is a flight."""
    reachable = columns["verdict"] == Verdict.REACHABLE
    for column in CELL_COLUMNS:
        values = columns[column.name]
        if column.flags is not None and not np.isin(values, list(column.flags)).all():
            raise ValueError(f"grid/{column.name} holds a value without a meaning")
        if column.dtype == "f8" and not (np.isfinite(values) == reachable).all():
            raise ValueError(f"grid/{column.name} is not there exactly where a facet is reachable")
        if column.dtype == "f8" and not ((values[reachable] > 0.0) & (values[reachable] < 1e9)).all():
            raise ValueError(f"grid/{column.name} is no quantity of a flight")
    if (columns["proved"] > (columns["verdict"] == Verdict.UNREACHABLE)).any():
        raise ValueError("grid/proved names facets that are not unreachable")
    if (columns["cuts_rock"] > reachable).any():
        raise ValueError("grid/cuts_rock names facets that are not reachable")


def _check_equal(stored: Group, known: Mapping[str, Dataset]) -> None:
    """Everything that follows from the facets and the axes is stored as it follows."""
    for name, dataset in known.items():
        data = stored.dataset(name).data
        if data.dtype.kind != dataset.data.dtype.kind or data.shape != dataset.data.shape:
            raise ValueError(f"grid/{name} is {data.dtype} {data.shape}")
        if data.dtype.kind == "f":
            same = np.allclose(data, dataset.data, rtol=1e-12, atol=0.0, equal_nan=True)
        else:
            same = bool((data == dataset.data).all())
        if not same:
            raise ValueError(f"grid/{name} does not follow from the facets")


def _lost_from(tree: Group, cases: int, facets: int) -> dict[int, dict[int, str]]:
    lost: dict[int, dict[int, str]] = {}
    if "lost" not in tree.members:
        return lost
    table = tree.group("lost")
    parts = (table.dataset(name).data.tolist() for name in ("case", "facet", "reason"))
    for case, facet, reason in zip(*parts, strict=True):
        if not (0 <= case < cases and 0 <= facet < facets):
            raise ValueError("lost names what does not exist")
        lost.setdefault(case, {})[facet] = str(reason)
    return lost
