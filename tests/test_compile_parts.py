"""What is compiled before a run is what its solves call."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from landing_samples import asteroid, landing_case

from landing_cli.reach import extremal_descent, extremal_kernels, kernels
from landing_cli.reach.delivery import fill_deliveries, measure_landing
from landing_cli.reach.free_batch import solve_many
from landing_cli.reach.free_descent import prepare, solve_prepared, survey
from landing_cli.reach.free_solve import judge, linearise, take_step
from landing_cli.reach.records import Verdict


def in_turn(parts: Any, _processes: int) -> None:
    for part in parts:
        part()


def test_a_solve_finds_all_that_was_compiled_before(monkeypatch: pytest.MonkeyPatch) -> None:
    case = landing_case(asteroid(gravity=2.0, spin=2.0))
    called: tuple[Any, ...] = (linearise, take_step, judge, solve_many, fill_deliveries, measure_landing)

    monkeypatch.setattr(kernels, "share_out", in_turn)
    kernels.compile_parts(case)
    kinds = [set(kernel.overloads) for kernel in called]
    assert all(kinds)
    prepared = prepare(case, survey(case))
    solve_prepared(prepared, np.arange(0, len(prepared.shared.normals), 20))
    assert [set(kernel.overloads) for kernel in called] == kinds
    assert kernels.are_compiled(case.descent)


def test_extremals_find_all_that_was_compiled_before(monkeypatch: pytest.MonkeyPatch) -> None:
    case = landing_case(asteroid(gravity=2.0, spin=2.0), descent="extremal")
    called = *extremal_kernels.KERNELS, measure_landing
    monkeypatch.setattr(kernels, "share_out", in_turn)
    kernels.compile_parts(case)
    kinds = [set(kernel.overloads) for kernel in called]
    assert all(kinds)
    prepared = prepare(case, survey(case))
    solved = extremal_descent.solve_prepared(prepared, np.arange(0, len(prepared.shared.normals), 20))
    assert np.any(solved.rows["verdict"] == Verdict.REACHABLE)
    assert [set(kernel.overloads) for kernel in called] == kinds
    assert kernels.are_compiled(case.descent)


def test_extremals_are_compiled_where_they_are_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    shared: list[int] = []
    monkeypatch.setattr(kernels, "share_out", lambda parts, _processes: shared.append(len(parts)))
    for descent in ("free", "extremal"):
        kernels.compile_parts(landing_case(asteroid(gravity=2.0, spin=2.0), descent=descent))
    assert shared[1] == shared[0] + len(extremal_kernels.PARTS)
