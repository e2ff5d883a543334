"""Whether a sweep says what its cells give: some are solved again, compared, and flown by another integrator.

A sweep stores no flights. A case that is verified is therefore solved again, every facet of it; what comes
out must be what is stored, and each of its flights goes through the verification of `reach run`.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from landing_cli.parallel import LostChunk, WorkPlan, run_chunks
from landing_cli.reach.consistency import Fault
from landing_cli.reach.facet_work import in_chunks, solve_items
from landing_cli.reach.records import FacetSolutions, join
from landing_cli.reach.stored import CaseResult
from landing_cli.reach.summary import summarise
from landing_cli.reach.verify import CaseReport, Worst, verify_run as verify_reach
from landing_cli.studies.sweep.pipeline import prepare_cases
from landing_cli.studies.sweep.records import CellResult, kept_columns

# Cases of a sweep that are solved and flown again unless all are.
CASES = 4
# Most that J and the velocity increment of a second solve may differ by, relative: on one kind of processor
# they are equal.
REPEATED = 1e-6
_EXACT = ("verdict", "proved", "binding", "cuts_rock")
_CLOSE = ("performance_index_m2_s3", "delta_v_m_s")


def verify_run(
    results: tuple[CellResult, ...],
    *,
    polyhedron_for_all: bool = False,
    jobs: int = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[CaseReport, ...]:
    """Solve some cases of a sweep again, compare, and fly what they find by another integrator.

    Parameters
    ----------
    results : tuple of CellResult
        Cases of one sweep, at least one.
    polyhedron_for_all : bool
        Take every case, not an evenly spaced sample, and fly every facet under the polyhedron too.
    jobs : int
        Threads.
    progress : callable
        Told (done, total) facets, solved and flown.

    Returns
    -------
    tuple of CaseReport
        One a case that was taken. A verdict, proof or binding constraint that the second solve does not
        find is a fault; ``again_<column>`` is how far the numbers are apart.
    """
    chosen = results if polyhedron_for_all else tuple(results[i] for i in _spread(len(results)))
    reports, plan = [], WorkPlan(jobs, "threads", None)
    for place, stored in enumerate(chosen):
        solved = _solve_again(stored, plan)
        (report,) = verify_reach((solved,), polyhedron_for_all=polyhedron_for_all, jobs=jobs)
        faults, worst = _compared(stored, solved.solutions)
        reports.append(replace(report, faults=(*faults, *report.faults), worst={**worst, **report.worst}))
        progress((place + 1) * stored.grid.facets, len(chosen) * stored.grid.facets)
    return tuple(reports)


def _solve_again(stored: CellResult, plan: WorkPlan) -> CaseResult:
    case = stored.case
    prepared, facets = prepare_cases([case]), stored.grid.facets
    work = partial(solve_items, prepared, facets)
    parts = []
    with closing(run_chunks(work, in_chunks(np.arange(facets)), plan)) as answers:
        for _, answer in answers:
            assert not isinstance(answer, LostChunk)  # threads lose nothing
            parts.append(answer)
    solutions = join(parts)
    summary = summarise(case.asteroid.mesh, solutions)
    return CaseResult(case, stored.initial_state, solutions, summary)


def _compared(stored: CellResult, solved: FacetSolutions) -> tuple[list[Fault], dict[str, Worst]]:
    """Where the second solve differs from what is stored; lost facets are not asked."""
    again, faults, worst = kept_columns(solved), [], {}
    asked = np.setdiff1d(np.arange(stored.grid.facets), list(stored.lost))
    for name in _EXACT:
        other = asked[stored.columns[name][asked] != again[name][asked]]
        told = f"has another {name} when it is solved again"
        faults += [Fault(f"facet {facet} {told}", facet) for facet in other.tolist()]
    for name in _CLOSE:
        apart = _relative(stored.columns[name][asked], again[name][asked])
        place, failing = int(np.argmax(apart)), int((apart > REPEATED).sum())
        worst[f"again_{name}"] = Worst(float(apart[place]), REPEATED, int(asked[place]), failing)
    return faults, worst


def _relative(before: NDArray[np.float64], now: NDArray[np.float64]) -> NDArray[np.float64]:
    """Relative difference; 0 where neither has a number, infinite where one has."""
    apart = np.where(np.isnan(before) == np.isnan(now), 0.0, np.inf)
    both = np.isfinite(before) & np.isfinite(now)
    apart[both] = np.abs(before[both] / now[both] - 1.0)
    return apart


def _spread(count: int) -> list[int]:
    """Indices of the sample, evenly spaced, first and last included."""
    return np.unique(np.linspace(0, count - 1, min(count, CASES)).round().astype(int)).tolist()
