"""What a sweep keeps of every facet, cell by cell, and what it sums up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.mesh import facet_areas
from landing_cli.reach.records import FACET_COLUMNS, FacetSolutions, LandingCase, Verdict, blank_rows
from landing_cli.reach.stored import CaseResult
from landing_cli.reach.summary import summarise
from landing_cli.results.columns import Column
from landing_cli.studies.sweep.grid import Grid

Values = NDArray[Any]
Columns = Mapping[str, Values]

_ROCK = Column("cuts_rock", "u1", "1", "1 where the facet is reachable, but the path to it cuts the mesh")
_KEPT = ("verdict", "proved", "binding", "delta_v_m_s", "performance_index_m2_s3")
CELL_COLUMNS: tuple[Column, ...] = (*(c for c in FACET_COLUMNS if c.name in _KEPT), _ROCK)

# a chunk's answers in the journal: item is case times facets plus facet
ITEM_DTYPE = np.dtype([("item", "i8"), *((c.name, c.dtype) for c in CELL_COLUMNS)])

SPREAD = ("min", "median", "max")


def reduced(solutions: FacetSolutions) -> NDArray[np.void]:
    """Keep what a sweep stores of the answers to some items; the flights are not kept.

    Parameters
    ----------
    solutions : FacetSolutions
        With items in the place of facets.

    Returns
    -------
    (n,) structured array of ITEM_DTYPE
    """
    rows = np.zeros(len(solutions.rows), dtype=ITEM_DTYPE)
    rows["item"] = solutions.rows["facet"]
    for name in _KEPT:
        rows[name] = solutions.rows[name]
    rows["cuts_rock"] = _cuts_rock(solutions.rows)
    return rows


def kept_columns(solutions: FacetSolutions) -> dict[str, Values]:
    """Return what a sweep would store of the facets of a reach case, by column."""
    kept = {name: solutions.rows[name] for name in _KEPT}
    return {**kept, "cuts_rock": _cuts_rock(solutions.rows)}


def blank_columns(count: int) -> dict[str, Values]:
    """Columns of unresolved facets, (count,) each."""
    blank: dict[str, Values] = {c.name: np.zeros(count, dtype=c.dtype) for c in CELL_COLUMNS}
    for column in CELL_COLUMNS:
        if column.dtype == "f8":
            blank[column.name][:] = np.nan
    return blank


@dataclass(frozen=True, eq=False)
class CellResult:
    """What a sweep found for one cell and one initial state.

    Attributes
    ----------
    name : str
        ``<initial state>,<axis>=<value>,...``.
    cell, state : int
        Where in the grid.
    at : mapping of str
        Values of the axes, by their names.
    initial_state : str
    columns : mapping of (m,) arrays
        ``CELL_COLUMNS`` of every facet.
    summary : mapping
        As printed.
    grid : Grid
        The sweep it belongs to.
    lost : mapping of int to str
        Why a facet could not be solved, by facet.
    """

    name: str
    cell: int
    state: int
    at: Mapping[str, float | str]
    initial_state: str
    columns: Columns
    summary: Mapping[str, Any]
    grid: Grid
    lost: Mapping[int, str] = field(default_factory=dict)

    @property
    def case(self) -> LandingCase:
        """The landing case, named as the result is."""
        if self.grid.cases:
            case = self.grid.cases[self.cell * len(self.grid.states) + self.state]
        else:  # read from a file: made when it is asked for
            case = self.grid.make_cases(self.grid.question.scenario_at(self.cell))[self.state]
        return replace(case, name=self.name)

    def as_reach(self) -> CaseResult:
        """Return the case as a reach run knows it, without its flights."""
        rows = blank_rows(np.arange(self.grid.facets))
        for name in _KEPT:
            rows[name] = self.columns[name]
        rows["terrain_clearance_min_m"][self.columns["verdict"] == Verdict.REACHABLE] = 0.0
        rows["terrain_clearance_min_m"][self.columns["cuts_rock"] == 1] = -1.0
        solutions = FacetSolutions(rows, np.zeros((0, 3)))
        case = self.case
        summary = summarise(case.asteroid.mesh, solutions)
        return CaseResult(case, self.initial_state, solutions, summary, lost=self.lost)


@dataclass(frozen=True, eq=False)
class SweepRun:
    """A sweep: every cell, every initial state.

    Attributes
    ----------
    grid : Grid
    asteroid : Asteroid
        Of the first cell: its surface is that of all.
    columns : mapping of (cells times states times facets,) arrays
        ``CELL_COLUMNS`` of all cases, which their own are parts of.
    cases : tuple of CellResult
        Cell after cell, state after state.
    """

    grid: Grid
    asteroid: Asteroid
    columns: Columns
    cases: tuple[CellResult, ...]

    @cached_property
    def lost_facets(self) -> int:
        """How many facets of all cases could not be solved."""
        return sum(len(case.lost) for case in self.cases)


def gathered(
    grid: Grid, asteroid: Asteroid, columns: Columns, lost: Mapping[int, Mapping[int, str]]
) -> SweepRun:
    """Put the answers to every facet together as a run.

    Parameters
    ----------
    grid : Grid
        The sweep.
    asteroid : Asteroid
        Of the first cell.
    columns : mapping of (cases times facets,) arrays
        ``CELL_COLUMNS``, case after case.
    lost : mapping of int to mapping
        Lost facets and why, by case.

    Returns
    -------
    SweepRun
    """
    areas, count, states = facet_areas(grid.surface.mesh), grid.facets, len(grid.states)
    cases = []
    for index in range(grid.question.cells * states):
        own = {name: values[index * count : (index + 1) * count] for name, values in columns.items()}
        cell, state = divmod(index, states)
        cases.append(
            CellResult(
                name=case_name(grid, cell, state),
                cell=cell,
                state=state,
                at=grid.question.values_at(cell),
                initial_state=grid.states[state],
                columns=own,
                summary=sum_up(areas, own),
                grid=grid,
                lost=lost.get(index, {}),
            )
        )
    return SweepRun(grid, asteroid, columns, tuple(cases))


def case_name(grid: Grid, cell: int, state: int) -> str:
    """Name a cell's case, as north_pole,tof_s=600,thrust_max_n=10."""
    values = (f"{name}={text}" for name, text in grid.question.texts_at(cell).items())
    return ",".join([grid.states[state], *values])


