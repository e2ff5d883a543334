"""A stored quantity: its name, type, unit and meaning, in the file and in the CSV alike."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


@dataclass(frozen=True)
class Column:
    """One column of a table that a result stores."""

    name: str
    dtype: str
    units: str
    description: str
    shape: tuple[int, ...] = ()
    flags: type[IntEnum] | None = None
