"""`reach run`, step by step: cases, solved facets, the section or trace, summaries, the file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli import __version__
from landing_cli.parallel import WorkPlan
from landing_cli.reach import traced_work
from landing_cli.reach.boundary import find_section, section_comparison, section_group, section_summary
from landing_cli.reach.boundary_lines import lines_group, margin_lines
from landing_cli.reach.cases import landing_cases
from landing_cli.reach.facet_work import (
    CHUNK_FACETS,
    in_chunks,
    lost_of_case,
    of_case,
    solve_items,
)
from landing_cli.reach.free_descent import PreparedCase, prepare, survey
from landing_cli.reach.kernels import are_compiled, compile_parts
from landing_cli.reach.recorded import solve_recorded
from landing_cli.reach.records import FacetSolutions, LandingCase, Verdict, join
from landing_cli.reach.stored import CaseResult, ReachRun, run_from_result, run_to_tree
from landing_cli.reach.summary import has_margin, summarise
from landing_cli.reach.trace import Answers
from landing_cli.reach.traced import (
    answers_of,
    find_trace,
    trace_comparison,
    trace_group,
    trace_misses,
    trace_summary,
)
from landing_cli.results.identity import RunIdentity
from landing_cli.results.journal import Journal
from landing_cli.results.output import finish_output, open_output
from landing_cli.results.provenance import Stopwatch
from landing_cli.results.store import read
from landing_cli.results.tree import Group
from landing_cli.scenario.build import build
from landing_cli.scenario.load import LoadedScenario
from landing_cli.scenario.schema import Reach
from landing_cli.scenario.sections import for_mission, reach_section
from landing_cli.scenario.show import to_yaml

COMPILING = "compiling the kernels (once after an installation; 15 to 30 s)"
COMPILING_FACETS = 8


@dataclass(frozen=True)
class RunOptions:
    """What a run is told beside its scenario."""

    plan: WorkPlan
    resume: bool = False
    force: bool = False
    compare: bool = False


@dataclass(frozen=True)
class Outcome:
    """A run, and whether its result was there already."""

    run: ReachRun
    up_to_date: bool


class Counter:
    """Tells how many facets are done of those that were asked for so far."""

    def __init__(self, progress: Callable[[int, int], None]) -> None:
        self._progress = progress
        self._done = self._total = 0

    def expect(self, facets: int) -> None:
        """More facets are asked for."""
        self._total += facets

    def __call__(self, facets: int) -> None:
        """More facets are done."""
        self._done += facets
        self._progress(self._done, self._total)


@dataclass(frozen=True)
class Solver:
    """Solves facets of every case, recording each chunk."""

    prepared: tuple[PreparedCase, ...]
    journal: Journal
    plan: WorkPlan
    progress: Counter

    @property
    def facets(self) -> int:
        """Facets of the mesh."""
        return len(self.prepared[0].shared.centroids_m)

    def __call__(self, stage: str, items: NDArray[np.int64]) -> tuple[FacetSolutions, dict[int, str]]:
        """Solve items; see `facet_work` for what an item is."""
        self.progress.expect(len(items))
        work = partial(solve_items, self.prepared, self.facets)
        return solve_recorded(self.journal, stage, in_chunks(items), work, self.plan, self.progress)

    def trace(self, stage: str, items: NDArray[np.int64]) -> tuple[FacetSolutions, dict[int, str]]:
        """Solve items with their thrust margins."""
        self.progress.expect(len(items))
        work = partial(traced_work.solve_traced, self.prepared, self.facets)
        chunks = in_chunks(items, traced_work.CHUNK_FACETS)
        return solve_recorded(self.journal, stage, chunks, work, self.plan, self.progress, part_of_stage=True)


def run(
    loaded: LoadedScenario,
    output: Path,
    options: RunOptions,
    progress: Callable[[int, int], None],
    say: Callable[[str], None] = lambda _: None,
) -> Outcome:
    """Find the reachable domain of every case of a scenario and store it.

    Parameters
    ----------
    loaded : LoadedScenario
        The checked scenario.
    output : Path
        Where the result goes.
    options : RunOptions
        Backend, resume, force, compare.
    progress : callable
        Told (solved, total) facets.
    say : callable
        Told one line when something takes a while.

    Returns
    -------
    Outcome
        The run as stored.

    Raises
    ------
    LandingError
        The scenario contradicts its mesh, or the output is refused.
    """
    watch = Stopwatch()
    reach = reach_section(loaded)
    built = build(loaded, say)
    command = "reach run --compare" if options.compare else "reach run"
    identity = RunIdentity(
        command,
        to_yaml(for_mission(loaded.scenario, "reach")),
        built.shape_sha256,
        __version__,
        chunk_facets=CHUNK_FACETS,
    )
    journal = open_output(output, identity, resume=options.resume, force=options.force)
    if journal is None:
        return Outcome(run_from_result(read(output)), up_to_date=True)
    with journal:
        cases = landing_cases(reach, built)
        compiled = are_compiled(reach.descent, reach.terrain)
        if not compiled:
            say(COMPILING)
            compile_parts(cases[0][1])
        prepared = _prepare(cases)
        if not compiled:
            _compile(prepared)
        found = ReachRun(_solve(reach, cases, prepared, journal, options, progress))
        taken = {"jobs": options.plan.jobs, "backend": options.plan.backend, "resumed": int(options.resume)}
        attributes = {"mission": "reach"}
        finish_output(
            journal, run_to_tree(found), attributes, watch.provenance(**taken), complete=not found.lost_facets
        )
    return Outcome(found, up_to_date=False)


def _prepare(cases: tuple[tuple[str, LandingCase], ...]) -> tuple[PreparedCase, ...]:
    """Compute what the facets of each case share."""
    shared = survey(cases[0][1])
    return tuple(prepare(case, shared) for _, case in cases)


def _compile(prepared: tuple[PreparedCase, ...]) -> None:
    """Compile in the parent, by solving a few facets, so that no worker waits or compiles again."""
    facets = len(prepared[0].shared.centroids_m)
    solve_items(prepared, facets, np.arange(0, facets, max(1, facets // COMPILING_FACETS)))


def _solve(
    reach: Reach,
    cases: tuple[tuple[str, LandingCase], ...],
    prepared: tuple[PreparedCase, ...],
    journal: Journal,
    options: RunOptions,
    progress: Callable[[int, int], None],
) -> tuple[CaseResult, ...]:
    """Solve all cases by the scenario's method."""
    traverse = reach.method == "traverse" or options.compare
    solver = Solver(prepared, journal, options.plan, Counter(progress))
    results = _traverse(solver, cases) if traverse else ()
    if reach.method == "trace":
        results = tuple(
            _trace(solver, index, name, case, results[index] if traverse else None)
            for index, (name, case) in enumerate(cases)
        )
    elif reach.method == "section" or options.compare:
        results = tuple(
            _section(solver, reach, index, name, case, results[index] if traverse else None)
            for index, (name, case) in enumerate(cases)
        )
    return results