def sum_up(areas_m2: NDArray[np.float64], columns: Columns) -> dict[str, Any]:
    """Sum up the facets of a case: counts, area, velocity increments, J, rock on the way.

    Parameters
    ----------
    areas_m2 : (m,) float, m2
        Of the facets.
    columns : mapping of (m,) arrays
        ``CELL_COLUMNS``.

    Returns
    -------
    dict
        What ``reach run`` prints of a case, under its names, and J beside.
    """
    verdict = columns["verdict"]
    reachable, unreachable = verdict == Verdict.REACHABLE, verdict == Verdict.UNREACHABLE
    return {
        "facets": len(verdict),
        "reachable": int(reachable.sum()),
        "unreachable": int(unreachable.sum()),
        "unresolved": int((verdict == Verdict.UNRESOLVED).sum()),
        "proved": int((unreachable & (columns["proved"] == 1)).sum()),
        "reachable_area_m2": float(areas_m2[reachable].sum()),
        "delta_v_m_s": _spread(columns["delta_v_m_s"][reachable]),
        "performance_index_m2_s3": _spread(columns["performance_index_m2_s3"][reachable]),
        "paths_through_rock": int(columns["cuts_rock"].sum()),
    }


def _cuts_rock(rows: NDArray[np.void]) -> Values:
    return np.asarray((rows["verdict"] == Verdict.REACHABLE) & (rows["terrain_clearance_min_m"] < 0.0), "u1")


def _spread(values: NDArray[np.float64]) -> dict[str, float | None]:
    if len(values) == 0:
        return dict.fromkeys(SPREAD)
    return {"min": float(values.min()), "median": float(np.median(values)), "max": float(values.max())}
