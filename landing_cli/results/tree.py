"""A result as a tree of groups and datasets, whatever the mission."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli.results.columns import Column

Attribute = str | int | float | tuple[str, ...] | NDArray[Any]

COMPONENTS: Mapping[str, tuple[str, ...]] = {
    "xy": ("x", "y"),
    "xyz": ("x", "y", "z"),
    "costate": ("rx", "ry", "rz", "vx", "vy", "vz", "m"),
}
"""Names of a vector's components, by the name of its dimension."""

NAMES_BY_LENGTH = {len(names): dim for dim, names in COMPONENTS.items()}


@dataclass(frozen=True, eq=False)
class Dataset:
    """An array that knows its unit and meaning.

    Attributes
    ----------
    data : array
        Numbers (little-endian, C order) or strings; at least one dimension.
    units : str
        Of the numbers, ``1`` where they have none.
    description : str
        What they are.
    dims : tuple of str
        Name of every dimension.
    flags : mapping of int to str, or None
        The words behind an enumeration's values.
    """

    data: NDArray[Any]
    units: str
    description: str
    dims: tuple[str, ...]
    flags: Mapping[int, str] | None = None

    def __post_init__(self) -> None:
        """Bring the array into the form in which it is stored, and check its dimensions."""
        data = np.ascontiguousarray(self.data)
        if data.dtype.kind == "b":
            data = data.astype("u1")
        if data.dtype.kind not in "iufU":
            raise TypeError(f"cannot store {data.dtype}")
        if data.ndim != len(self.dims) or data.ndim == 0:
            raise ValueError(f"{data.ndim} dimensions named {self.dims}")
        object.__setattr__(self, "data", data.astype(data.dtype.newbyteorder("<"), copy=False))


@dataclass(frozen=True, eq=False)
class Group:
    """Named datasets and groups.

    Attributes
    ----------
    members : mapping of str
        Datasets and groups by name.
    attributes : mapping of str
        Text, numbers, one-dimensional arrays of numbers, or tuples of text, by name.
    """

    members: Mapping[str, Dataset | Group] = field(default_factory=dict)
    attributes: Mapping[str, Attribute] = field(default_factory=dict)

    def group(self, *path: str) -> Group:
        """Return the group at a path.

        Parameters
        ----------
        *path : str
            Names, from here downwards.

        Raises
        ------
        KeyError
            If there is no such group.
        """
        here = self
        for name in path:
            member = here.members.get(name)
            if not isinstance(member, Group):
                raise KeyError("/".join(path))
            here = member
        return here

    def dataset(self, name: str) -> Dataset:
        """Return a dataset of this group.

        Parameters
        ----------
        name : str
            Its name.

        Raises
        ------
        KeyError
            If there is no such dataset.
        """
        member = self.members[name]
        if not isinstance(member, Dataset):
            raise KeyError(name)
        return member


def flag_words(flags: type[IntEnum]) -> dict[int, str]:
    """Return the words behind an enumeration's values, in lower case.

    Parameters
    ----------
    flags : IntEnum class
        The enumeration.
    """
    return {int(member): member.name.lower() for member in flags}


def table_group(
    rows: Mapping[str, NDArray[Any]] | NDArray[np.void], columns: tuple[Column, ...], dimension: str
) -> Group:
    """Make a group of one dataset a column.

    Parameters
    ----------
    rows : structured array, or mapping of arrays by column name
        The table.
    columns : tuple of Column
        What to store of it, with units and meanings.
    dimension : str
        Name of the dimension that the rows run along.

    Returns
    -------
    Group
        Vectors get the dimension that ``COMPONENTS`` names for their length.
    """
    members = {}
    for column in columns:
        dims = (dimension, *(NAMES_BY_LENGTH.get(n, f"component_{n}") for n in column.shape))
        words = flag_words(column.flags) if column.flags else None
        members[column.name] = Dataset(rows[column.name], column.units, column.description, dims, words)
    return Group(members)


