"""Records that kernels take by reference: what a call borrows it gives back."""

from __future__ import annotations

import enum
import sys
import weakref
from typing import NamedTuple

import numba
import numpy as np

from landing_cli.kernel import kernel
from landing_cli.kernel_lanes import new_lanes
from landing_cli.kernel_record import by_reference


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
