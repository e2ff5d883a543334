"""`reach run`, step by step: cases, solved facets, the section, summaries, the file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from landing_cli import __version__
from landing_cli.parallel import WorkPlan
from landing_cli.reach.boundary import find_section, section_comparison, section_group, section_summary
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
from landing_cli.reach.summary import summarise
from landing_cli.results.identity import RunIdentity
from landing_cli.results.journal import Journal
from landing_cli.results.output import finish_output, open_output
from landing_cli.results.provenance import Stopwatch
from landing_cli.results.store import read
from landing_cli.scenario.build import build
from landing_cli.scenario.load import LoadedScenario
from landing_cli.scenario.schema import Reach
from landing_cli.scenario.sections import for_mission, reach_section
from landing_cli.scenario.show import to_yaml

COMPILING = "compiling the kernels (once after an installation; about half a minute)"
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


@dataclass(frozen=True)
class Solver:
    """Solves facets of every case, recording each chunk."""

    prepared: tuple[PreparedCase, ...]
    journal: Journal
    plan: WorkPlan
    told: Callable[[int], None]

    @property
    def facets(self) -> int:
        """Facets of the mesh."""
        return len(self.prepared[0].shared.centroids_m)

    def __call__(self, stage: str, items: NDArray[np.int64]) -> tuple[FacetSolutions, dict[int, str]]:
        """Solve items; see `facet_work` for what an item is."""
        work = partial(solve_items, self.prepared, self.facets)
        return solve_recorded(self.journal, stage, in_chunks(items), work, self.plan, self.told)


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
    built = build(loaded)
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
    total = len(cases) * len(prepared[0].shared.centroids_m) if traverse else 0
    done = 0

    def told(more: int) -> None:
        nonlocal done
        done += more
        progress(done, max(total, done))

    solver = Solver(prepared, journal, options.plan, told)
    results = _traverse(solver, cases) if traverse else ()
    if reach.method == "section" or options.compare:
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
        results.append(CaseResult(case, name, own, summarise(case.asteroid.mesh, own), lost=missing))
    return tuple(results)


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
        return CaseResult(case, name, traversed.solutions, summary, section_group(found), traversed.lost)
    solutions = join(asked)
    summary = {**summarise(mesh, solutions), "section": section}
    return CaseResult(case, name, solutions, summary, section_group(found), lost)
