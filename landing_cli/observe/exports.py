"""Tables of an observation run for other programs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from landing_cli.errors import InputRefused
from landing_cli.flight.trajectory import Trajectory
from landing_cli.observe.observed import Path
from landing_cli.observe.path_values import velocity_increments
from landing_cli.observe.records import ObserveCase
from landing_cli.observe.stored import ObservationEntry, ObserveRun
from landing_cli.observe.summary import summarise
from landing_cli.results.oem import landing_oem
from landing_cli.results.tables import (
    Table,
    TableColumn,
    stacked,
    summary_table,
    to_csv,
    to_json,
    trajectory_table,
)

export_oem = landing_oem

TEXT_FORMATS: Mapping[str, Callable[[Table], str]] = {"csv": to_csv, "json": to_json}


def chosen_cases(run: ObserveRun, case: str | None) -> tuple[ObservationEntry, ...]:
    """Return the observation of a name, or all.

    Parameters
    ----------
    run : ObserveRun
        The run.
    case : str or None
        Name of an observation; None for all.

    Raises
    ------
    InputRefused
        If there is no such observation.
    """
    chosen = tuple(entry for entry in run.cases if case in (None, entry.name))
    if not chosen:
        fix = f"take one of {names_of(run.cases)}"
        raise InputRefused(f"no observation '{case}'", where="--case", fix=fix)
    return chosen


def names_of(entries: Sequence[ObservationEntry]) -> str:
    """List the names of observations, for messages."""
    return ", ".join(entry.name for entry in entries)


def trajectory_of(entry: ObservationEntry, facet: int | None = None) -> Trajectory:
    """Return the steered path of an observation.

    Parameters
    ----------
    entry : ObservationEntry
        The observation.
    facet : None
        Observations have none.
    """
    assert facet is None
    return flown(entry.case, entry.observation.steered.path)


def flown(case: ObserveCase, path: Path) -> Trajectory:
    """Return a path with mass and thrust at its nodes.

    Parameters
    ----------
    case : ObserveCase
        What was asked.
    path : Path
        The path.

    Returns
    -------
    Trajectory
    """
    craft = case.spacecraft
    spent = velocity_increments(path.t_s, path.acceleration_m_s2)
    mass = craft.mass_kg * np.exp(-spent / craft.exhaust_velocity_m_s)
    return Trajectory(
        path.t_s, path.position_m, path.velocity_m_s, mass, mass[:, None] * path.acceleration_m_s2
    )


def export_table(
    run: ObserveRun, table: str, form: str, case: str | None = None, trajectory: Trajectory | None = None
) -> str:
    """Write one of a run's tables.

    Parameters
    ----------
    run : ObserveRun
        The run.
    table : {"summary", "trajectory", "landmarks", "view"}
        Which one: ``landmarks`` has a row a landmark, ``view`` one a time of the sensor.
    form : {"csv", "json"}
        How.
    case : str, optional
        One observation only; otherwise all below each other.
    trajectory : Trajectory, optional
        The path to write, for ``trajectory``.

    Raises
    ------
    InputRefused
        If there is no such format or observation.
    """
    if form not in TEXT_FORMATS:
        fix = "take csv or json; oem for trajectories"
        raise InputRefused(f"no format '{form}' for a table", where="--format", fix=fix)
    entries = chosen_cases(run, case)
    if trajectory is not None:
        made = trajectory_table(trajectory)
    elif table == "landmarks":
        made = landmarks_table(entries)
    elif table == "view":
        made = stacked({entry.name: view_table(entry) for entry in entries})
    else:
        made = summary_table([_flat(entry) for entry in entries])
    return TEXT_FORMATS[form](made)


def landmarks_table(entries: Sequence[ObservationEntry]) -> Table:
    """Lay out the landmarks: where they are, their cluster, and how long each path has them in view.

    Parameters
    ----------
    entries : sequence of ObservationEntry
        Of one run.

    Returns
    -------
    Table
        A row a landmark.
    """
    case, first = entries[0].case, entries[0].observation
    landmarks = case.landmarks
    site = case.frame.to_site(landmarks.position_m)
    columns = {"name": TableColumn(np.array(landmarks.name, dtype=object))}
    for name, values in (
        ("position_m", landmarks.position_m),
        ("site_position_m", site),
        ("normal", landmarks.normal),
    ):
        columns |= {f"{name}_{axis}": TableColumn(values[:, i]) for i, axis in enumerate("xyz")}
    columns |= {"diameter_m": TableColumn(landmarks.diameter_m), "facet": TableColumn(landmarks.facet)}
    columns["cluster"] = TableColumn(first.clustering.label)
    views = {"nominal": first.nominal, **{entry.name: entry.observation.steered for entry in entries}}
    for name, observed in views.items():
        columns[f"in_view_{name}"] = TableColumn(observed.seen.visible.mean(axis=0))
    return Table(columns)


def view_table(entry: ObservationEntry) -> Table:
    """Lay out what a steered path sees over time.

    Parameters
    ----------
    entry : ObservationEntry
        The observation.

    Returns
    -------
    Table
        A row a time of the sensor.
    """
    observed = entry.observation.steered
    return Table(
        {
            "t_s": TableColumn(observed.seen.t_s),
            "landmarks_in_view": TableColumn(observed.seen.count),
            "position_sigma_m": TableColumn(observed.sigma.position_sigma_m),
        }
    )


def _flat(entry: ObservationEntry) -> dict[str, object]:
    """A summary with vectors as a column a component; other lists stay in the HDF5 file."""
    flat: dict[str, object] = {}
    for name, value in summarise(entry).items():
        array = np.asarray(value) if isinstance(value, list | tuple | np.ndarray) else None
        if array is None:
            flat[name] = _without_lists(value)
        elif array.shape == (3,) and array.dtype.kind in "if":
            flat |= {f"{name}_{axis}": float(part) for axis, part in zip("xyz", array, strict=True)}
    return flat


def _without_lists(value: object) -> object:
    if not isinstance(value, Mapping):
        return value
    return {key: part for key, part in value.items() if not isinstance(part, list | np.ndarray)}