def table_rows(group: Group, columns: tuple[Column, ...]) -> NDArray[np.void]:
    """Put a group's columns together again.

    Parameters
    ----------
    group : Group
        From ``table_group``.
    columns : tuple of Column
        The columns that it must hold.

    Returns
    -------
    (n,) structured array

    Raises
    ------
    ValueError
        If a column is missing, or differs in type or length.
    """
    dtype = np.dtype([(c.name, c.dtype, c.shape) for c in columns])
    length = None
    for column in columns:
        member = group.members.get(column.name)
        if not isinstance(member, Dataset):
            raise ValueError(f"no column {column.name}")
        data = member.data
        length = len(data) if length is None else length
        if data.dtype != np.dtype(column.dtype) or data.shape != (length, *column.shape):
            raise ValueError(f"column {column.name} is {data.dtype} {data.shape}")
    rows = np.zeros(length or 0, dtype=dtype)
    for column in columns:
        rows[column.name] = group.dataset(column.name).data
    return rows


def mapping_to_group(values: Mapping[str, Any]) -> Group:
    """Store a summary: numbers and text as attributes, inner mappings as groups.

    Parameters
    ----------
    values : mapping
        None is stored as NaN.
    """
    members, attributes = {}, {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            members[name] = mapping_to_group(value)
        else:
            attributes[name] = float("nan") if value is None else value
    return Group(members, attributes)


def group_to_mapping(group: Group) -> dict[str, Any]:
    """Return what ``mapping_to_group`` stored; NaN comes back as None.

    Parameters
    ----------
    group : Group
        A summary.
    """
    values: dict[str, Any] = {
        name: None if isinstance(value, float) and np.isnan(value) else value
        for name, value in group.attributes.items()
    }
    for name, member in group.members.items():
        if isinstance(member, Group):
            values[name] = group_to_mapping(member)
    return values


def digest(tree: Group) -> str:
    """Hash a tree: names, attributes, shapes, types and bytes.

    Parameters
    ----------
    tree : Group
        The whole result but its provenance.

    Returns
    -------
    str
        SHA-256, hexadecimal: equal for results that are equal in every dataset and attribute.
    """
    sha = hashlib.sha256()
    for head, data in _walk("", tree):
        sha.update(json.dumps(head).encode())
        sha.update(data)
    return sha.hexdigest()


def _walk(path: str, node: Group | Dataset) -> Iterator[tuple[list[Any], Any]]:
    if isinstance(node, Dataset):
        data = node.data
        if data.dtype.kind == "U":  # the width of the stored type depends on nothing but the text
            data = np.char.encode(data, "utf-8")
        flags = sorted(node.flags.items()) if node.flags else []
        head = [path, "dataset", node.units, node.description, node.dims, flags, data.dtype.kind, data.shape]
        yield [*head, data.dtype.itemsize], data.reshape(-1).view("u1")
        return
    yield [path, "group", sorted(node.members)], b""
    for name, value in sorted(node.attributes.items()):
        value = canonical_attribute(value)
        if isinstance(value, np.ndarray):
            yield [path, "attribute", name, value.dtype.str, value.shape], value.tobytes()
        else:
            yield [path, "attribute", name, type(value).__name__, value if value == value else "nan"], b""
    for name, member in sorted(node.members.items()):
        yield from _walk(f"{path}/{name}", member)


def canonical_attribute(value: Any) -> Attribute:
    """Bring an attribute into one of the few types in which it is stored.

    Parameters
    ----------
    value : object
        Text, a number, a truth value, or a sequence of numbers or texts.

    Returns
    -------
    str, int, float, tuple of str, or array of int64 or float64

    Raises
    ------
    TypeError
        If it is anything else.
    """
    if isinstance(value, str):
        return value
    if isinstance(value, bool | np.bool_ | int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value)
    if isinstance(value, list | tuple) and value and all(isinstance(text, str) for text in value):
        return tuple(value)
    array = np.asarray(value)
    if array.ndim == 1 and array.dtype.kind in "biuf":
        return array.astype("<f8" if array.dtype.kind == "f" else "<i8")
    raise TypeError(f"cannot store {type(value).__name__} {value!r} as an attribute")
