"""`reach sweep`, step by step: the grid, its cases, one list of facets, the file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from landing_cli import __version__
from landing_cli.errors import UsageError
from landing_cli.parallel import WorkPlan
from landing_cli.reach.facet_work import CHUNK_FACETS
from landing_cli.reach.free_descent import PreparedCase, Surroundings, prepare, survey
from landing_cli.reach.kernels import are_compiled, compile_parts
from landing_cli.reach.pipeline import COMPILING, COMPILING_FACETS
from landing_cli.reach.records import LandingCase
from landing_cli.results.identity import RunIdentity
from landing_cli.results.output import finish_output, open_output
from landing_cli.results.provenance import Stopwatch
from landing_cli.results.store import read
from landing_cli.scenario.load import read_document
from landing_cli.scenario.sections import for_mission
from landing_cli.scenario.show import to_yaml
from landing_cli.studies.sweep.axes import parse_axis
from landing_cli.studies.sweep.grid import Grid, ask, body_fingerprint, lay_out
from landing_cli.studies.sweep.recorded import solve_all, solve_reduced
from landing_cli.studies.sweep.records import SweepRun, gathered
from landing_cli.studies.sweep.stored import MISSION, run_from_result, run_to_tree

# facets of all cells: what is kept of them fits in half a gigabyte
MOST_SOLVES = 20_000_000


@dataclass(frozen=True)
class RunOptions:
    """What a sweep is told beside its question."""

    plan: WorkPlan
    resume: bool = False
    force: bool = False


@dataclass(frozen=True)
class Outcome:
    """A sweep, and whether its result was there already."""

    run: SweepRun
    up_to_date: bool


def grid_of(
    scenario: str,
    overrides: Sequence[str],
    over: Sequence[str],
    say: Callable[[str], None] = lambda _: None,
) -> Grid:
    """Make the grid that a command line asks for, every cell checked and built.

    Parameters
    ----------
    scenario : str
        A path, ``-``, or a bare name.
    overrides : sequence of str
        ``dotted.key=value`` each.
    over : sequence of str
        ``dotted.key=values`` each.
    say : callable
        Told one line when something takes a while.

    Returns
    -------
    Grid

    Raises
    ------
    LandingError
        No axis is given, or something about one of them, a cell or the scenario is wrong.
    """
    if not over:
        fix = "add --over reach.tof_s=600:1200:50, for instance"
        raise UsageError("a sweep needs an axis", where="--over", fix=fix)
    axes = [parse_axis(text) for text in over]
    grid = lay_out(ask(*read_document(scenario, overrides), axes), say)
    if grid.solves > MOST_SOLVES:
        told = f"{len(grid.cases)} cases x {grid.facets} facets = {grid.solves} solves"
        fix = f"at most {MOST_SOLVES}: take longer steps, or a coarser shape"
        raise UsageError(told, where="--over", fix=fix)
    return grid


def run(
    grid: Grid,
    output: Path,
    options: RunOptions,
    progress: Callable[[int, int], None],
    say: Callable[[str], None] = lambda _: None,
) -> Outcome:
    """Find the reachable domain of every cell of a grid and store it.

    Parameters
    ----------
    grid : Grid
        The cells.
    output : Path
        Where the result goes.
    options : RunOptions
        Backend, resume, force.
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
        The output is refused.
    """
    watch = Stopwatch()
    journal = open_output(output, identity_of(grid), resume=options.resume, force=options.force)
    if journal is None:
        return Outcome(run_from_result(read(output)), up_to_date=True)
    with journal:
        prepared = _prepare(grid, say)
        done = 0

        def told(more: int) -> None:
            nonlocal done
            done += more
            progress(done, grid.solves)

        work = partial(solve_reduced, prepared, grid.facets)
        columns, lost = solve_all(journal, grid.solves, work, options.plan, told)
        by_case: dict[int, dict[int, str]] = {}
        for item, why in lost.items():
            by_case.setdefault(item // grid.facets, {})[item % grid.facets] = why
        found = gathered(grid, grid.cases[0].asteroid, columns, by_case)
        taken = {"jobs": options.plan.jobs, "backend": options.plan.backend, "resumed": int(options.resume)}
        attributes = {"mission": MISSION}
        finish_output(
            journal, run_to_tree(found), attributes, watch.provenance(**taken), complete=not found.lost_facets
        )
    return Outcome(found, up_to_date=False)


def identity_of(grid: Grid) -> RunIdentity:
    """Tell what makes a sweep the same sweep: the scenario of its first cell, and its axes.

    Parameters
    ----------
    grid : Grid
        The sweep.

    Returns
    -------
    RunIdentity
    """
    over = " ".join(f"--over {axis.told()}" for axis in grid.question.axes)
    scenario = to_yaml(for_mission(grid.first.scenario, "reach"))
    return RunIdentity(
        f"reach sweep {over}", scenario, grid.surface.sha256, __version__, chunk_facets=CHUNK_FACETS
    )


def _prepare(grid: Grid, say: Callable[[str], None]) -> tuple[PreparedCase, ...]:
    """Compute what the facets of each case share, and compile in the parent what was not before."""
    families = {case.descent: place for place, case in reversed(list(enumerate(grid.cases)))}
    missing = [family for family in families if not are_compiled(family)]
    if missing:
        say(COMPILING)
    for family in missing:
        compile_parts(grid.cases[families[family]])
    prepared = prepare_cases(grid.cases)
    for family in missing:
        some = np.arange(0, grid.facets, max(1, grid.facets // COMPILING_FACETS))
        solve_reduced(prepared, grid.facets, some + families[family] * grid.facets)
    return prepared


def prepare_cases(cases: Sequence[LandingCase]) -> tuple[PreparedCase, ...]:
    """Prepare cases over one surface; equal bodies and ellipsoids are surveyed once.

    Parameters
    ----------
    cases : sequence of LandingCase
        Over one surface.

    Returns
    -------
    tuple of PreparedCase
    """
    surveys: dict[object, Surroundings] = {}
    params: dict[object, NDArray[np.float64]] = {}
    prepared = []
    for case in cases:
        body = body_fingerprint(case.asteroid)
        about = body, case.ellipsoid_m.tobytes()
        if about not in surveys:
            surveys[about] = _survey(case, surveys)
        ready = prepare(case, surveys[about])
        # a copy of a polyhedron for each of thousands of cases would not fit in the memory
        own = params.setdefault(body, ready.coarse.gravity_params)
        coarse, fine = (scaled._replace(gravity_params=own) for scaled in (ready.coarse, ready.fine))
        prepared.append(replace(ready, coarse=coarse, fine=fine))
    return tuple(prepared)


def _survey(case: LandingCase, surveys: dict[object, Surroundings]) -> Surroundings:
    """Survey a case, and let it share with an earlier survey what the surface alone decides."""
    found = survey(case)
    for known in surveys.values():
        return replace(found, surface=known.surface, centroids_m=known.centroids_m, normals=known.normals)
    return found
