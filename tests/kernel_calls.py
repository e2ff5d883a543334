"""Calls from Python of what only kernels call."""

from __future__ import annotations

from typing import Any, TypeVar

from numba import njit

Function = TypeVar("Function", bound=Any)


def from_python(part: Function) -> Function:
    """Return a kernel that hands its arguments to a part."""

    @njit(error_model="numpy")  # type: ignore[untyped-decorator]
    def call(*arguments: Any) -> Any:
        return part(*arguments)

    return call
