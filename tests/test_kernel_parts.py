"""Parts of kernels: right inside a kernel, refused by name outside of one."""

from __future__ import annotations

import pytest

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
    quarter(3.0)
    (compiled,) = quartered.overloads.values()
    assert compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name) == 0


def test_a_part_is_refused_by_name_when_python_calls_it() -> None:
    with pytest.raises(KeyError, match="halved can be called by kernels only"):
        halved(3.0)
