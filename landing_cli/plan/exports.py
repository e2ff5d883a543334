"""Tables of a plan run for other programs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from landing_cli.errors import InputRefused
from landing_cli.flight.trajectory import Trajectory
from landing_cli.plan.stored import PlanEntry, PlanRun
from landing_cli.plan.summary import summarise
from landing_cli.results.oem import landing_oem
from landing_cli.results.tables import Table, summary_table, to_csv, to_json, trajectory_table

export_oem = landing_oem

TEXT_FORMATS: Mapping[str, Callable[[Table], str]] = {"csv": to_csv, "json": to_json}


def chosen_cases(run: PlanRun, case: str | None) -> tuple[PlanEntry, ...]:
    """Return the plan of a name, or all.

    Parameters
    ----------
    run : PlanRun
        The run.
    case : str or None
        Name of a plan; None for all.

    Raises
    ------
    InputRefused
        If there is no such plan.
    """
    chosen = tuple(entry for entry in run.cases if case in (None, entry.name))
    if not chosen:
        raise InputRefused(f"no plan '{case}'", where="--case", fix=f"take one of {names_of(run.cases)}")
    return chosen


def names_of(entries: Sequence[PlanEntry]) -> str:
    """List the names of plans, for messages."""
    shown = [entry.name for entry in entries[:12]]
    return ", ".join([*shown, f"and {len(entries) - 12} more"] if len(entries) > 12 else shown)


def trajectory_of(entry: PlanEntry, facet: int | None = None) -> Trajectory:
    """Return the path of a plan.

    Parameters
    ----------
    entry : PlanEntry
        The plan.
    facet : None
        Plans have none.

    Raises
    ------
    InputRefused
        If no path was found.
    """
    assert facet is None
    path = entry.trajectory
    if path is None:
        raise InputRefused(f"holds no path: {entry.plan.message}", where=entry.name)
    return path


def export_table(
    run: PlanRun, table: str, form: str, case: str | None = None, trajectory: Trajectory | None = None
) -> str:
    """Write one of a run's tables.

    Parameters
    ----------
    run : PlanRun
        The run.
    table : {"summary", "trajectory"}
        Which one.
    form : {"csv", "json"}
        How.
    case : str, optional
        One plan only; otherwise all below each other.
    trajectory : Trajectory, optional
        The path to write, for ``trajectory``.

    Raises
    ------
    InputRefused
        If there is no such format or plan.
    """
    if form not in TEXT_FORMATS:
        fix = "take csv or json; oem for trajectories"
        raise InputRefused(f"no format '{form}' for a table", where="--format", fix=fix)
    if trajectory is not None:
        return TEXT_FORMATS[form](trajectory_table(trajectory))
    return TEXT_FORMATS[form](summary_table([_flat(entry) for entry in chosen_cases(run, case)]))


def _flat(entry: PlanEntry) -> dict[str, object]:
    """A plan's summary with vectors as a column a component; other lists stay in the HDF5 file."""
    flat: dict[str, object] = {}
    for name, value in summarise(entry).items():
        array = np.asarray(value) if isinstance(value, list | np.ndarray) else None
        if array is None:
            flat[name] = value
        elif array.shape == (3,) and array.dtype.kind in "if":
            flat |= {f"{name}_{axis}": float(part) for axis, part in zip("xyz", array, strict=True)}
    return flat
