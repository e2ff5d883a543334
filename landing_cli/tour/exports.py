"""Tables of a tour for other programs, and its flights as OEM."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from landing_cli.errors import InputRefused, UsageError
from landing_cli.results.oem import HeliocentricArc, to_heliocentric_oem
from landing_cli.results.tables import Table, TableColumn, stacked, summary_table, to_csv, to_json
from landing_cli.results.tree import COMPONENTS
from landing_cli.tour.escape_records import EscapeMap, EscapeRun
from landing_cli.tour.run_records import ChainEntry, ChainPath, TourRun
from landing_cli.tour.summary import flyby_rows, summarise

TEXT_FORMATS: Mapping[str, Callable[[Table], str]] = {"csv": to_csv, "json": to_json}


def chosen_cases(run: TourRun | EscapeRun, case: str | None) -> tuple[Any, ...]:
    """Return the chain of a name, or all; of an escape run, the map.

    Parameters
    ----------
    run : TourRun or EscapeRun
        The run.
    case : str or None
        Name of a chain; None for all.

    Raises
    ------
    InputRefused
        If there is no such chain.
    """
    entries: tuple[ChainEntry | EscapeMap, ...] = run.cases
    chosen = tuple(entry for entry in entries if case in (None, entry.name))
    if not chosen and case is not None:
        raise InputRefused(f"no chain '{case}'", where="--case", fix=f"take one of {names_of(run.cases)}")
    return chosen


def names_of(entries: Sequence[ChainEntry | EscapeMap]) -> str:
    """List the names of chains, for messages."""
    shown = [entry.name for entry in entries[:12]]
    if not shown:
        return "none: the run found no chain"
    return ", ".join([*shown, f"and {len(entries) - 12} more"] if len(entries) > 12 else shown)


def trajectory_of(entry: ChainEntry | EscapeMap, facet: int | None = None) -> ChainPath:
    """Return the N-body flight of a chain.

    Parameters
    ----------
    entry : ChainEntry
        The chain.
    facet : None
        Tours have none.

    Raises
    ------
    InputRefused
        If it was not flown.
    """
    assert facet is None
    if isinstance(entry, EscapeMap):
        raise InputRefused("is a map, without a flight", where=entry.name, fix="export its summary")
    if entry.path is None:
        raise InputRefused(f"was not flown: {entry.chain.message}", where=entry.name)
    return entry.path


def export_table(
    run: TourRun | EscapeRun,
    table: str,
    form: str,
    case: str | None = None,
    trajectory: ChainPath | None = None,
) -> str:
    """Write one of a run's tables.

    Parameters
    ----------
    run : TourRun or EscapeRun
        The run.
    table : {"summary", "flybys", "trajectory"}
        Which one.
    form : {"csv", "json"}
        How.
    case : str, optional
        One chain only; otherwise all below each other.
    trajectory : ChainPath, optional
        The flight to write, for ``trajectory``.

    Raises
    ------
    InputRefused
        If there is no such format, chain or table.
    """
    if form not in TEXT_FORMATS:
        fix = "take csv or json; oem for trajectories"
        raise InputRefused(f"no format '{form}' for a table", where="--format", fix=fix)
    if trajectory is not None:
        return TEXT_FORMATS[form](_path_table(trajectory))
    chosen = chosen_cases(run, case)
    if isinstance(run, EscapeRun):
        if table != "summary":
            raise UsageError(f"an escape run has no {table} table", where="--table", fix="take summary")
        return TEXT_FORMATS[form](stacked({entry.name: _map_table(entry) for entry in chosen}))
    if table == "flybys":
        rows = [{"case": entry.name, **row} for entry in chosen for row in flyby_rows(entry.chain)]
        return TEXT_FORMATS[form](summary_table(rows))
    return TEXT_FORMATS[form](summary_table([_flat(entry) for entry in chosen]))


def export_oem(
    run: TourRun | EscapeRun, flown: ChainPath, scenario: Mapping[str, Any], created_utc: str
) -> str:
    """Write the N-body flight of a chain as an OEM: about the Sun, ICRF axes, TDB, a segment a coast.

    Parameters
    ----------
    run : TourRun or EscapeRun
        The run.
    flown : ChainPath
        The flight.
    scenario : mapping
        The stored scenario.
    created_utc : str
        For the header, ISO 8601.

    Returns
    -------
    str
    """
    arcs = []
    for arc in np.unique(flown.arc).tolist():
        own = flown.arc == arc
        told = f"coast after burn {arc}" if arc else "coast before the first burn"
        arcs.append(
            HeliocentricArc(
                flown.t_s[own],
                flown.position_m[own],
                flown.velocity_m_s[own],
                f"{told}; N-body: Sun, planets, Earth and Moon",
            )
        )
    return to_heliocentric_oem(arcs, str(scenario["name"]), created_utc)


def _flat(entry: ChainEntry) -> dict[str, object]:
    """A chain's summary in one row; its flybys have a table of their own."""
    told = {name: value for name, value in summarise(entry).items() if name != "flybys"}
    return {name: "; ".join(value) if isinstance(value, list) else value for name, value in told.items()}


def _path_table(path: ChainPath) -> Table:
    columns = {"t_s": TableColumn(path.t_s)}
    for name in ("position_m", "velocity_m_s"):
        vectors = getattr(path, name)
        columns |= {f"{name}_{c}": TableColumn(vectors[:, i]) for i, c in enumerate(COMPONENTS["xyz"])}
    return Table({**columns, "arc": TableColumn(path.arc)})


def _map_table(entry: EscapeMap) -> Table:
    low, high = np.meshgrid(entry.periapsis_altitude_m, entry.apoapsis_altitude_m, indexing="ij")
    return Table(
        {
            "periapsis_altitude_m": TableColumn(low.ravel()),
            "apoapsis_altitude_m": TableColumn(high.ravel()),
            "delta_v_m_s": TableColumn(entry.delta_v_m_s.ravel()),
        }
    )
