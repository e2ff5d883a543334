"""Tables as CSV and JSON: the columns of the file under their own names, in full precision."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.errors import InputRefused
from landing_cli.flight.trajectory import Trajectory
from landing_cli.results.tree import COMPONENTS, Group


@dataclass(frozen=True, eq=False)
class TableColumn:
    """One column: numbers or text, and the words behind an enumeration's numbers.

    Attributes
    ----------
    values : (n,) array
    flags : mapping of int to str, or None
    """

    values: NDArray[Any]
    flags: Mapping[int, str] | None = None

    def cells(self) -> list[Any]:
        """Values as Python objects, enumerations in words."""
        plain = self.values.tolist()
        return plain if self.flags is None else [self.flags.get(value, str(value)) for value in plain]


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of equal length by name; the unit is part of the name.

    Attributes
    ----------
    columns : mapping of str to TableColumn
    """

    columns: Mapping[str, TableColumn]

    def __len__(self) -> int:
        return next((len(column.values) for column in self.columns.values()), 0)

    def rows(self) -> list[dict[str, Any]]:
        """Return one mapping a row; None where a number does not exist."""
        cells = [column.cells() for column in self.columns.values()]
        return [
            {n: _existing(v) for n, v in zip(self.columns, row, strict=True)}
            for row in zip(*cells, strict=True)
        ]


def group_table(group: Group) -> Table:
    """Lay a stored group out as a table.

    Parameters
    ----------
    group : Group
        Datasets over one first dimension.

    Returns
    -------
    Table
        A vector becomes a column a component: ``_x``, ``_y``, ``_z`` (see ``tree.COMPONENTS``). The
        dataset named like the dimension comes first.
    """
    columns: dict[str, TableColumn] = {}
    names = sorted(group.members, key=lambda n: (n not in group.dataset(n).dims, n))
    for name in names:
        dataset = group.dataset(name)
        if dataset.data.ndim == 1:
            columns[name] = TableColumn(dataset.data, dataset.flags)
        else:
            flat = dataset.data.reshape(len(dataset.data), math.prod(dataset.data.shape[1:]))
            known = COMPONENTS.get(dataset.dims[1], ()) if dataset.data.ndim == 2 else ()
            suffixes = known or tuple(map(str, range(flat.shape[1])))
            columns |= {f"{name}_{s}": TableColumn(flat[:, i]) for i, s in enumerate(suffixes)}
    return Table(columns)


def trajectory_table(trajectory: Trajectory) -> Table:
    """Lay a trajectory out as a table.

    Parameters
    ----------
    trajectory : Trajectory
        In the rotating body frame.

    Returns
    -------
    Table
    """
    vectors = {
        "position_m": trajectory.position_m,
        "velocity_m_s": trajectory.velocity_m_s,
        "thrust_n": trajectory.thrust_n,
    }
    columns = {"t_s": TableColumn(trajectory.t_s)}
    for name, vector in vectors.items():
        columns |= {f"{name}_{c}": TableColumn(vector[:, i]) for i, c in enumerate(COMPONENTS["xyz"])}
    return Table({**columns, "mass_kg": TableColumn(trajectory.mass_kg)})


def summary_table(summaries: Sequence[Mapping[str, Any]]) -> Table:
    """Lay summaries out as a table, one a row.

    Parameters
    ----------
    summaries : sequence of mappings
        Inner mappings are flattened: ``delta_v_m_s`` with ``min`` becomes ``delta_v_m_s_min``.

    Returns
    -------
    Table
        Empty cells where a summary has no such entry.
    """
    flat = [_flattened(summary) for summary in summaries]
    names = list(dict.fromkeys(name for row in flat for name in row))
    columns = {name: np.array([row.get(name) for row in flat], dtype=object) for name in names}
    return Table({name: TableColumn(values) for name, values in columns.items()})


def stacked(tables: Mapping[str, Table]) -> Table:
    """Put the tables of several cases below each other.

    Parameters
    ----------
    tables : mapping of str to Table
        By case.

    Returns
    -------
    Table
        With the case's name as first column.

    Raises
    ------
    InputRefused
        The tables have different columns: one case has a boundary of another kind than the next.
    """
    first = next(iter(tables.values()))
    for name, table in tables.items():
        if table.columns.keys() != first.columns.keys():
            told = f"the table of {name} has other columns than that of {next(iter(tables))}"
            raise InputRefused(told, fix="take one case with --case")
    names = np.concatenate([np.full(len(table), name) for name, table in tables.items()])
    columns = {"case": TableColumn(names)}
    for name, column in first.columns.items():
        parts = [table.columns[name].values for table in tables.values()]
        columns[name] = TableColumn(np.concatenate(parts), column.flags)
    return Table(columns)


def to_csv(table: Table) -> str:
    """Write a table as CSV.

    Parameters
    ----------
    table : Table
        What to write.

    Returns
    -------
    str
        With a line of names; numbers in the shortest form that reads back to the same bits; ``nan``
        where a number does not exist.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(table.columns)
    writer.writerows(zip(*(column.cells() for column in table.columns.values()), strict=True))
    return stream.getvalue()


def to_json(table: Table) -> str:
    """Write a table as JSON: a list of one object a row, null where a number does not exist.

    Parameters
    ----------
    table : Table
        What to write.
    """
    lines = ",\n".join(json.dumps(row, ensure_ascii=False, allow_nan=False) for row in table.rows())
    return f"[\n{lines}\n]\n"


def _existing(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _flattened(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in values.items():
        flat |= (
            _flattened(value, f"{prefix}{name}_")
            if isinstance(value, Mapping)
            else {f"{prefix}{name}": value}
        )
    return flat
