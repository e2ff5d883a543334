"""Whether a stored study does what it says: a sample of its answers asked again, and their flights flown.

A study stores verdicts and times, not controls. Both sides of an even sample of interval ends, and a sample
of the grid, are solved again; every flight that is found is flown open loop as `reach run`'s are (another
integrator, itself checked against DOP853, every limit measured). The tables must follow from each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.free_descent import survey
from landing_cli.reach.records import FacetSolutions, Verdict
from landing_cli.reach.stored import CaseResult
from landing_cli.reach.summary import summarise as summarise_facets
from landing_cli.reach.verify import CaseReport, verify_run as fly_again
from landing_cli.results.verification import Check, Report
from landing_cli.studies.isochrone.intervals import facet_numbers, interval_at
from landing_cli.studies.isochrone.records import End, Rows, StateResult
from landing_cli.studies.isochrone.summary import summarise
from landing_cli.studies.isochrone.work import Study, case_at, solve_at

# Ends of each initial state that are asked again on both sides, and questions of its grid.
SAMPLED_ENDS, SAMPLED_GRID = 16, 12
SAME_INDEX = 1e-6  # relative; the same processor gives the same bits


class Question(NamedTuple):
    """A facet at a time of flight, and what the file says of it."""

    facet: int
    tof_s: float
    verdict: Verdict
    index_m2_s3: float  # J; NaN where the file does not tell


@dataclass(frozen=True)
class IsochroneReport(Report):
    """Of an initial state.

    Attributes
    ----------
    questions, disagreeing : int
        Asked again, and answered otherwise than the file says.
    flights : int
        Flown again.
    polyhedron_miss_m : float or None
        Largest of the medians, over the sampled times, of the same controls' misses under the polyhedron.
    """

    questions: int
    disagreeing: int
    flights: int
    polyhedron_miss_m: float | None


def verify_run(
    results: tuple[StateResult, ...],
    *,
    polyhedron_for_all: bool = False,
    jobs: int = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[IsochroneReport, ...]:
    """Ask a sample of some initial states again, and fly what is found.

    Parameters
    ----------
    results : tuple of StateResult
        Of one study, at least one.
    polyhedron_for_all : bool
        Fly every sampled flight under the polyhedron too.
    jobs : int
        Threads.
    progress : callable
        Told (flown, total) flights.

    Returns
    -------
    tuple of IsochroneReport
        One an initial state.
    """
    study = Study(tuple(r.case for r in results), results[0].grid, survey(results[0].case))
    asked = [sampled_questions(result) for result in results]
    solved = [_ask_again(study, index, questions) for index, questions in enumerate(asked)]
    flown = fly_again(
        tuple(case for state in solved for case in state),
        polyhedron_for_all=polyhedron_for_all,
        jobs=jobs,
        progress=progress,
    )
    reports = []
    for result, questions, cases in zip(results, asked, solved, strict=True):
        own, flown = flown[: len(cases)], flown[len(cases) :]
        reports.append(_report(result, questions, cases, own))
    return tuple(reports)


def sampled_questions(result: StateResult) -> list[Question]:
    """Choose what is asked again: both sides of some ends, and some of the grid, evenly.

    Parameters
    ----------
    result : StateResult
        What was found for an initial state.

    Returns
    -------
    list of Question
        By time of flight, then by facet; each once.
    """
    rows, found = result.intervals, {}
    for side, kind, inner in (("before_s", "begin", "begin_s"), ("after_s", "end", "end_s")):
        known = rows[rows[kind] != End.OPEN]
        for row in known[_even(len(known), SAMPLED_ENDS // 2)]:
            for tof_s in (float(row[side]), float(row[inner])):
                facet = int(row["facet"])
                found[tof_s, facet] = Question(facet, tof_s, _told(rows, facet, tof_s), math.nan)
    times, facets = result.answers.verdict.shape
    for place in _even(times * facets, SAMPLED_GRID).tolist():
        k, facet = divmod(place, facets)
        tof_s, verdict = float(result.grid.tof_s[k]), Verdict(int(result.answers.verdict[k, facet]))
        index = float(result.answers.performance_index_m2_s3[k, facet])
        found[tof_s, facet] = Question(facet, tof_s, verdict, index)
    return [found[key] for key in sorted(found)]


def _told(intervals: Rows, facet: int, tof_s: float) -> Verdict:
    _, verdict = interval_at(intervals[intervals["facet"] == facet], facet + 1, tof_s)
    return Verdict(int(verdict[facet]))


def _ask_again(study: Study, state: int, questions: list[Question]) -> list[CaseResult]:
    """Solve the questions of each time of flight, as a case of `reach run` that asked few facets."""
    cases = []
    for tof_s in sorted({question.tof_s for question in questions}):
        facets = np.array([q.facet for q in questions if q.tof_s == tof_s], dtype=np.int64)
        solutions = solve_at(study, state, tof_s, facets)
        case = case_at(study.cases[state], tof_s)
        summary = {**summarise_facets(case.asteroid.mesh, solutions), "section": {}}
        cases.append(CaseResult(case, study.cases[state].name, solutions, summary))
    return cases


def _report(
    result: StateResult, questions: list[Question], cases: list[CaseResult], flown: tuple[CaseReport, ...]
) -> IsochroneReport:
    answers = {case.case.tof_s: case.solutions for case in cases}
    wrong = [(q, now) for q in questions if (now := _answer(answers[q.tof_s], q.facet)[0]) != q.verdict]
    faults = [*faults_of(result)]
    faults += [
        f"facet {q.facet} at {q.tof_s:.9g} s is {q.verdict.name.lower()} in the file, "
        f"but {now.name.lower()} when asked again"
        for q, now in wrong
    ]
    faults += [report.faults[0].told for report in flown if report.faults]
    misses = [report.polyhedron.median_m for report in flown if report.polyhedron is not None]
    return IsochroneReport(
        case=result.case.name,
        status="complete" if not result.lost else f"{len(result.lost)} questions lost",
        flown=any(report.flown for report in flown),
        worst={"stored_performance_index": _index_apart(questions, answers), **_worst(flown)},
        fault=faults[0] if faults else "",
        questions=len(questions),
        disagreeing=len(wrong),
        flights=sum(report.flown for report in flown),
        polyhedron_miss_m=max(misses, default=None),
    )


def _answer(solutions: FacetSolutions, facet: int) -> tuple[Verdict, float]:
    row = solutions.rows[np.searchsorted(solutions.rows["facet"], facet)]
    return Verdict(int(row["verdict"])), float(row["performance_index_m2_s3"])


def _index_apart(questions: list[Question], answers: Mapping[float, FacetSolutions]) -> Check:
    """Largest relative difference of a stored J from the one found again."""
    apart = [
        abs(_answer(answers[q.tof_s], q.facet)[1] / q.index_m2_s3 - 1.0)
        for q in questions
        if not math.isnan(q.index_m2_s3)
    ]
    return Check(
        max(apart, key=lambda value: math.inf if math.isnan(value) else value, default=0.0), SAME_INDEX
    )


def _worst(flown: tuple[CaseReport, ...]) -> dict[str, Check]:
    """The worst of all flights in every respect."""
    worst: dict[str, Check] = {}
    for report in flown:
        for name, found in report.worst.items():
            check = Check(found.value, found.limit)
            if name not in worst or check.failing > worst[name].failing or check.value > worst[name].value:
                worst[name] = check
    return worst


def faults_of(result: StateResult) -> Iterator[str]:
    """Look for what cannot be true in the tables of an initial state.

    Parameters
    ----------
    result : StateResult
        As stored.

    Yields
    ------
    str
        What it is.
    """
    count = len(result.facets)
    for k, tof_s in enumerate(result.grid.tof_s.tolist()):
        _, verdict = interval_at(result.intervals, count, tof_s)
        for facet in np.flatnonzero(verdict != result.answers.verdict[k]).tolist():
            yield f"facet {facet} at {tof_s:g} s is one thing on the grid and another in its intervals"
    known = facet_numbers(result.grid, result.answers, result.intervals)
    for name in known.dtype.names or ():
        for facet in np.flatnonzero(~_equal(known[name], result.facets[name])).tolist():
            told = result.facets[name][facet]
            yield f"facet {facet}: {name} is {told}, its intervals say {known[name][facet]}"
    summary = summarise(result.case.asteroid.mesh, result.grid, result.facets, result.intervals)
    for name, value in summary.items():
        if not _same(result.summary.get(name), value):
            yield f"the summary says {name} {result.summary.get(name)}, the table {value}"


def _equal(a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.bool_]:
    """Equal to rounding, NaN to NaN."""
    return np.isclose(a.astype(np.float64), b.astype(np.float64), rtol=1e-12, atol=0.0, equal_nan=True)


def _same(a: object, b: object) -> bool:
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_same(a[key], b[key]) for key in a)
    if isinstance(a, int | float) and isinstance(b, float):
        return math.isclose(a, b, rel_tol=1e-12)
    return a == b


def _even(count: int, wanted: int) -> NDArray[np.int64]:
    """At most so many indices below a count, evenly spaced, first and last included."""
    return np.unique(np.linspace(0, count - 1, min(count, wanted)).round().astype(np.int64))
