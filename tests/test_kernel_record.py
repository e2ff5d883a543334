"""Records that kernels take by reference: what a call borrows it gives back."""

from __future__ import annotations

import sys
import weakref
from typing import NamedTuple

import numpy as np

from landing_cli.kernel import kernel
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
