"""Tables and maps of a dispersion for other programs."""

from __future__ import annotations

from landing_cli.errors import InputRefused
from landing_cli.reach.exports import TEXT_FORMATS
from landing_cli.results.columns import Column
from landing_cli.results.maps import WRITERS, on_every_facet
from landing_cli.results.tables import Table, group_table, stacked, summary_table
from landing_cli.results.tree import table_group
from landing_cli.studies.disperse.records import FACET_COLUMNS, SAMPLE_COLUMNS, CaseDispersion, DispersionRun


def chosen_cases(run: DispersionRun, case: str | None) -> tuple[CaseDispersion, ...]:
    """Return the case of a name, or all.

    Parameters
    ----------
    run : DispersionRun
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
        names = ", ".join(c.case.name for c in run.cases)
        raise InputRefused(f"no case '{case}'", where="--case", fix=f"take one of {names}")
    return chosen


def export_table(
    run: DispersionRun, table: str, form: str, case: str | None = None, trajectory: None = None
) -> str:
    """Write one of a run's tables.

    Parameters
    ----------
    run : DispersionRun
        The run.
    table : {"facets", "samples", "summary"}
        Which one.
    form : {"csv", "json"}
        How.
    case : str, optional
        One case only; otherwise all below each other, with their name as first column.
    trajectory : None
        A dispersion stores no flights.

    Raises
    ------
    InputRefused
        If there is no such table, format or case.
    """
    if form not in TEXT_FORMATS:
        fix = "take csv or json; ply, vtp and obj are for maps"
        raise InputRefused(f"no format '{form}' for a table", where="--format", fix=fix)
    cases = chosen_cases(run, case)
    if table == "summary":
        laid = summary_table([{"case": c.case.name, **c.summary} for c in cases])
    elif table in ("facets", "samples"):
        tables = {c.case.name: _table(c, table) for c in cases}
        laid = next(iter(tables.values())) if case is not None else stacked(tables)
    else:
        raise InputRefused(f"no table '{table}'", where="--table", fix="take facets, samples or summary")
    return TEXT_FORMATS[form](laid)


def export_map(run: DispersionRun, form: str, case: str | None = None) -> bytes:
    """Write the probability map of a case.

    Parameters
    ----------
    run : DispersionRun
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
        fix = f"take {', '.join(WRITERS)}"
        raise InputRefused(f"no format '{form}' for a map", where="--format", fix=fix)
    cases = chosen_cases(run, case)
    if len(cases) > 1:
        names = ", ".join(c.case.name for c in cases)
        raise InputRefused("a map shows one case", where="--case", fix=f"take one of {names}")
    mesh = run.asteroid.mesh
    return WRITERS[form](mesh, on_every_facet(_table(cases[0], "facets"), len(mesh.faces)))


def _table(result: CaseDispersion, name: str) -> Table:
    rows = result.facets if name == "facets" else result.samples
    columns: tuple[Column, ...] = FACET_COLUMNS if name == "facets" else SAMPLE_COLUMNS
    laid = group_table(table_group(rows, columns, name.removesuffix("s")))
    order = {column.name: place for place, column in enumerate(columns)}
    ranked = sorted(laid.columns, key=lambda flat: order[_stored_name(flat, order)])
    return Table({flat: laid.columns[flat] for flat in ranked})


def _stored_name(flat: str, order: dict[str, int]) -> str:
    """The column that a flat one is a component of."""
    return flat if flat in order else flat.rpartition("_")[0]
