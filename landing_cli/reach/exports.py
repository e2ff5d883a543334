"""Tables and maps of a reach run for other programs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from landing_cli.errors import InputRefused
from landing_cli.flight.trajectory import Trajectory
from landing_cli.parallel import WorkPlan
from landing_cli.reach.boundary_lines import lines_columns, lines_from_group
from landing_cli.reach.flown import flown_trajectory
from landing_cli.reach.records import FACET_COLUMNS
from landing_cli.reach.stored import CaseResult, ReachRun
from landing_cli.results.lines import LINE_WRITERS
from landing_cli.results.maps import WRITERS, on_every_facet
from landing_cli.results.oem import landing_oem
from landing_cli.results.tables import (
    Table,
    TableColumn,
    group_table,
    stacked,
    summary_table,
    to_csv,
    to_json,
    trajectory_table,
)
from landing_cli.results.tree import Dataset, Group, table_group

export_oem = landing_oem

_BOUNDARY_PARTS = ("section", "ring", "expansion", "boundary", "domain")
TEXT_FORMATS: Mapping[str, Callable[[Table], str]] = {"csv": to_csv, "json": to_json}


def facets_table(result: CaseResult) -> Table:
    """Lay the facets of a case out as a table.

    Parameters
    ----------
    result : CaseResult
        The case.

    Returns
    -------
    Table
        In the order of the file's columns.
    """
    table = group_table(table_group(result.solutions.rows, FACET_COLUMNS, "facet"))
    order = [c.name for c in FACET_COLUMNS]
    ranked = sorted(table.columns, key=lambda name: _rank(name, order))
    return Table({name: table.columns[name] for name in ranked})


def boundary_table(result: CaseResult) -> Table:
    """Lay the boundary of a case out as a table.

    Parameters
    ----------
    result : CaseResult
        The case.

    Returns
    -------
    Table
        The points of the lines where tau is 1, line after line, where the margin was asked; of a trace the
        edges of the boundary, loop after loop; else facets of the section, the ring, the expansions, the
        boundary and the domain, below each other.

    Raises
    ------
    InputRefused
        If the run's method found none.
    """
    if result.level_set is not None:
        columns = lines_columns(lines_from_group(result.level_set))
        return Table({name: TableColumn(values) for name, values in columns.items()})
    if result.boundary is None:
        raise InputRefused(
            "this run traced no boundary",
            where=result.case.name,
            fix="run with --set reach.margin=true, --set reach.method=trace or section, or with --compare",
        )
    lists = result.boundary.members
    if "loop" in lists:
        edges = {n: m for n, m in lists.items() if isinstance(m, Dataset) and m.dims == ("edge",)}
        return group_table(Group(edges))
    if len({result.boundary.dataset(name).dims[0] for name in lists}) == 1:
        return group_table(result.boundary)
    facets = {name.removesuffix("_facets"): result.boundary.dataset(name).data for name in lists}
    facets["domain"] = np.flatnonzero(facets["domain"])
    parts = [np.full(len(facets[part]), part) for part in _BOUNDARY_PARTS]
    rows = [np.asarray(facets[part], dtype=np.int64) for part in _BOUNDARY_PARTS]
    return Table({"part": TableColumn(np.concatenate(parts)), "facet": TableColumn(np.concatenate(rows))})


def chosen_cases(run: ReachRun, case: str | None) -> tuple[CaseResult, ...]:
    """Return the case of a name, or all.

    Parameters
    ----------
    run : ReachRun
        The run.
    case : str or None
        Name of a case; None for all.

    Raises
    ------
    InputRefused
        If there is no such case.
    """
    chosen = tuple(c for c in run.cases if case in (None, c.case.name))
    if not chosen:
        names = names_of(run.cases)
        raise InputRefused(f"no case '{case}'", where="--case", fix=f"take one of {names}")
    return chosen


def names_of(cases: Sequence[CaseResult]) -> str:
    """List the names of cases, for messages."""
    return ", ".join(result.case.name for result in cases)


def trajectory_of(result: CaseResult, facet: int) -> Trajectory:
    """Fly the stored control to a facet again.

    Parameters
    ----------
    result : CaseResult
        The case.
    facet : int
        0-based.

    Returns
    -------
    Trajectory
    """
    return flown_trajectory(result, facet)


def export_table(
    run: ReachRun, table: str, form: str, case: str | None = None, trajectory: Trajectory | None = None
) -> str:
    """Write one of a run's tables.

    Parameters
    ----------
    run : ReachRun
        The run.
    table : {"facets", "boundary", "summary", "trajectory"}
        Which one.
    form : {"csv", "json"}
        How.
    case : str, optional
        One case only; otherwise all below each other, with their name as first column.
    trajectory : Trajectory, optional
        The flight to write, for ``trajectory``.

    Raises
    ------
    InputRefused
        If there is no such table, format or case.
    """
    if form not in TEXT_FORMATS:
        fix = "take csv or json; ply, vtp and obj are for maps, oem for trajectories"
        raise InputRefused(f"no format '{form}' for a table", where="--format", fix=fix)
    cases = chosen_cases(run, case)
    if table == "trajectory" and trajectory is not None:
        laid = trajectory_table(trajectory)
    elif table == "summary":
        laid = summary_table([{"case": c.case.name, **c.summary} for c in cases])
    elif table in ("facets", "boundary"):
        make = facets_table if table == "facets" else boundary_table
        laid = make(cases[0]) if case is not None else stacked({c.case.name: make(c) for c in cases})
    else:
        raise InputRefused(f"no table '{table}'", where="--table", fix="take facets, boundary or summary")
    return TEXT_FORMATS[form](laid)


def export_why_not(
    run: ReachRun, form: str, case: str | None, plan: WorkPlan, progress: Callable[[int, int], None]
) -> str:
    """Find and write what would make every facet reachable that is not.

    Parameters
    ----------
    run : ReachRun
        The run.
    form : {"csv", "json"}
        How.
    case : str or None
        One case only; otherwise all below each other, with their name as first column.
    plan : WorkPlan
        Where to search.
    progress : callable
        Told (searched, total) facets.

    Raises
    ------
    InputRefused
        If there is no such case.
    """
    from landing_cli.reach.why_not_table import why_not_tables

    tables = why_not_tables(chosen_cases(run, case), plan, progress)
    return TEXT_FORMATS[form](stacked(tables) if case is None else next(iter(tables.values())))


def export_map(run: ReachRun, form: str, case: str | None = None) -> bytes:
    """Write the map of a case.

    Parameters
    ----------
    run : ReachRun
        The run.
    form : {"ply", "vtp", "obj"}
        How.
    case : str, optional
        Which case; needed where there are several.

    Raises
    ------
    InputRefused
        If there is no such format or case, or several cases and none chosen.
    """
    if form not in WRITERS:
        raise InputRefused(
            f"no format '{form}' for a map", where="--format", fix=f"take {', '.join(WRITERS)}"
        )
    cases = chosen_cases(run, case)
    if len(cases) > 1:
        names = names_of(cases)
        raise InputRefused("a map shows one case", where="--case", fix=f"take one of {names}")
    mesh = run.asteroid.mesh
    return WRITERS[form](mesh, on_every_facet(facets_table(cases[0]), len(mesh.faces)))


def export_lines(run: ReachRun, form: str, case: str | None = None) -> bytes:
    """Write the boundary of a case as lines in space.

    Parameters
    ----------
    run : ReachRun
        The run.
    form : {"vtp", "obj"}
        How.
    case : str, optional
        Which case; needed where there are several.

    Raises
    ------
    InputRefused
        If there is no such format or case, several cases and none chosen, or no lines.
    """
    if form not in LINE_WRITERS:
        fix = f"take {', '.join((*TEXT_FORMATS, *LINE_WRITERS))}"
        raise InputRefused(f"no format '{form}' for lines", where="--format", fix=fix)
    cases = chosen_cases(run, case)
    if len(cases) > 1:
        raise InputRefused(
            "a file of lines is of one case", where="--case", fix=f"take one of {names_of(cases)}"
        )
    if cases[0].level_set is None:
        told, fix = "this run traced no lines of a boundary", "run with --set reach.margin=true"
        raise InputRefused(told, where=cases[0].case.name, fix=fix)
    lines = lines_from_group(cases[0].level_set)
    return LINE_WRITERS[form](lines.points_m, lines.offsets)


def _rank(name: str, order: list[str]) -> int:
    """Rank of a flat column: that of the longest stored column that its name begins with."""
    return order.index(max((c for c in order if name == c or name.startswith(f"{c}_")), key=len))
