"""Parts of kernels: right inside a kernel, refused by name outside of one."""

from __future__ import annotations

import gc
from typing import Any

import numpy as np
import pytest
from kernel_calls import from_python
from numba import njit, types
from numba.core.types.functions import BaseFunction
from numba.extending import intrinsic

from landing_cli.kernel import kernel, part


@part
def halved(x: float) -> float:
    return 0.5 * x


@part
def quartered(x: float) -> float:
    return halved(halved(x))


@kernel
def eighth(x: float) -> float:
    return halved(quartered(x))


@kernel
def quarter(x: float) -> float:
    return quartered(x)


def test_kernels_share_parts_that_call_parts() -> None:
    assert (eighth(3.0), quarter(3.0)) == (0.375, 0.75)


def test_a_part_has_no_machine_code_of_its_own() -> None:
    from_python(quartered)(3.0)  # compiles it even where `quarter` comes from the cache
    (compiled,) = quartered.overloads.values()
    assert compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name) == 0


def test_a_part_is_refused_by_name_when_python_calls_it() -> None:
    with pytest.raises(KeyError, match="halved can be called by kernels only"):
        halved(3.0)


def mixture(a: Any, b: Any) -> Any:
    return a * b - a // b + (a % b) / 3 + 2 * a**2 - (a < b) + round(a / b) + min(a, b) + np.hypot(a, 2)


@pytest.mark.parametrize(
    ("a", "b"),
    [(7, 2), (7.5, 2), (7, 2.5), (np.float32(7.5), 2.5), (True, 3), (np.uint8(7), -2), (-7.5, -2.0)],
)
def test_what_is_remembered_of_numbas_types_changes_no_number(a: Any, b: Any) -> None:
    numbas = njit(error_model="numpy")(mixture)
    for _ in range(2):  # the second part is typed from what the first left
        ours = from_python(part(mixture))
        assert ours(a, b) == numbas(a, b)
        assert [str(s.return_type) for s in ours.nopython_signatures] == [
            str(s.return_type) for s in numbas.nopython_signatures
        ]


def test_numba_types_as_before_once_a_kernel_is_compiled_or_refused() -> None:
    @kernel
    def wrong(x: float) -> Any:
        return x + "no number"  # type: ignore[operator]

    with pytest.raises(Exception, match="No implementation of function"):
        wrong(1.0)
    assert from_python(part(mixture))(3.0, 2.0) == mixture(3.0, 2.0)
    assert BaseFunction.get_call_type.__module__ == BaseFunction.__module__


@intrinsic
def collecting(_context: Any) -> Any:
    """Whether Python looks for garbage while this is compiled."""
    now = gc.isenabled()
    return types.boolean(), lambda context, *_: context.get_constant(types.boolean, now)


@pytest.mark.parametrize("collects", [True, False])
def test_python_looks_for_garbage_as_before_but_not_while_a_kernel_compiles(collects: bool) -> None:
    @kernel
    def asked() -> tuple[bool, bool]:
        return collecting(), collects  # one kernel for each, in the cache too

    was = gc.isenabled()
    try:
        (gc.enable if collects else gc.disable)()
        assert asked() == (False, collects)
        assert gc.isenabled() == collects
    finally:
        (gc.enable if was else gc.disable)()
