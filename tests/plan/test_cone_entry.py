"""The search of the cone entry on functions whose least point is known."""

from __future__ import annotations

import math

import pytest
from numpy.testing import assert_allclose

from landing_cli.plan.cone_entry import least_cost_time_to_go


@pytest.mark.parametrize("best", [40.0, 113.0, 600.0])
def test_it_finds_the_least_of_a_bowl(best: float) -> None:
    calls = []

    def solve(time_to_go_s: float) -> tuple[float, str]:
        calls.append(time_to_go_s)
        return math.log(time_to_go_s / best) ** 2, f"{time_to_go_s:.3f}"

    found, answer, tried = least_cost_time_to_go(solve, 100.0, 2000.0)
    assert_allclose(found, best, rtol=1e-6)
    assert answer == f"{found:.3f}"
    assert [time for time, _ in tried] == calls
    assert len(calls) <= 13


def test_a_wall_on_one_side_is_no_obstacle() -> None:
    """Entering later than 80 s before touchdown is impossible: a high cost, of no shape."""
    found, _, _ = least_cost_time_to_go(
        lambda time: (1e3 if time < 80.0 else time / 100.0, None), 100.0, 2000.0
    )
    assert 80.0 <= found < 100.1


def test_it_stays_within_the_flight() -> None:
    found, _, tried = least_cost_time_to_go(lambda time: (-time, None), 100.0, 300.0)
    assert_allclose(found, 300.0, rtol=1e-12)
    assert max(time for time, _ in tried) <= 300.0 * (1 + 1e-12)
