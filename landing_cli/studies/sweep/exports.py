"""Tables and maps of a sweep for other programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from landing_cli.errors import InputRefused
from landing_cli.reach.exports import TEXT_FORMATS
from landing_cli.reach.records import Verdict
from landing_cli.results.maps import WRITERS
from landing_cli.results.tables import Table, TableColumn, summary_table
from landing_cli.results.tree import flag_words
from landing_cli.studies.sweep.records import CELL_COLUMNS, CellResult, SweepRun

# rows of a table of facets that a program can be expected to read as text
MOST_ROWS = 2_000_000


def chosen_cases(run: SweepRun, case: str | None) -> tuple[CellResult, ...]:
    """Return the case of a name, those of an initial state or of values of the axes, or all.

    Parameters
    ----------
    run : SweepRun
        The sweep.
    case : str or None
        Parts of a case's name, as ``north_pole,tof_s=900``; None for all.

    Raises
    ------
    InputRefused
        If there is no such case.
    """
    wanted = set() if case is None else {part.strip() for part in case.split(",")}
    chosen = tuple(c for c in run.cases if wanted <= set(c.name.split(",")))
    if not chosen:
        first, last = run.cases[0].name, run.cases[-1].name
        fix = f"the cases are {first} to {last}; parts of a name take all that have them"
        raise InputRefused(f"no case '{case}'", where="--case", fix=fix)
    return chosen


def names_of(cases: Sequence[CellResult]) -> str:
    """List the names of cases, for messages."""
    return ", ".join(result.name for result in cases)


def export_table(
    run: SweepRun, table: str, form: str, case: str | None = None, trajectory: object = None
) -> str:
    """Write one of a sweep's tables.

    Parameters
    ----------
    run : SweepRun
        The sweep.
    table : {"summary", "facets"}
        A row a case, or a row a case and facet.
    form : {"csv", "json"}
        How.
    case : str, optional
        See :func:`chosen_cases`.
    trajectory : None
        A sweep has none.

    Raises
    ------
    InputRefused
        If there is no such format or case, or too many rows.
    """
    if form not in TEXT_FORMATS:
        raise InputRefused(f"no format '{form}' for a table", where="--format", fix="take csv or json")
    cases = chosen_cases(run, case)
    laid = summary_table([_summary_row(c) for c in cases]) if table == "summary" else _facets_table(cases)
    return TEXT_FORMATS[form](laid)


def export_map(run: SweepRun, form: str, case: str | None = None) -> bytes:
    """Write the map of a case, or of the share of cases in which each facet is reachable.

    Parameters
    ----------
    run : SweepRun
        The sweep.
    form : {"ply", "vtp", "obj"}
        How.
    case : str, optional
        See :func:`chosen_cases`.

    Raises
    ------
    InputRefused
        If there is no such format or case.
    """
    if form not in WRITERS:
        raise InputRefused(
            f"no format '{form}' for a map", where="--format", fix=f"take {', '.join(WRITERS)}"
        )
    cases = chosen_cases(run, case)
    facets = {"facet": TableColumn(np.arange(run.grid.facets, dtype=np.int32))}
    if len(cases) == 1:
        return WRITERS[form](run.asteroid.mesh, Table({**facets, **_columns(cases[0])}))
    times = reachable_in(cases)
    shares = {
        "reachable_cases": TableColumn(times.astype(np.int32)),
        "reachable_share": TableColumn(times / len(cases)),
    }
    return WRITERS[form](run.asteroid.mesh, Table({**facets, **shares}))


def reachable_in(cases: Sequence[CellResult]) -> np.ndarray:
    """In how many of some cases each facet is reachable, (m,) int."""
    return np.sum([case.columns["verdict"] == Verdict.REACHABLE for case in cases], axis=0)


def _summary_row(case: CellResult) -> dict[str, Any]:
    return {"case": case.name, **case.at, "initial_state": case.initial_state, **case.summary}


def _columns(case: CellResult) -> dict[str, TableColumn]:
    return {
        c.name: TableColumn(case.columns[c.name], flag_words(c.flags) if c.flags else None)
        for c in CELL_COLUMNS
    }


def _facets_table(cases: Sequence[CellResult]) -> Table:
    facets, axes = cases[0].grid.facets, cases[0].grid.question.axes
    if len(cases) * facets > MOST_ROWS:
        raise InputRefused(
            f"{len(cases)} cases x {facets} facets are more than {MOST_ROWS} rows",
            where="--table facets",
            fix="choose some with --case, as tof_s=900; or read the group `grid` with xarray",
        )
    columns: dict[str, TableColumn] = {}
    for axis in axes:
        values = np.array([case.at[axis.name] for case in cases])
        columns[axis.name] = TableColumn(np.repeat(values, facets))
    columns["initial_state"] = TableColumn(np.repeat([case.initial_state for case in cases], facets))
    columns["facet"] = TableColumn(np.tile(np.arange(facets, dtype=np.int32), len(cases)))
    parts: list[Mapping[str, TableColumn]] = [_columns(case) for case in cases]
    for name, column in parts[0].items():
        columns[name] = TableColumn(np.concatenate([part[name].values for part in parts]), column.flags)
    return Table(columns)
