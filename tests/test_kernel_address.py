"""Kernels called by address: the same numbers, errors that come through, and no call with other types."""

from __future__ import annotations

import pickle
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import types

from landing_cli.kernel import inner, kernel, part
from landing_cli.kernel_address import Callee, call
from landing_cli.kernel_lanes import by_lane, new_lanes
from landing_cli.kernel_record import by_reference


@by_reference
class Work(NamedTuple):
    wide: Any
    plain: Any
    scale: float


class Pair(NamedTuple):
    count: int
    sure: bool


class Answer(NamedTuple):
    status: int
    value: float


@inner
def weigh(work: Work, pair: Pair, value: float) -> Answer:
    if value < 0.0:
        raise ValueError("a negative value")
    for i in range(pair.count):
        work.wide[i] = work.scale * work.plain[i] + work.wide[i]
    return Answer(7 if pair.sure else -1, value / work.scale)


@inner
def weigh_in_words(work: Work, pair: Pair, value: float) -> Answer:
    return Answer(1, 2.0)


@kernel
def by_address(callee: Any, work: Work, count: int, value: float) -> Answer:
    answer = call(callee, (work, Pair(count, value > 1.0), value))
    return Answer(answer.status + 1, answer.value)


@kernel
def one_by_address(callee: Any, work: Work, value: float) -> float:
    number: float = call(callee, (work, Pair(1, True), value))
    return number


def work() -> Work:
    return Work(new_lanes(3), np.array([1.0, 2.0, 3.0]), 0.1)


def callee_of(function: Any = weigh, result: Any = None) -> Callee:
    kind = types.NamedTuple((types.int64, types.float64), Answer) if result is None else result
    return Callee(function, kind, work(), Pair(1, True), 1.0)


def test_records_lanes_and_tuples_pass() -> None:
    own = work()
    assert by_address(callee_of(), own, 2, 3.0) == (8, 3.0 / 0.1)
    assert by_address(callee_of(), own, 3, 0.5) == (0, 0.5 / 0.1)
    np.testing.assert_array_equal(by_lane(own.wide)[:, 0], np.array([0.1 + 0.1, 0.2 + 0.2, 0.1 * 3.0]))
    assert (by_lane(own.wide) == by_lane(own.wide)[:, :1]).all()


def test_what_the_callee_raises_comes_through() -> None:
    with pytest.raises(ValueError, match="a negative value"):
        by_address(callee_of(), work(), 2, -3.0)


def test_the_caller_calls_what_it_is_handed_at_each_call() -> None:
    assert by_address(callee_of(), work(), 0, 3.0).status == 8
    assert by_address(callee_of(weigh_in_words), work(), 0, 3.0).status == 2
    assert len(by_address.overloads) == 1


def test_other_types_are_refused_before_anything_runs() -> None:
    with pytest.raises(Exception, match=r"Callee\(weigh\) takes"):
        by_address(callee_of(), work()._replace(plain=np.ones((3, 2))[:, 0]), 2, 3.0)


def test_a_callee_that_returns_something_else_is_refused() -> None:
    with pytest.raises(TypeError, match="weigh returns"):
        one_by_address(callee_of(result=types.float64), work(), 3.0)


def test_a_part_is_refused_for_it_has_no_address() -> None:
    @part
    def no_code(work: Work, pair: Pair, value: float) -> Answer:
        return Answer(1, 2.0)

    with pytest.raises(TypeError, match="no_code has no machine code of its own"):
        by_address(callee_of(no_code), work(), 2, 3.0)


def test_an_address_leaves_no_process() -> None:
    with pytest.raises(TypeError, match="holds in this process only"):
        pickle.dumps(callee_of())
