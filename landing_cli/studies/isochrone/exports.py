"""Tables and maps of an isochrone study for other programs."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused, UsageError
from landing_cli.results.columns import Column
from landing_cli.results.maps import WRITERS, on_every_facet
from landing_cli.results.tables import Table, TableColumn, stacked, summary_table, to_csv, to_json
from landing_cli.results.tree import flag_words
from landing_cli.studies.isochrone.domain import DOMAIN_COLUMNS, domain_at
from landing_cli.studies.isochrone.records import FACET_COLUMNS, INTERVAL_COLUMNS, IsochroneRun, StateResult
from landing_cli.studies.isochrone.summary import growth

TEXT_FORMATS: Mapping[str, Callable[[Table], str]] = {"csv": to_csv, "json": to_json}


def chosen_cases(run: IsochroneRun, case: str | None) -> tuple[StateResult, ...]:
    """Return the initial state of a name, or all.

    Parameters
    ----------
    run : IsochroneRun
        The study.
    case : str or None
        Name of an initial state; None for all.

    Raises
    ------
    InputRefused
        If there is no such state.
    """
    chosen = tuple(c for c in run.cases if case in (None, c.case.name))
    if not chosen:
        fix = f"take one of {names_of(run.cases)}"
        raise InputRefused(f"no initial state '{case}'", where="--case", fix=fix)
    return chosen


def names_of(cases: tuple[StateResult, ...]) -> str:
    """List the names of initial states, for messages."""
    return ", ".join(result.case.name for result in cases)


def export_table(
    run: IsochroneRun, table: str, form: str, case: str | None = None, tof_s: float | None = None
) -> str:
    """Write one of a study's tables.

    Parameters
    ----------
    run : IsochroneRun
        The study.
    table : {"facets", "intervals", "domain", "growth", "summary"}
        Which one.
    form : {"csv", "json"}
        How.
    case : str, optional
        One initial state only; otherwise all below each other, with their name as first column.
    tof_s : float, s, optional
        The time of flight of the domain.

    Raises
    ------
    InputRefused
        If there is no such table, format, state or time.
    """
    if form not in TEXT_FORMATS:
        fix = "take csv or json; ply, vtp and obj are for maps"
        raise InputRefused(f"no format '{form}' for a table", where="--format", fix=fix)
    cases = chosen_cases(run, case)
    if table == "summary":
        return TEXT_FORMATS[form](summary_table([{"case": c.case.name, **c.summary} for c in cases]))
    laid = [_table(result, table, tof_s) for result in cases]
    return TEXT_FORMATS[form](
        laid[0] if case is not None else stacked({c.case.name: t for c, t in zip(cases, laid, strict=True)})
    )


def export_map(run: IsochroneRun, form: str, case: str | None = None, tof_s: float | None = None) -> bytes:
    """Write the map of an initial state: its facets' times, or its domain at one time of flight.

    Parameters
    ----------
    run : IsochroneRun
        The study.
    form : {"ply", "vtp", "obj"}
        How.
    case : str, optional
        Which state; needed where there are several.
    tof_s : float, s, optional
        Time of flight of the domain; without it the facets' first and last times.

    Raises
    ------
    InputRefused
        If there is no such format, state or time, or several states and none chosen.
    """
    if form not in WRITERS:
        fix = f"take {', '.join(WRITERS)}"
        raise InputRefused(f"no format '{form}' for a map", where="--format", fix=fix)
    cases = chosen_cases(run, case)
    if len(cases) > 1:
        fix = f"take one of {names_of(cases)}"
        raise InputRefused("a map shows one initial state", where="--case", fix=fix)
    mesh = run.asteroid.mesh
    table = _table(cases[0], "facets" if tof_s is None else "domain", tof_s)
    return WRITERS[form](mesh, on_every_facet(table, len(mesh.faces)))


def _table(result: StateResult, table: str, tof_s: float | None) -> Table:
    if table == "domain":
        if tof_s is None:
            raise UsageError("a domain is of one time of flight", fix="name it with --tof-s")
        return _laid_out(domain_at(result, tof_s).rows, DOMAIN_COLUMNS)
    if table == "growth":
        rows = growth(result.case.asteroid.mesh, result.grid, result.answers)
        return Table({name: TableColumn(np.array([row[name] for row in rows])) for name in rows[0]})
    if table == "intervals":
        return _laid_out(result.intervals, INTERVAL_COLUMNS)
    return _laid_out(result.facets, FACET_COLUMNS)


def _laid_out(rows: NDArray[np.void], columns: tuple[Column, ...]) -> Table:
    """Lay rows out as a table, in the order of their columns."""
    return Table(
        {c.name: TableColumn(rows[c.name], flag_words(c.flags) if c.flags else None) for c in columns}
    )
