"""Records that kernels take by reference: what a call borrows it gives back."""

from __future__ import annotations

import enum
import sys
import weakref
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba import njit

from landing_cli.kernel import kernel
from landing_cli.kernel_lanes import new_lanes
from landing_cli.kernel_record import always_alike, by_reference


@by_reference
class Pair(NamedTuple):
    scale: float
    values: np.ndarray


@kernel
def scaled_sum(pair: Pair) -> float:
    return pair.scale * pair.values.sum()


@kernel
def twice(pair: Pair) -> float:
    return scaled_sum(pair) + scaled_sum(pair)


def test_a_call_gives_its_arrays_back() -> None:
    pair = Pair(0.5, np.arange(4.0))
    assert twice(pair) == 6.0
    before = sys.getrefcount(pair.values)
    for _ in range(100):
        twice(pair)
    after = sys.getrefcount(pair.values)
    assert after == before
    gone = weakref.ref(pair.values)
    del pair
    assert gone() is None


@by_reference
class Mixed(NamedTuple):
    field: object
    inner: Pair


class First(enum.IntEnum):
    ONE = 1


class Second(enum.IntEnum):
    ONE = 1


FIELDS = [
    1.0,
    True,
    1,
    2**63,
    First.ONE,
    Second.ONE,
    np.float32(1.0),
    np.float64(1.0),
    np.zeros(3),
    np.zeros(3, dtype=np.float32),
    np.zeros((3, 3)),
    np.zeros((3, 3)).T,
    np.zeros(6)[::2],
    np.frombuffer(bytes(24)),
    new_lanes(3),
    Pair(1.0, np.zeros(3)),
    Pair(1.0, np.zeros((3, 3))),
    (1.0, 1),
    (1, 1.0),
]


def test_a_remembered_type_is_the_type_of_the_fields() -> None:
    pair = Pair(0.5, np.arange(4.0))
    found = [numba.typeof(Mixed(field, pair)) for field in FIELDS]
    for field, kind in zip(FIELDS, found, strict=True):
        assert kind.fields.types == (numba.typeof(field), numba.typeof(pair))
        assert kind is numba.typeof(Mixed(field, pair))
    assert len({kind.fields for kind in found}) == len({numba.typeof(field) for field in FIELDS})


@by_reference
class Outer(NamedTuple):
    first: Pair
    name: int
    second: Pair
    flags: np.ndarray


@by_reference
class Listed(NamedTuple):
    numbers: list[float]


@always_alike
class Alike(NamedTuple):
    values: np.ndarray


@njit  # type: ignore[untyped-decorator]
def weighted(outer: Outer) -> float:
    total: float = outer.name * outer.first.scale * outer.second.values[0] + outer.flags.shape[0]
    return total


@njit  # type: ignore[untyped-decorator]
def first_of(alike: Alike) -> float:
    number: float = alike.values[0]
    return number


def test_records_in_records_are_read_and_given_back() -> None:
    first, second = Pair(0.5, np.arange(3.0)), Pair(2.0, np.arange(7.0, 9.0))
    outer = Outer(first, 3, second, np.ones((4, 2), dtype=np.bool_))
    arrays = first.values, second.values, outer.flags
    assert weighted(outer) == 3 * 0.5 * 7.0 + 4
    before = [sys.getrefcount(array) for array in arrays]
    for _ in range(10):
        weighted(outer)
    assert [sys.getrefcount(array) for array in arrays] == before


def test_arrays_of_a_kind_are_taken_apart_by_one_function() -> None:
    outer = Outer(Pair(0.5, np.ones(3)), 3, Pair(2.0, np.ones(2)), np.ones((4, 2), dtype=np.bool_))
    weighted(outer)
    (code,) = weighted.inspect_llvm().values()
    assert code.count("call i32 @NRT_adapt_ndarray_from_python") == 2  # float64 and bool


def test_what_is_no_such_array_is_refused() -> None:
    assert first_of(Alike(np.ones(1))) == 1.0
    with pytest.raises(TypeError, match="can't unbox array"):
        first_of(Alike(np.ones(1, dtype=np.float32)))
    with pytest.raises(TypeError, match="can't unbox array"):
        first_of(Alike([1.0]))  # type: ignore[arg-type]


def test_a_field_that_needs_cleaning_up_is_refused() -> None:
    @njit  # type: ignore[untyped-decorator]
    def untouched(record: Listed) -> int:
        return 0

    with pytest.raises(NotImplementedError, match="a field of reflected list"):
        untouched(Listed([1.0]))
