"""`plan`, step by step: cases, tasks, solved plans, their re-flight, the file."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from landing_cli import __version__
from landing_cli.body.asteroid import Asteroid
from landing_cli.compile_cache import is_cached
from landing_cli.flight.acceleration_control import natural_accelerations
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.parallel import LostChunk, WorkPlan, run_chunks
from landing_cli.plan.assess import no_plan
from landing_cli.plan.records import PlanCase
from landing_cli.plan.stored import (
    CPU_ATTRIBUTE,
    MISSION,
    PlanEntry,
    PlanRun,
    plan_from_arrays,
    plan_to_arrays,
    run_from_result,
    run_to_tree,
)
from landing_cli.plan.tasks import PlanTask, SolvedTask, solve_tasks
from landing_cli.results.identity import RunIdentity
from landing_cli.results.journal import Journal
from landing_cli.results.output import finish_output, open_output
from landing_cli.results.provenance import Stopwatch
from landing_cli.results.store import read
from landing_cli.scenario.build import build
from landing_cli.scenario.load import LoadedScenario
from landing_cli.scenario.sections import for_mission
from landing_cli.scenario.show import to_yaml

COMPILING = "compiling the kernels (once after an installation; about half a minute)"
CHUNK_PLANS = 8  # of a sweep; other tasks go one by one
STORED_PATHS = 40
"""A run of more plans than this stores their controls alone: they suffice, and 360 paths make 60 MB."""


@dataclass(frozen=True, eq=False)
class Request:
    """What a plan command is asked.

    Attributes
    ----------
    command : str
        With every option that decides the numbers: ``plan bezier --shortest``.
    loaded : LoadedScenario
        With a ``plan`` section.
    asteroid : Asteroid
    spacecraft : Spacecraft
    shape_sha256 : str
    """

    command: str
    loaded: LoadedScenario
    asteroid: Asteroid
    spacecraft: Spacecraft
    shape_sha256: str


@dataclass(frozen=True)
class RunOptions:
    """How a run is carried out."""

    plan: WorkPlan
    resume: bool = False
    force: bool = False


@dataclass(frozen=True)
class Outcome:
    """A run, whether its result was there already, and why plans were lost, by name."""

    run: PlanRun
    up_to_date: bool
    lost: dict[str, str]


def request_of(command: str, loaded: LoadedScenario, say: Callable[[str], None] = lambda _: None) -> Request:
    """Make a request of a scenario file.

    Parameters
    ----------
    command : str
        With every option that decides the numbers.
    loaded : LoadedScenario
        The checked scenario.
    say : callable
        Told one line when something takes a while.

    Returns
    -------
    Request

    Raises
    ------
    InputRefused
        The scenario contradicts its mesh.
    """
    built = build(replace(loaded, scenario=for_mission(loaded.scenario, MISSION)), say)
    return Request(command, loaded, built.asteroid, built.spacecraft, built.shape_sha256)


def run(
    request: Request,
    tasks: Sequence[PlanTask],
    output: Path,
    options: RunOptions,
    progress: Callable[[int, int], None],
    say: Callable[[str], None] = lambda _: None,
) -> Outcome:
    """Solve the tasks of a command and store their plans.

    Parameters
    ----------
    request : Request
        What was asked.
    tasks : sequence of PlanTask
        In the order in which their plans are shown.
    output : Path
        Where the result goes.
    options : RunOptions
        Backend, resume, force.
    progress : callable
        Told (solved, total) plans.
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
    size = CHUNK_PLANS if len(tasks) > STORED_PATHS else 1
    text = to_yaml(for_mission(request.loaded.scenario, MISSION))
    identity = RunIdentity(request.command, text, request.shape_sha256, __version__, chunk_facets=size)
    journal = open_output(output, identity, resume=options.resume, force=options.force)
    if journal is None:
        return Outcome(run_from_result(read(output)), up_to_date=True, lost={})
    with journal:
        if not is_cached(natural_accelerations):  # every method calls it
            say(COMPILING)
        solved, lost = _solve(tasks, size, journal, options, progress)
        found = PlanRun(tuple(_entry(task, solved.get(i), lost) for i, task in enumerate(tasks)))
        taken = {"jobs": options.plan.jobs, "backend": options.plan.backend, "resumed": int(options.resume)}
        times = np.array([entry.cpu_s for entry in found.cases])
        provenance = watch.provenance(**taken, **{CPU_ATTRIBUTE: times})
        finish_output(journal, run_to_tree(found), {"mission": MISSION}, provenance, complete=not lost)
    return Outcome(found, up_to_date=False, lost=lost)


def _solve(
    tasks: Sequence[PlanTask],
    size: int,
    journal: Journal,
    options: RunOptions,
    progress: Callable[[int, int], None],
) -> tuple[dict[int, SolvedTask], dict[str, str]]:
    """Solve tasks in chunks, each recorded as it comes; take over those that the journal holds."""
    solved = {int(key): _recorded(tasks, int(key), arrays) for key, arrays in journal.records.items()}
    progress(len(solved), len(tasks))
    left = [index for index in range(len(tasks)) if index not in solved]
    chunks = [left[i : i + size] for i in range(0, len(left), size)]
    lost: dict[str, str] = {}
    work = partial(solve_tasks, tasks, repeat=size == 1)
    with closing(run_chunks(work, chunks, options.plan)) as answers:
        for _, answer in answers:
            if isinstance(answer, LostChunk):
                lost |= {tasks[index].name: answer.reason for index in answer.items}
                continue
            for item in answer:
                arrays = plan_to_arrays(item.plan, item.cpu_s, len(tasks) <= STORED_PATHS)
                journal.append(str(item.index), arrays)
                solved[item.index] = _recorded(tasks, item.index, arrays)
            progress(len(solved), len(tasks))
    return solved, lost


def _recorded(tasks: Sequence[PlanTask], index: int, arrays: dict[str, np.ndarray]) -> SolvedTask:
    plan, cpu_s = plan_from_arrays(arrays, tasks[index].case.asteroid.gravity)
    return SolvedTask(index, plan, cpu_s)


def _entry(task: PlanTask, solved: SolvedTask | None, lost: dict[str, str]) -> PlanEntry:
    """Put a task and its answer together; a plan may bring a time of flight of its own."""
    if solved is None:
        reason = f"lost: {lost.get(task.name, 'not solved')}"
        plan = no_plan(task.case, task.method, "unresolved", reason, parameters=task.parameters)
        return PlanEntry(task.name, task.case, plan, math.nan)
    return PlanEntry(task.name, _flown_case(task.case, solved.plan.tof_s), solved.plan, solved.cpu_s)


def _flown_case(case: PlanCase, tof_s: float) -> PlanCase:
    return case if tof_s == case.tof_s else replace(case, tof_s=tof_s)