def _traverse(solver: Solver, cases: tuple[tuple[str, LandingCase], ...]) -> tuple[CaseResult, ...]:
    """Solve every facet of every case."""
    solutions, lost = solver("traverse", np.arange(len(cases) * solver.facets))
    results = []
    for index, (name, case) in enumerate(cases):
        own = of_case(solutions, index, solver.facets)
        missing = lost_of_case(lost, index, solver.facets)
        summary = summarise(case.asteroid.mesh, own)
        results.append(CaseResult(case, name, own, summary, lost=missing, level_set=_lines(case, own)))
    return tuple(results)


def _lines(case: LandingCase, solutions: FacetSolutions) -> Group | None:
    """The boundary tau = 1, where every facet was asked for its margin."""
    mesh, rows = case.asteroid.mesh, solutions.rows
    if case.margin and has_margin(rows) and len(rows) == len(mesh.faces):
        return lines_group(margin_lines(mesh, rows))
    return None


def _section(
    solver: Solver, reach: Reach, index: int, name: str, case: LandingCase, traversed: CaseResult | None
) -> CaseResult:
    """Find the domain of one case by section and expansion, asking the traversal where it ran."""
    mesh = case.asteroid.mesh
    asked: list[FacetSolutions] = []
    lost: dict[int, str] = {}

    def feasible(facets: NDArray[np.int64]) -> NDArray[np.bool_]:
        if traversed is not None:
            rows = traversed.solutions.rows[facets]
            return np.asarray(rows["verdict"] == Verdict.REACHABLE)
        stage = f"section {case.name} {len(asked)}"
        solutions, missing = solver(stage, np.asarray(facets, dtype=np.int64) + index * solver.facets)
        own = of_case(solutions, index, solver.facets)
        asked.append(own)
        lost.update(lost_of_case(missing, index, solver.facets))
        order = np.searchsorted(own.rows["facet"], facets)
        return np.asarray(own.rows["verdict"][order] == Verdict.REACHABLE)

    found = find_section(case, reach.section, feasible)
    section: dict[str, Any] = section_summary(found)
    if traversed is not None:
        section |= section_comparison(mesh, found, traversed.solutions)
        summary = {**traversed.summary, "section": section}
        return replace(traversed, summary=summary, boundary=section_group(found))
    solutions = join(asked)
    summary = {**summarise(mesh, solutions), "section": section}
    lines = _lines(case, solutions)
    return CaseResult(case, name, solutions, summary, section_group(found), lost, lines)


def _trace(
    solver: Solver, index: int, name: str, case: LandingCase, traversed: CaseResult | None
) -> CaseResult:
    """Find the domain of one case by its boundary; a traversal that ran tells what was missed."""
    asked: list[FacetSolutions] = []
    lost: dict[int, str] = {}

    def ask(facets: NDArray[np.int64]) -> Answers:
        solutions, missing = solver.trace(f"trace {case.name}", facets + index * solver.facets)
        asked.append(of_case(solutions, index, solver.facets))
        lost.update(lost_of_case(missing, index, solver.facets))
        return answers_of(case, asked[-1])

    found = find_trace(case, solver.prepared[index].shared, ask)
    trace = trace_summary(case, found)
    if traversed is not None:
        trace |= trace_comparison(case, found, traversed.solutions)
        boundary = trace_group(found, trace_misses(found, traversed.solutions))
        summary = {**traversed.summary, "trace": trace}
        return CaseResult(case, name, traversed.solutions, summary, boundary, traversed.lost)
    solutions = join(asked)
    summary = {**summarise(case.asteroid.mesh, solutions), "trace": trace}
    return CaseResult(case, name, solutions, summary, trace_group(found, None), lost)
