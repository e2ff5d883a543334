"""Calls from Python of what only kernels call."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numba import njit

Function = TypeVar("Function", bound=Any)
Record = TypeVar("Record", bound=tuple[Any, ...])


def from_python(part: Function) -> Function:
    """Return a kernel that hands its arguments to a part."""

    @njit(error_model="numpy")  # type: ignore[untyped-decorator]
    def call(*arguments: Any) -> Any:
        return part(*arguments)

    return call


def used(record: Record, *kept: str) -> Record:
    """Leave nothing of use in a record's work space, as an earlier call that met NaN would."""
    for name, field in zip(record._fields, record, strict=True):  # type: ignore[attr-defined]
        if isinstance(field, np.ndarray) and field.dtype == np.float64 and name not in kept:
            field[...] = np.nan
    return record
