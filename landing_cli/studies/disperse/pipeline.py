"""`reach disperse`, step by step: cases, draws, the verdicts of every sample, tables, the file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from landing_cli import __version__
from landing_cli.parallel import WorkPlan
from landing_cli.reach.free_descent import prepare, survey
from landing_cli.reach.kernels import are_compiled, compile_parts
from landing_cli.reach.pipeline import COMPILING, COMPILING_FACETS
from landing_cli.reach.records import LandingCase
from landing_cli.results.identity import RunIdentity
from landing_cli.results.output import finish_output, open_output
from landing_cli.results.provenance import Stopwatch
from landing_cli.results.store import read
from landing_cli.scenario.load import LoadedScenario
from landing_cli.scenario.sections import for_mission
from landing_cli.scenario.show import to_yaml
from landing_cli.studies.disperse.axes import state_axes
from landing_cli.studies.disperse.draws import deviations, standard_normals
from landing_cli.studies.disperse.pair_work import CHUNK_PAIRS, PairWork, in_chunks, verdicts_of
from landing_cli.studies.disperse.recorded import solve_recorded
from landing_cli.studies.disperse.records import (
    CaseDispersion,
    DispersionRun,
    Drawing,
    FloatArray,
    Verdicts,
)
from landing_cli.studies.disperse.request import Request, request_of
from landing_cli.studies.disperse.statistics import facet_rows
from landing_cli.studies.disperse.stored import MISSION, run_from_result, run_to_tree
from landing_cli.studies.disperse.summary import count_domains, sample_rows, summarise

COMMAND = "reach disperse"


@dataclass(frozen=True)
class RunOptions:
    """What a run is told beside its scenario."""

    plan: WorkPlan
    resume: bool = False
    force: bool = False


@dataclass(frozen=True)
class Outcome:
    """A run, and whether its result was there already."""

    run: DispersionRun
    up_to_date: bool


def run(
    loaded: LoadedScenario,
    output: Path,
    options: RunOptions,
    progress: Callable[[int, int], None],
    say: Callable[[str], None] = lambda _: None,
) -> Outcome:
    """Find how surely every facet of every case is reachable, and store it.

    Parameters
    ----------
    loaded : LoadedScenario
        The checked scenario.
    output : Path
        Where the result goes.
    options : RunOptions
        Backend, resume, force.
    progress : callable
        Told (found, total) verdicts.
    say : callable
        Told one line when something takes a while.

    Returns
    -------
    Outcome
        The run as stored.

    Raises
    ------
    LandingError
        The scenario contradicts itself or its mesh, or the output is refused.
    """
    watch = Stopwatch()
    request = request_of(loaded, say=say)
    identity = RunIdentity(
        COMMAND,
        to_yaml(for_mission(loaded.scenario, "reach", "disperse")),
        request.built.shape_sha256,
        __version__,
        chunk_facets=CHUNK_PAIRS,
    )
    journal = open_output(output, identity, resume=options.resume, force=options.force)
    if journal is None:
        return Outcome(run_from_result(read(output)), up_to_date=True)
    with journal:
        drawing = request.drawing
        drawn = deviations(drawing.spread, standard_normals(drawing.seed, drawing.samples))
        work = _work(request, drawn, say)
        done = 0

        def told(more: int) -> None:
            nonlocal done
            done += more
            progress(done, work.pairs)

        verdicts, lost = solve_recorded(journal, work.pairs, in_chunks(work.pairs), work, options.plan, told)
        found = _found(request, drawn, verdicts, lost)
        taken = {"jobs": options.plan.jobs, "backend": options.plan.backend, "resumed": int(options.resume)}
        finish_output(
            journal,
            run_to_tree(found),
            {"mission": MISSION},
            watch.provenance(**taken),
            complete=not found.lost_solves,
        )
    return Outcome(found, up_to_date=False)


def _work(request: Request, drawn: FloatArray, say: Callable[[str], None]) -> PairWork:
    """Survey the body once, prepare every case, and compile what is not compiled yet."""
    cases = [case for _, case in request.cases]
    compiled = are_compiled(cases[0].descent)
    if not compiled:
        say(COMPILING)
        compile_parts(cases[0])
    shared = survey(cases[0])
    turns = tuple(state_axes(case, request.drawing.spread.axes) for case in cases)
    work = PairWork(tuple(prepare(case, shared) for case in cases), turns, drawn)
    if not compiled:  # in the parent, so that no worker waits or compiles again
        verdicts_of(work.nominal[0], np.arange(0, work.facets, max(1, work.facets // COMPILING_FACETS)))
    return work


def _found(request: Request, drawn: FloatArray, verdicts: Verdicts, lost: dict[int, str]) -> DispersionRun:
    """Lay the verdicts out by case, sample and facet, and sum them up."""
    facets = len(request.built.asteroid.mesh.faces)
    shape = (len(request.cases), request.drawing.samples, facets)
    missing: list[dict[tuple[int, int], str]] = [{} for _ in request.cases]
    for pair, reason in lost.items():
        case, sample, facet = (int(i) for i in np.unravel_index(pair, shape))
        missing[case][sample, facet] = reason
    return DispersionRun(
        tuple(
            case_dispersion(case, name, request.drawing, drawn, own, gone)
            for (name, case), own, gone in zip(request.cases, verdicts.reshape(shape), missing, strict=True)
        )
    )


def case_dispersion(
    case: LandingCase,
    initial_state: str,
    drawing: Drawing,
    drawn: FloatArray,
    verdicts: Verdicts,
    lost: dict[tuple[int, int], str],
) -> CaseDispersion:
    """Sum up the verdicts of a case.

    Parameters
    ----------
    case : LandingCase
        Without deviation.
    initial_state : str
        Its name.
    drawing : Drawing
        How the samples were drawn.
    drawn : (samples, 9) float
        What they were.
    verdicts : (samples, facets) uint8
        What was found.
    lost : dict
        Why a facet of a sample could not be solved.

    Returns
    -------
    CaseDispersion
    """
    samples = sample_rows(case, drawing, drawn)
    count_domains(samples, case, verdicts)
    facets = facet_rows(verdicts, drawing, drawn)
    summary: dict[str, Any] = summarise(facets, samples, drawing, drawn)
    return CaseDispersion(case, initial_state, drawing, verdicts, samples, facets, summary, lost)
